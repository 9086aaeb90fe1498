"""Simulated points are true joints with the errors that their constants say."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.detection.image_points import POINT_INDEX, ImagePoints
from cardbox_tracker.vision.camera import Camera
from learning import simulated_points
from learning.simulated_points import SimulatedDetector

CAMERA = Camera(320, 240, 200.0, 200.0, 159.5, 119.5, pitch_rad=0.3)
FPS = 30.0
# Of a person who looks at the camera, metres in the level reference frame.
PLACES = {
    "head": (-2.0, 0.0, 0.4),
    "hips": (-2.0, 0.0, -0.5),
    "left_shoulder": (-2.0, 0.2, 0.1),
    "left_elbow": (-2.0, 0.2, -0.2),
    "left_hand": (-1.8, 0.2, -0.4),
    "right_shoulder": (-2.0, -0.2, 0.1),
    "right_elbow": (-2.0, -0.2, -0.2),
    "right_hand": (-2.0, -0.2, -0.5),
}
AXES = {
    "head": (0.0, 1.0, 0.0),
    "face": (1.0, 0.0, 0.0),
    "hips": (0.0, 1.0, 0.0),
    "left_hand": (1.0, 0.0, 0.0),
    "right_hand": (1.0, 0.0, 0.0),
}
NOTHING = np.full((240, 320), np.inf)
SCATTER = ("_CONSTANT_M", "_SLOW_M", "_WHITE_M", "_DEPTH_CONSTANT_M", "_DEPTH_SLOW_M")


@pytest.fixture
def exact(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    for name in (*SCATTER, "_FORWARD", "_LOST", "_EXCHANGED"):
        monkeypatch.setattr(simulated_points, name, 0.0)
    return monkeypatch


def optical(given: dict[str, tuple[float, float, float]]) -> dict[str, np.ndarray]:
    return {name: CAMERA.reference_to_optical(np.array(one)) for name, one in given.items()}


def found(depth_m: np.ndarray = NOTHING, seed: int = 0, images: int = 1) -> list[ImagePoints]:
    detect = SimulatedDetector(CAMERA, FPS, np.random.default_rng(seed))
    return [detect(optical(PLACES), optical(AXES), depth_m) for _ in range(images)]


def pixel(place_m: tuple[float, ...]) -> np.ndarray:
    return CAMERA.project(CAMERA.reference_to_optical(np.array(place_m)))


@pytest.mark.usefixtures("exact")
def test_without_errors_points_are_the_projected_joints() -> None:
    (points,) = found()
    wrist = np.array(PLACES["left_elbow"]) + 0.73 * np.array([0.2, 0.0, -0.2])
    expected = {
        "left_shoulder": PLACES["left_shoulder"],
        "right_elbow": PLACES["right_elbow"],
        "left_wrist": tuple(wrist),
        # The index finger is ahead of the middle of the knuckles.
        "left_index": (-1.77, 0.2, -0.4),
        "left_little_finger": (-1.83, 0.2, -0.4),
        "nose": (-1.9, 0.0, 0.4),
        "left_eye": (-1.915, 0.03, 0.42),
        "right_ear": (-2.0, -0.072, 0.4),
        "left_hip": (-2.0, 0.085, -0.5),
    }
    for name, place in expected.items():
        assert points.px[POINT_INDEX[name]] == pytest.approx(pixel(place)), name
    assert points.scores.min() >= 0.8


@pytest.mark.usefixtures("exact")
def test_positions_in_space_are_level_whatever_the_pitch_is() -> None:
    (points,) = found()
    assert points.spatial_m is not None
    at = {name: points.spatial_m[index] for name, index in POINT_INDEX.items()}
    # The elbow is right below the shoulder, and y points down.
    assert at["left_elbow"] - at["left_shoulder"] == pytest.approx([0.0, 0.3, 0.0])
    # The person's left is on the right of the image.
    assert at["left_shoulder"] - at["right_shoulder"] == pytest.approx([0.4, 0.0, 0.0])
    # The nose is nearer than the ears, and z points away.
    assert (at["nose"] - at["left_ear"])[2] == pytest.approx(-0.1)


def test_forearms_come_forward_by_a_share_of_their_length(exact: pytest.MonkeyPatch) -> None:
    (before,) = found()
    exact.setattr(simulated_points, "_FORWARD", 0.2)
    (after,) = found()
    assert before.spatial_m is not None and after.spatial_m is not None
    moved = after.spatial_m - before.spatial_m
    # The wrist hangs 0.73 of 30 cm below the elbow.
    assert moved[POINT_INDEX["right_wrist"]] == pytest.approx([0.0, 0.0, -0.2 * 0.73 * 0.3])
    assert moved[POINT_INDEX["right_index"], 2] == pytest.approx(-0.2 * 0.73 * 0.3)
    assert moved[POINT_INDEX["right_elbow"]] == pytest.approx(0.0)
    np.testing.assert_array_equal(before.px, after.px)


@pytest.mark.usefixtures("exact")
def test_joints_behind_a_surface_have_lower_scores() -> None:
    depth_m = NOTHING.copy()
    column, row = np.rint(pixel(PLACES["right_elbow"])).astype(int)
    z_m = CAMERA.reference_to_optical(np.array(PLACES["right_elbow"]))[2]
    scores = []
    # The surface of the arm itself is a few centimetres nearer than the joint.
    for nearer_m in (0.05, 0.2):
        depth_m[row - 3 : row + 4, column - 3 : column + 4] = z_m - nearer_m
        each = [points.scores for points in found(depth_m, images=20)]
        scores.append(np.array(each)[:, POINT_INDEX["right_elbow"]])
        assert np.array(each)[:, POINT_INDEX["left_elbow"]].min() >= 0.8
    assert scores[0].min() >= 0.8
    assert scores[1].min() >= 0.2 and scores[1].max() < 0.8


def test_errors_of_hidden_joints_are_twice_as_large(exact: pytest.MonkeyPatch) -> None:
    true = found()[0].px
    exact.setattr(simulated_points, "_CONSTANT_M", 0.01)
    seen, hidden = (found(depth_m)[0].px - true for depth_m in (NOTHING, np.zeros((240, 320))))
    assert hidden == pytest.approx(2.0 * seen, rel=1e-3)
    assert np.abs(seen).max() > 0.3


def test_points_of_a_lost_hand_have_small_scores(exact: pytest.MonkeyPatch) -> None:
    exact.setattr(simulated_points, "_LOST", FPS)
    (points,) = found()
    of_hand = [name.endswith(("wrist", "index", "finger")) for name in POINT_INDEX]
    assert points.scores[of_hand].max() <= 0.2
    assert points.scores[~np.array(of_hand)].min() >= 0.8


def test_exchanged_arms_have_each_others_places(exact: pytest.MonkeyPatch) -> None:
    (right,) = found()
    exact.setattr(simulated_points, "_EXCHANGED", FPS)
    (wrong,) = found()
    for joint in ("elbow", "wrist", "index", "little_finger"):
        left, other = POINT_INDEX[f"left_{joint}"], POINT_INDEX[f"right_{joint}"]
        np.testing.assert_allclose(wrong.px[[left, other]], right.px[[other, left]])
    shoulder = POINT_INDEX["left_shoulder"]
    np.testing.assert_allclose(wrong.px[shoulder], right.px[shoulder])


@pytest.mark.usefixtures("exact")
def test_points_beside_the_image_have_small_scores() -> None:
    joints = optical(PLACES | {"left_hand": (-2.0, 3.0, -0.2)})
    detect = SimulatedDetector(CAMERA, FPS, np.random.default_rng(0))
    points = detect(joints, optical(AXES), NOTHING)
    assert points.scores[POINT_INDEX["left_index"]] <= 0.2
    assert points.scores[POINT_INDEX["left_elbow"]] >= 0.8


def test_errors_have_the_deviations_of_the_constants(monkeypatch: pytest.MonkeyPatch) -> None:
    """A shoulder 2.0 m away, seen by 60 detectors that are right about its depth."""
    for name in ("_LOST", "_EXCHANGED", "_DEPTH_CONSTANT_M", "_DEPTH_SLOW_M"):
        monkeypatch.setattr(simulated_points, name, 0.0)
    name = "left_shoulder"
    place_m = CAMERA.reference_to_optical(np.array(PLACES[name]))
    metre_px = CAMERA.fx / place_m[2]
    each = np.array(
        [[one.px[POINT_INDEX[name]] for one in found(seed=n, images=20)] for n in range(60)]
    )
    off_m = (each - CAMERA.project(place_m)) / metre_px
    expected = np.hypot(np.hypot(0.012, 0.012), 0.006)
    assert off_m.std() == pytest.approx(expected, rel=0.15)
    # Within a recording the constant part remains.
    assert 0.012 < off_m.mean(axis=1).std() < expected


def test_the_same_seed_gives_the_same_points() -> None:
    for one, other in zip(found(seed=3, images=4), found(seed=3, images=4), strict=True):
        np.testing.assert_array_equal(one.px, other.px)
        np.testing.assert_array_equal(one.scores, other.scores)
