"""Reference postures and joint limits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cardbox_tracker.person import posture as posture_module
from cardbox_tracker.person.posture import (
    FARTHEST_M,
    FIRST_ANGLES,
    JOINT_LIMITS,
    LEFT_ARM,
    N_STATE,
    NEAREST_M,
    PLACE,
    POSTURE,
    REFERENCE_NAMES,
    RIGHT_ARM,
    TORSO,
    TORSO_X,
    TORSO_Z,
    TURNS,
    clip_to_limits,
    place_limits,
    reference_posture,
    state_limits,
)
from cardbox_tracker.person.skeleton import JOINT_NAMES, PLACE_NAMES


def test_the_slices_hold_the_joints_of_their_part() -> None:
    assert len(JOINT_NAMES) == 12
    assert all(name.startswith("torso_") for name in JOINT_NAMES[TORSO])
    assert all(name.startswith("left_") for name in JOINT_NAMES[LEFT_ARM])
    assert all(name.startswith("right_") for name in JOINT_NAMES[RIGHT_ARM])
    left = [name.removeprefix("left_") for name in JOINT_NAMES[LEFT_ARM]]
    assert left == [name.removeprefix("right_") for name in JOINT_NAMES[RIGHT_ARM]]


def test_the_indices_are_those_of_the_names() -> None:
    names = (*JOINT_NAMES, *PLACE_NAMES)
    assert (len(names), names[POSTURE], names[PLACE]) == (N_STATE, JOINT_NAMES, PLACE_NAMES)
    for name in ("TORSO_Y", "TORSO_X", "TORSO_Z"):
        assert names[getattr(posture_module, name)] == name.lower()
    assert names[TURNS] == ("torso_roll", "torso_pitch", "torso_yaw")
    for name in ("ROLL", "PITCH", "YAW"):
        assert names[getattr(posture_module, name)] == f"torso_{name.lower()}"
    arm = ("SHOULDER_ABDUCTION", "SHOULDER_FLEXION", "ELBOW_ABDUCTION", "ELBOW_FLEXION")
    for side, first in zip(("left", "right"), FIRST_ANGLES, strict=True):
        for name in arm:
            assert names[first + getattr(posture_module, name)] == f"{side}_{name.lower()}"


@pytest.mark.parametrize(
    ("name", "turn", "degrees"),
    [
        ("front", "left", [0, 0, 0, 0, 20, 0, 0, 0, 20, 0, 0, 0]),
        ("front", "right", [0, 0, 0, 0, 20, 0, 0, 0, 20, 0, 0, 0]),
        ("side", "left", [0, 0, 0, 90, 20, 0, 0, 0, 20, 0, 0, 0]),
        ("side", "right", [0, 0, 0, -90, 20, 0, 0, 0, 20, 0, 0, 0]),
        ("arms", "left", [0, 0, 0, 0, 80, 0, 0, 0, 80, 0, 0, 0]),
    ],
)
def test_reference_postures(name: str, turn: str, degrees: list[float]) -> None:
    np.testing.assert_allclose(np.degrees(reference_posture(name, turn)), degrees, atol=1e-9)


def test_a_reference_posture_is_a_copy() -> None:
    assert REFERENCE_NAMES == ("front", "side", "arms")
    changed = reference_posture("front")
    changed[0] = 1.0
    assert reference_posture("front")[0] == 0.0


@pytest.mark.parametrize(
    ("name", "turn", "text"),
    [("back", "left", "posture 'back'"), ("", "left", "posture ''"), ("side", "up", "turn 'up'")],
)
def test_an_unknown_name_is_refused_with_those_that_are_known(
    name: str, turn: str, text: str
) -> None:
    with pytest.raises(ValueError, match=f"{text}.* one of"):
        reference_posture(name, turn)


def test_limits_are_ordered_around_rest_and_alike_for_both_arms() -> None:
    assert JOINT_LIMITS.shape == (12, 2)
    assert np.all(JOINT_LIMITS[:, 0] < 0)
    assert np.all(JOINT_LIMITS[:, 1] > 0)
    np.testing.assert_array_equal(JOINT_LIMITS[LEFT_ARM], JOINT_LIMITS[RIGHT_ARM])
    # No joint but torso_y is metres: a limit beyond half a turn would be degrees.
    assert np.abs(JOINT_LIMITS[1:]).max() <= np.pi
    with pytest.raises(ValueError, match="read-only"):
        JOINT_LIMITS[0, 0] = 0.0


@pytest.mark.parametrize("name", ["front", "arms"])
def test_facing_references_lie_inside_the_limits(name: str) -> None:
    posture = reference_posture(name)
    np.testing.assert_array_equal(clip_to_limits(posture), posture)


@given(arrays(np.float64, (2, 3, 12), elements=st.floats(-10, 10)))
def test_clipping_moves_into_the_limits_and_only_what_is_outside(postures: np.ndarray) -> None:
    clipped = clip_to_limits(postures)
    low, high = JOINT_LIMITS.T
    assert np.all((clipped >= low) & (clipped <= high))
    inside = (postures >= low) & (postures <= high)
    np.testing.assert_array_equal(clipped[inside], postures[inside])
    np.testing.assert_array_equal(clip_to_limits(clipped), clipped)
    limits = np.broadcast_to(np.where(postures < low, low, high), postures.shape)
    np.testing.assert_array_equal(clipped[~inside], limits[~inside])


@given(distance_m=st.floats(0.3, 20.0))
def test_the_limits_of_the_place_are_distances_from_the_camera(distance_m: float) -> None:
    (low_m, high_m), (lower_m, upper_m) = place_limits(distance_m).tolist()
    assert low_m < 0.0 <= high_m, "the measured place is within its limits"
    assert lower_m < 0.0 < upper_m
    # torso_x is positive towards the camera, which a person never reaches.
    assert distance_m - high_m == pytest.approx(min(NEAREST_M, distance_m))
    assert distance_m - low_m >= FARTHEST_M - 1e-9
    limits = state_limits(distance_m)
    np.testing.assert_array_equal(limits[[TORSO_X, TORSO_Z]], place_limits(distance_m))
    assert not limits.flags.writeable


def test_people_who_were_measured_apart_have_the_same_range_in_the_room() -> None:
    near, far = place_limits(1.5)[0], place_limits(4.0)[0]
    np.testing.assert_allclose(1.5 - near, 4.0 - far)
