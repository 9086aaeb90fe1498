"""What points say of shoulder, elbow, wrist and knuckles, by arm."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.detection.image_points import POINT_INDEX, POINT_NAMES, ImagePoints
from cardbox_tracker.estimation.filtering.point_features import (
    POINT_FEATURES,
    features_of_points,
)
from cardbox_tracker.vision.camera import Camera

# 2 m away, a metre is 150 pixels.
CAMERA = Camera(320, 240, 300.0, 300.0, 160.0, 120.0)
LEFT = [[0.2, 0.0, 2.0], [0.2, 0.3, 2.0], [0.2, 0.6, 2.0]]
JOINTS = np.array([*LEFT, *(np.array(LEFT) * (-1, 1, 1))])
SHOULDER, ELBOW, WRIST, KNUCKLES = (slice(3 * n, 3 * n + 3) for n in range(4))
UPPER_ARM, FOREARM = slice(12, 14), slice(14, 16)


def places() -> dict[str, np.ndarray]:
    """Return the points that agree with the joints, metres in the optical frame."""
    found = {name: np.array([0.0, -0.3, 2.0]) for name in POINT_NAMES}
    for arm, side in enumerate(("left", "right")):
        shoulder, elbow, hand = JOINTS[3 * arm : 3 * arm + 3]
        found[f"{side}_shoulder"], found[f"{side}_elbow"] = shoulder, elbow
        found[f"{side}_wrist"] = elbow + 0.73 * (hand - elbow)
        found[f"{side}_index"] = found[f"{side}_little_finger"] = hand
    return found


def points(
    at_m: dict[str, np.ndarray], scores: dict[str, float] | None = None, spatial: bool = True
) -> ImagePoints:
    space_m = np.array([at_m[name] for name in POINT_NAMES])
    known = np.array([(scores or {}).get(name, 1.0) for name in POINT_NAMES])
    return ImagePoints(CAMERA.project(space_m), known, spatial_m=space_m if spatial else None)


def test_points_at_the_joints_have_no_offsets() -> None:
    features = features_of_points(points(places()), CAMERA, JOINTS)
    assert features.shape == (2, POINT_FEATURES)
    assert features == pytest.approx(np.array([*[0, 0, 1] * 4, 0, 1, 0, 1] * 2).reshape(2, -1))


def test_offsets_are_metres_times_the_score() -> None:
    found, scores = places(), {"left_elbow": 0.5}
    # 3 cm to the right and 6 cm up of the elbow, and the knuckles 2 cm down.
    found["left_elbow"] = JOINTS[1] + (0.03, -0.06, 0.0)
    found["left_index"] = JOINTS[2] + (0.0, 0.03, 0.0)
    found["left_little_finger"] = JOINTS[2] + (0.0, 0.01, 0.0)
    left, right = features_of_points(points(found, scores, spatial=False), CAMERA, JOINTS)
    assert left[SHOULDER] == pytest.approx([0.0, 0.0, 1.0])
    assert left[ELBOW] == pytest.approx([0.015, -0.03, 0.5])
    assert left[WRIST] == pytest.approx([0.0, 0.0, 1.0])
    assert left[KNUCKLES] == pytest.approx([0.0, 0.02, 1.0])
    assert right[ELBOW] == pytest.approx([0.0, 0.0, 1.0])
    # Without positions in space, nothing is known of bones.
    assert (left[12:] == 0.0).all() and (right[12:] == 0.0).all()


def test_bones_are_compared_along_the_line_of_sight() -> None:
    """The left elbow comes forward by 3 to 4, and the hand goes back from there."""
    found = places()
    found["left_elbow"] = JOINTS[0] + (0.0, 0.4, -0.3)
    found["left_index"] = found["left_little_finger"] = found["left_elbow"] + (0.0, 0.0, 0.3)
    left, right = features_of_points(points(found, {"left_wrist": 0.4}), CAMERA, JOINTS)
    # The shoulders' middle is ahead, so the line of sight is the optical axis.
    assert left[UPPER_ARM] == pytest.approx([-0.6, 1.0])
    assert left[FOREARM] == pytest.approx([0.4, 0.4])
    assert right[UPPER_ARM] == pytest.approx([0.0, 1.0])


def test_the_result_counts_along_the_same_line() -> None:
    joints = JOINTS.copy()
    joints[5] = joints[4] + (0.0, 0.3, -0.4)
    _, right = features_of_points(points(places()), CAMERA, joints)
    assert right[UPPER_ARM] == pytest.approx([0.0, 1.0])
    # The point hangs, whereas the result comes forward by 4 to 5.
    assert right[FOREARM] == pytest.approx([0.8, 1.0])


def test_the_line_of_sight_is_level() -> None:
    """A forearm that hangs is level neither for points nor for a camera that looks down."""
    camera = CAMERA.with_pitch(0.4)
    joints = camera.reference_to_optical(
        np.array([[-2.0, y, z] for y in (0.2, -0.2) for z in (0.0, -0.3, -0.6)])
    )
    features = features_of_points(points(places()), camera, joints)
    # Points in space are given in a level frame, in which they hang.
    assert features[:, 12::2] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("given", [None, ImagePoints(np.full((17, 2), np.nan), np.zeros(17))])
def test_zeros_without_points(given: ImagePoints | None) -> None:
    features = features_of_points(given, CAMERA, JOINTS)
    assert features.shape == (2, POINT_FEATURES) and not features.any()


def test_unknown_points_have_zeros() -> None:
    """One knuckle alone is not compared."""
    left, right = features_of_points(
        points(places(), {"left_index": 0.0, "right_elbow": 0.0}), CAMERA, JOINTS
    )
    assert not left[KNUCKLES].any() and left[WRIST][2] == 1.0
    assert not right[ELBOW].any()
    assert not right[12:].any() and left[13] == 1.0


@given(st.integers(0, 2**32 - 1))
def test_arms_exchange_their_features_in_the_mirror(seed: int) -> None:
    rng = np.random.default_rng(seed)
    spatial_m = np.array(list(places().values())) + rng.normal(0.0, 0.1, (17, 3))
    scores = rng.random(17)
    joints = JOINTS + rng.normal(0.0, 0.1, (6, 3))
    flip = np.array([-1.0, 1.0, 1.0])
    other = [
        POINT_INDEX[name.replace("left", "r-").replace("right", "left").replace("r-", "right")]
        for name in POINT_NAMES
    ]
    here = ImagePoints(CAMERA.project(spatial_m), scores, spatial_m=spatial_m)
    mirrored_m = (spatial_m * flip)[other]
    there = ImagePoints(CAMERA.project(mirrored_m), scores[other], spatial_m=mirrored_m)
    of_here = features_of_points(here, CAMERA, joints)
    of_there = features_of_points(there, CAMERA, (joints * flip)[[3, 4, 5, 0, 1, 2]])
    assert of_there[::-1] == pytest.approx(of_here, abs=1e-9)
    assert np.isfinite(of_here).all()
