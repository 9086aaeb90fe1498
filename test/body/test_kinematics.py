"""Forward kinematics against values by hand, and what holds in every posture.

By hand, for the default body at 2 m, hips 0.5 m below the camera: the torso's top is at
-0.5 + 0.17 + 0.36 = 0.03 m, the shoulders at 0.03 - 0.05 = -0.02 m, 0.18 m to either side; a
hanging arm reaches 0.27 + 0.36 = 0.63 m down.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cardbox_tracker.body.kinematics import (
    KEYPOINT_NAMES,
    forward_kinematics,
    keypoints_m,
    rotation_x,
    rotation_y,
    rotation_z,
)
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import JOINT_NAMES, LEFT_ARM, N_JOINTS, RIGHT_ARM

BODY = BodyModel()
ANY_POSTURE = arrays(np.float64, N_JOINTS, elements=st.floats(-3.1, 3.1))
NEAR = {"atol": 1e-12}


def posture(**degrees: float) -> np.ndarray:
    """A posture of joints in degrees; ``torso_y`` in metres."""
    values = np.zeros(N_JOINTS)
    for name, value in degrees.items():
        values[JOINT_NAMES.index(name)] = value if name == "torso_y" else np.radians(value)
    return values


def mirrored(d: np.ndarray) -> np.ndarray:
    """The posture in a mirror in the plane Y = 0."""
    other = d * [-1, -1, 1, -1, *[1] * 8]
    return np.concatenate([other[:4], d[RIGHT_ARM], d[LEFT_ARM]])


def test_the_rest_posture_by_hand() -> None:
    frames = forward_kinematics(BODY, posture())
    np.testing.assert_allclose(frames.torso_rotation, np.eye(3), **NEAR)
    np.testing.assert_allclose(frames.hip, (-2, 0, -0.5), **NEAR)
    np.testing.assert_allclose(frames.neck, (-2, 0, 0.03), **NEAR)
    # 6 cm of neck and half of 24 cm above it, 4 cm forward.
    np.testing.assert_allclose(frames.head, (-1.96, 0, 0.21), **NEAR)
    for side, arm in ((1, frames.left), (-1, frames.right)):
        np.testing.assert_allclose(arm.shoulder, (-2, side * 0.18, -0.02), **NEAR)
        np.testing.assert_allclose(arm.elbow, (-2, side * 0.18, -0.29), **NEAR)
        np.testing.assert_allclose(arm.hand, (-2, side * 0.18, -0.65), **NEAR)


def test_the_constants_place_the_hips() -> None:
    body = BodyModel.of(distance_m=3.0, hip_height_m=0.25, lateral_m=0.7, camera_pitch_rad=0.3)
    # lateral_m is where tracking starts, not an offset of torso_y; the frame is level.
    np.testing.assert_allclose(
        forward_kinematics(body, posture(torso_y=0.4)).hip, (-3, 0.4, 0.25), **NEAR
    )


@pytest.mark.parametrize(("side", "sign"), [("left", 1), ("right", -1)])
def test_abduction_raises_either_arm_outwards(side: str, sign: int) -> None:
    arm = getattr(forward_kinematics(BODY, posture(**{f"{side}_shoulder_abduction": 90})), side)
    np.testing.assert_allclose(arm.elbow, (-2, sign * (0.18 + 0.27), -0.02), **NEAR)
    np.testing.assert_allclose(arm.hand, (-2, sign * (0.18 + 0.63), -0.02), **NEAR)


@pytest.mark.parametrize(("side", "sign"), [("left", 1), ("right", -1)])
def test_flexion_points_towards_the_camera(side: str, sign: int) -> None:
    arm = getattr(forward_kinematics(BODY, posture(**{f"{side}_shoulder_flexion": 90})), side)
    np.testing.assert_allclose(arm.elbow, (-2 + 0.27, sign * 0.18, -0.02), **NEAR)
    np.testing.assert_allclose(arm.hand, (-2 + 0.63, sign * 0.18, -0.02), **NEAR)


@pytest.mark.parametrize(("side", "sign"), [("left", 1), ("right", -1)])
def test_the_elbow_alone_moves_only_the_forearm(side: str, sign: int) -> None:
    flexed = getattr(forward_kinematics(BODY, posture(**{f"{side}_elbow_flexion": 90})), side)
    np.testing.assert_allclose(flexed.elbow, (-2, sign * 0.18, -0.29), **NEAR)
    np.testing.assert_allclose(flexed.hand, (-1.64, sign * 0.18, -0.29), **NEAR)
    out = getattr(forward_kinematics(BODY, posture(**{f"{side}_elbow_abduction": 90})), side)
    np.testing.assert_allclose(out.hand, (-2, sign * 0.54, -0.29), **NEAR)


def test_abduction_comes_before_flexion() -> None:
    # Flexion is about the turned Y axis: an arm raised sideways swings about its own line's normal.
    d = posture(left_shoulder_abduction=90, left_shoulder_flexion=90)
    hand = forward_kinematics(BODY, d).left.hand
    np.testing.assert_allclose(hand, (-2 + 0.63, 0.18, -0.02), **NEAR)
    d = posture(left_shoulder_abduction=90, left_elbow_abduction=90)
    np.testing.assert_allclose(
        forward_kinematics(BODY, d).left.hand, (-2, 0.18 + 0.27, -0.02 + 0.36), **NEAR
    )


def test_a_left_turn_makes_the_chest_face_the_right_of_the_image() -> None:
    frames = forward_kinematics(BODY, posture(torso_yaw=90))
    np.testing.assert_allclose(frames.torso_rotation @ (1, 0, 0), (0, 1, 0), **NEAR)
    # The right shoulder is then the near one.
    np.testing.assert_allclose(frames.right.shoulder, (-1.82, 0, -0.02), **NEAR)
    np.testing.assert_allclose(frames.left.shoulder, (-2.18, 0, -0.02), **NEAR)
    np.testing.assert_allclose(frames.head, (-2, 0.04, 0.21), **NEAR)


def test_a_positive_pitch_leans_forward() -> None:
    frames = forward_kinematics(BODY, posture(torso_pitch=90))
    np.testing.assert_allclose(frames.neck, (-2 + 0.53, 0, -0.5), **NEAR)
    np.testing.assert_allclose(frames.hip, (-2, 0, -0.5), **NEAR)


def test_a_positive_roll_leans_to_the_persons_right() -> None:
    # About +X, which points out of the chest: Z turns towards -Y.
    frames = forward_kinematics(BODY, posture(torso_roll=30))
    np.testing.assert_allclose(frames.neck, (-2, -0.265, -0.5 + 0.53 * np.sqrt(0.75)), **NEAR)


def test_yaw_then_pitch_bows_where_the_chest_faces() -> None:
    frames = forward_kinematics(BODY, posture(torso_yaw=90, torso_pitch=90))
    np.testing.assert_allclose(frames.neck, (-2, 0.53, -0.5), **NEAR)
    frames = forward_kinematics(BODY, posture(torso_pitch=90, torso_roll=90))
    # Roll acts first, in the torso's own frame, so the torso lies sideways whatever the pitch.
    np.testing.assert_allclose(frames.neck, (-2, -0.53, -0.5), **NEAR)


@pytest.mark.parametrize(
    ("rotation", "start", "end"),
    [
        (rotation_x, (0, 1, 0), (0, 0, 1)),
        (rotation_y, (0, 0, 1), (1, 0, 0)),
        (rotation_z, (1, 0, 0), (0, 1, 0)),
    ],
)
def test_rotations_are_right_handed(rotation, start, end) -> None:  # type: ignore[no-untyped-def]
    np.testing.assert_allclose(rotation(np.pi / 2) @ start, end, **NEAR)
    assert rotation(np.zeros((2, 5))).shape == (2, 5, 3, 3)


def test_keypoints_are_those_of_the_frames_in_the_order_of_their_names() -> None:
    d = posture(torso_yaw=20, left_shoulder_flexion=40, right_elbow_flexion=30)
    frames = forward_kinematics(BODY, d)
    points = keypoints_m(BODY, d)
    assert points.shape == (6, 3)
    for name, point in zip(KEYPOINT_NAMES, points, strict=True):
        side, joint = name.split("_")
        np.testing.assert_array_equal(point, getattr(getattr(frames, side), joint))


@given(ANY_POSTURE)
def test_no_posture_changes_a_length(d: np.ndarray) -> None:
    frames = forward_kinematics(BODY, d)
    for arm in (frames.left, frames.right):
        assert np.linalg.norm(arm.elbow - arm.shoulder) == pytest.approx(0.27, abs=1e-12)
        assert np.linalg.norm(arm.hand - arm.elbow) == pytest.approx(0.36, abs=1e-12)
        shoulder = np.linalg.norm(arm.shoulder - frames.neck)
        assert shoulder == pytest.approx(np.hypot(0.18, 0.05), abs=1e-12)
    assert np.linalg.norm(frames.neck - frames.hip) == pytest.approx(0.53, abs=1e-12)
    assert np.linalg.norm(frames.head - frames.hip) == pytest.approx(np.hypot(0.04, 0.71))


@given(ANY_POSTURE)
def test_every_rotation_is_one(d: np.ndarray) -> None:
    frames = forward_kinematics(BODY, d)
    for rotation in (
        frames.torso_rotation,
        frames.left.upper_arm_rotation,
        frames.left.forearm_rotation,
        frames.right.upper_arm_rotation,
        frames.right.forearm_rotation,
    ):
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1.0)


@given(ANY_POSTURE)
def test_a_mirrored_posture_gives_a_mirrored_person(d: np.ndarray) -> None:
    frames, mirror = forward_kinematics(BODY, d), forward_kinematics(BODY, mirrored(d))
    flip = np.array([1, -1, 1])
    np.testing.assert_allclose(mirror.head, frames.head * flip, atol=1e-12)
    for got, expected in ((mirror.left, frames.right), (mirror.right, frames.left)):
        for point, other in zip(got[:3], expected[:3], strict=True):
            np.testing.assert_allclose(point, other * flip, atol=1e-12)


@given(arrays(np.float64, (2, 3, N_JOINTS), elements=st.floats(-3.1, 3.1)))
def test_many_postures_at_once_are_each_alone(postures: np.ndarray) -> None:
    together = keypoints_m(BODY, postures)
    assert together.shape == (2, 3, 6, 3)
    for index in np.ndindex(2, 3):
        np.testing.assert_allclose(together[index], keypoints_m(BODY, postures[index]), atol=1e-12)


@given(ANY_POSTURE, st.floats(-2, 2))
def test_torso_y_moves_the_whole_person_aside(d: np.ndarray, shift_m: float) -> None:
    moved = d.copy()
    moved[0] += shift_m
    np.testing.assert_allclose(
        keypoints_m(BODY, moved) - keypoints_m(BODY, d),
        np.broadcast_to((0, shift_m, 0), (6, 3)),
        atol=1e-12,
    )
