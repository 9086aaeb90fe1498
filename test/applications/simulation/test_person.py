"""The synthetic person's skeleton: shoulders rise with the arms, fingers reach beyond the hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.applications.simulation.person import (
    FINGER_REACH,
    girdle_lift_m,
    person_frames,
    person_parts,
)
from cardbox_tracker.measuring.shoulders import GIRDLE_RISE
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_JOINTS, reference_posture

BODY = BodyModel.of(hip_height_m=-0.51)
BREADTH_M = BODY.size("shoulder_breadth")


def raised(degrees: float, **angles_deg: float) -> np.ndarray:
    posture = np.zeros(N_JOINTS)
    posture[4] = np.radians(degrees)
    posture[3] = np.radians(angles_deg.get("yaw", 0.0))
    posture[1] = np.radians(angles_deg.get("roll", 0.0))
    return posture


@pytest.mark.parametrize(
    ("elevation_deg", "expected_of_breadth"),
    [
        (0.0, 0.0),
        (30.0, 0.0),
        # 50 degrees beyond the first 30 lift the clavicle by 9 degrees.
        (80.0, 0.43 * np.sin(np.radians(9.0))),
        (180.0, 0.43 * np.sin(np.radians(27.0))),
    ],
)
def test_the_lift_by_hand(elevation_deg: float, expected_of_breadth: float) -> None:
    lift = girdle_lift_m(0.4, np.radians(elevation_deg))
    assert lift == pytest.approx(0.4 * expected_of_breadth, abs=1e-12)


def test_the_measurement_expects_the_lift_of_the_reference_arms() -> None:
    assert girdle_lift_m(1.0, reference_posture("arms")[4]) == pytest.approx(GIRDLE_RISE, abs=1e-3)


def test_hanging_arms_are_those_of_the_model() -> None:
    for name in ("front", "side"):
        posture = reference_posture(name)
        np.testing.assert_allclose(
            person_frames(BODY, posture).keypoints_m, pose(BODY.rigid, posture).keypoints_m
        )


@pytest.mark.parametrize("roll", [0.0, 20.0])
def test_a_raised_arm_is_lifted_along_the_torso_and_the_other_is_not(roll: float) -> None:
    posture = raised(90.0, yaw=40.0, roll=roll)
    moved = person_frames(BODY, posture).keypoints_m - pose(BODY.rigid, posture).keypoints_m
    up = pose(BODY.rigid, posture).torso_rotation[:, 2]
    lift = girdle_lift_m(BREADTH_M, np.pi / 2)
    np.testing.assert_allclose(moved[:3], np.tile(lift * up, (3, 1)), atol=1e-12)
    np.testing.assert_allclose(moved[3:], 0.0, atol=1e-12)


def test_an_arm_raised_forwards_is_lifted_as_much() -> None:
    forwards = np.zeros(N_JOINTS)
    forwards[5] = np.pi / 2
    sideways = raised(90.0)
    heights = [person_frames(BODY, p).left.shoulder[2] for p in (forwards, sideways)]
    assert heights[0] == pytest.approx(heights[1])


@given(st.lists(st.floats(-1.5, 1.5), min_size=2 * N_JOINTS, max_size=2 * N_JOINTS))
def test_many_postures_are_those_one_by_one(angles: list[float]) -> None:
    postures = np.array(angles).reshape(2, N_JOINTS)
    together = person_frames(BODY, postures).keypoints_m
    for posture, points in zip(postures, together, strict=True):
        np.testing.assert_allclose(points, person_frames(BODY, posture).keypoints_m, atol=1e-12)


def test_fingers_end_beyond_the_hand_and_are_narrower() -> None:
    posture = raised(90.0)
    left = person_frames(BODY, posture).left
    rings = max(person_parts(BODY, posture), key=lambda part: part.rings[..., 1].max()).rings
    beyond = rings[..., 1].max() - left.hand[1]
    assert beyond == pytest.approx(FINGER_REACH * BODY.size("forearm_length"))
    at_hand = np.abs(rings[:, 0, 1] - left.hand[1]).argmin()
    widths = np.ptp(rings[..., 2], axis=1)
    assert np.all(widths[at_hand + 1 :] < 0.7 * widths[at_hand])
