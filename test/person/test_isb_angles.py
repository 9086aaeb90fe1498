"""Angles of the ISB: postures by hand, and directions computed back from the angles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.person.isb_angles import (
    ANATOMICAL_NAMES,
    LEAST_BENT_RAD,
    LEAST_RAISED_RAD,
    anatomical_angles,
    arm_angles,
    isb_angles,
    thorax_angles,
)
from cardbox_tracker.person.skeleton import JOINT_NAMES, rotation_x, rotation_y, rotation_z

# Directions in the torso's frame: forwards, to the person's left, up.
FORWARD, LEFT, UP = np.eye(3)
NAN = np.nan


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(
    ("upper_arm", "forearm", "expected_deg"),
    [
        # Direction of the limbs of a left arm; plane, elevation, internal rotation, elbow.
        (-UP, FORWARD, (NAN, 0, NAN, 90)),
        (LEFT, LEFT, (0, -90, NAN, 0)),
        (LEFT, FORWARD, (0, -90, 0, 90)),
        (LEFT, UP, (0, -90, -90, 90)),
        (LEFT, -UP, (0, -90, 90, 90)),
        (FORWARD, FORWARD, (90, -90, NAN, 0)),
        (FORWARD, -LEFT, (90, -90, 0, 90)),
        (FORWARD, UP, (90, -90, -90, 90)),
        (-UP - FORWARD, -UP - FORWARD, (-90, -45, NAN, 0)),
        (LEFT - UP, LEFT + UP, (0, -45, -90, 90)),
    ],
)
def test_arms_by_hand(
    side: float, upper_arm: np.ndarray, forearm: np.ndarray, expected_deg: tuple[float, ...]
) -> None:
    mirror = np.array([1.0, side, 1.0])
    limbs = [(v / np.linalg.norm(v) * mirror)[None] for v in (upper_arm, forearm)]
    found = np.degrees(arm_angles(*limbs, side=side))[0]
    assert found == pytest.approx(np.array(expected_deg, float), abs=1e-9, nan_ok=True)


@pytest.mark.parametrize(
    ("joint", "expected"),
    [(1, (0.0, 0.3, 0.0)), (2, (-0.3, 0.0, 0.0)), (3, (0.0, 0.0, 0.3))],
)
def test_one_angle_of_the_torso_is_one_of_the_thorax(
    joint: int, expected: tuple[float, ...]
) -> None:
    posture = np.zeros((1, 12))
    posture[0, joint] = 0.3
    assert thorax_angles(posture)[0] == pytest.approx(expected)


turn = st.floats(-1.5, 1.5)


@given(turn, turn, turn)
def test_the_thorax_is_turned_by_its_angles(roll: float, pitch: float, yaw: float) -> None:
    posture = np.zeros((1, 12))
    posture[0, 1:4] = roll, pitch, yaw
    extension, lateral, axial = thorax_angles(posture)[0]
    torso = rotation_z(np.array(yaw)) @ rotation_y(np.array(pitch)) @ rotation_x(np.array(roll))
    # Z of the ISB is the right, -Y of the body frame; X is forwards, Y is up, Z.
    again = rotation_y(-extension) @ rotation_x(lateral) @ rotation_z(axial)
    assert again == pytest.approx(torso, abs=1e-9)


angle = st.floats(-3.0, 3.0)


@given(angle, angle, angle, angle, st.sampled_from([1.0, -1.0]))
def test_limbs_point_where_the_angles_say(
    a: float, b: float, c: float, d: float, side: float
) -> None:
    posture = np.zeros((1, 12))
    first = 4 if side > 0 else 8
    posture[0, first : first + 4] = a, b, c, d
    angles = isb_angles(posture)[0, 3:7] if side > 0 else isb_angles(posture)[0, 7:]
    plane, elevation, rotation, elbow = angles
    upper = rotation_x(np.array(side * a)) @ rotation_y(np.array(-b))
    lower = upper @ rotation_x(np.array(side * c)) @ rotation_y(np.array(-d))
    raised = np.arccos(np.clip(upper[2, 2], -1, 1))
    assert -elevation == pytest.approx(raised, abs=1e-6)
    assert np.cos(elbow) == pytest.approx(upper[:, 2] @ lower[:, 2], abs=1e-9)
    is_aside = LEAST_RAISED_RAD <= raised <= np.pi - LEAST_RAISED_RAD
    is_bent = LEAST_BENT_RAD <= elbow <= np.pi - LEAST_BENT_RAD
    assert (np.isfinite(plane), np.isfinite(rotation)) == (is_aside, is_aside and is_bent)
    if not np.isfinite(rotation):
        return
    # Y-X'-Y'' in axes forwards, up, right; the left arm is the mirror image of a right one.
    humerus = rotation_y(plane) @ rotation_x(elevation) @ rotation_y(rotation)
    limbs = humerus @ np.array([(0.0, -1.0, 0.0), (np.sin(elbow), -np.cos(elbow), 0.0)]).T
    forward, up, right = limbs
    again = np.stack([forward, side * right, up])
    assert again == pytest.approx(np.stack([-upper[:, 2], -lower[:, 2]], axis=1), abs=1e-6)


@pytest.mark.parametrize(
    ("joints_deg", "expected_deg"),
    [
        ({}, (0, 0, NAN)),
        ({"elbow_flexion": 62}, (62, 0, NAN)),
        ({"elbow_abduction": -62}, (62, 0, NAN)),
        ({"shoulder_abduction": 90, "elbow_flexion": 30}, (30, 90, 0)),
        ({"shoulder_flexion": 45}, (0, 45, 90)),
        ({"shoulder_flexion": -30}, (0, 30, -90)),
    ],
)
@pytest.mark.parametrize("side", ["left", "right"])
def test_arms_in_plain_words(
    side: str, joints_deg: dict[str, float], expected_deg: tuple[float, ...]
) -> None:
    posture = np.zeros(12)
    for name, value in joints_deg.items():
        posture[JOINT_NAMES.index(f"{side}_{name}")] = np.radians(value)
    found = dict(zip(ANATOMICAL_NAMES, anatomical_angles(posture[None])[0], strict=True))
    of_arm = [found[f"{side}_{name}_deg"] for name in ("elbow_bend", "arm_elevation", "arm_plane")]
    assert of_arm == pytest.approx(expected_deg, abs=1e-6, nan_ok=True)


def test_the_trunk_leans_where_the_person_faces() -> None:
    posture = np.zeros(12)
    posture[[1, 2, 3]] = np.radians([5.0, 20.0, 70.0])
    found = dict(zip(ANATOMICAL_NAMES, anatomical_angles(posture[None])[0], strict=True))
    assert found["trunk_lean_deg"] == pytest.approx(20.0)
    assert found["trunk_side_lean_deg"] == pytest.approx(5.0)
    assert found["left_arm_elevation_deg"] == pytest.approx(0.0, abs=1e-6)
