"""Kinematics against values by hand, and what holds in every posture.

By hand, for the default body at 2 m, hips 0.5 m below the camera: the torso's top is at
-0.5 + 0.17 + 0.36 = 0.03 m, the shoulders at 0.03 - 0.05 = -0.02 m, 0.18 m to either side; a
hanging arm reaches 0.27 + 0.36 = 0.63 m down.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.kinematics import clavicles, gaze_m, jacobian, pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.posture import LEFT_ARM, N_JOINTS, N_STATE, RIGHT_ARM, state_limits
from cardbox_tracker.person.skeleton import (
    JOINT_NAMES,
    KEYPOINT_NAMES,
    SHOULDER_RISE,
    head_from_pivot_m,
    neck_pivot_m,
    neck_rotation,
    rotation_x,
    rotation_y,
    rotation_z,
)

BODY = BodyModel().rigid
ANY_POSTURE = arrays(np.float64, N_JOINTS, elements=st.floats(-3.1, 3.1))
NEAR = {"atol": 1e-12}
RISING = BodyModel()
ANY_STATE = arrays(np.float64, N_STATE, elements=st.floats(0.0, 1.0))


def within(share: np.ndarray) -> np.ndarray:
    """A state within the limits."""
    low, high = state_limits(RISING.placement.distance_m).T
    return low + share * (high - low)


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
    frames = pose(BODY, posture())
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
    np.testing.assert_allclose(pose(body, posture(torso_y=0.4)).hip, (-3, 0.4, 0.25), **NEAR)


@pytest.mark.parametrize(("side", "sign"), [("left", 1), ("right", -1)])
def test_abduction_raises_either_arm_outwards(side: str, sign: int) -> None:
    arm = getattr(pose(BODY, posture(**{f"{side}_shoulder_abduction": 90})), side)
    np.testing.assert_allclose(arm.elbow, (-2, sign * (0.18 + 0.27), -0.02), **NEAR)
    np.testing.assert_allclose(arm.hand, (-2, sign * (0.18 + 0.63), -0.02), **NEAR)


@pytest.mark.parametrize(("side", "sign"), [("left", 1), ("right", -1)])
def test_flexion_points_towards_the_camera(side: str, sign: int) -> None:
    arm = getattr(pose(BODY, posture(**{f"{side}_shoulder_flexion": 90})), side)
    np.testing.assert_allclose(arm.elbow, (-2 + 0.27, sign * 0.18, -0.02), **NEAR)
    np.testing.assert_allclose(arm.hand, (-2 + 0.63, sign * 0.18, -0.02), **NEAR)


@pytest.mark.parametrize(("side", "sign"), [("left", 1), ("right", -1)])
def test_the_elbow_alone_moves_only_the_forearm(side: str, sign: int) -> None:
    flexed = getattr(pose(BODY, posture(**{f"{side}_elbow_flexion": 90})), side)
    np.testing.assert_allclose(flexed.elbow, (-2, sign * 0.18, -0.29), **NEAR)
    np.testing.assert_allclose(flexed.hand, (-1.64, sign * 0.18, -0.29), **NEAR)
    out = getattr(pose(BODY, posture(**{f"{side}_elbow_abduction": 90})), side)
    np.testing.assert_allclose(out.hand, (-2, sign * 0.54, -0.29), **NEAR)


def test_abduction_comes_before_flexion() -> None:
    # Flexion is about the turned Y axis: an arm raised sideways swings about its own line's normal.
    d = posture(left_shoulder_abduction=90, left_shoulder_flexion=90)
    hand = pose(BODY, d).left.hand
    np.testing.assert_allclose(hand, (-2 + 0.63, 0.18, -0.02), **NEAR)
    d = posture(left_shoulder_abduction=90, left_elbow_abduction=90)
    np.testing.assert_allclose(pose(BODY, d).left.hand, (-2, 0.18 + 0.27, -0.02 + 0.36), **NEAR)


def test_a_left_turn_makes_the_chest_face_the_right_of_the_image() -> None:
    frames = pose(BODY, posture(torso_yaw=90))
    np.testing.assert_allclose(frames.torso_rotation @ (1, 0, 0), (0, 1, 0), **NEAR)
    # The right shoulder is then the near one.
    np.testing.assert_allclose(frames.right.shoulder, (-1.82, 0, -0.02), **NEAR)
    np.testing.assert_allclose(frames.left.shoulder, (-2.18, 0, -0.02), **NEAR)
    np.testing.assert_allclose(frames.head, (-2, 0.04, 0.21), **NEAR)


def test_a_positive_pitch_leans_forward() -> None:
    frames = pose(BODY, posture(torso_pitch=90))
    np.testing.assert_allclose(frames.neck, (-2 + 0.53, 0, -0.5), **NEAR)
    np.testing.assert_allclose(frames.hip, (-2, 0, -0.5), **NEAR)


def test_a_positive_roll_leans_to_the_persons_right() -> None:
    # About +X, which points out of the chest: Z turns towards -Y.
    frames = pose(BODY, posture(torso_roll=30))
    np.testing.assert_allclose(frames.neck, (-2, -0.265, -0.5 + 0.53 * np.sqrt(0.75)), **NEAR)


def test_yaw_then_pitch_bows_where_the_chest_faces() -> None:
    frames = pose(BODY, posture(torso_yaw=90, torso_pitch=90))
    np.testing.assert_allclose(frames.neck, (-2, 0.53, -0.5), **NEAR)
    frames = pose(BODY, posture(torso_pitch=90, torso_roll=90))
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
    frames = pose(BODY, d)
    points = frames.keypoints_m
    assert points.shape == (6, 3)
    for name, point in zip(KEYPOINT_NAMES, points, strict=True):
        side, joint = name.split("_")
        np.testing.assert_array_equal(point, getattr(getattr(frames, side), joint))


@given(ANY_POSTURE)
def test_no_posture_changes_a_length(d: np.ndarray) -> None:
    frames = pose(BODY, d)
    for arm in (frames.left, frames.right):
        assert np.linalg.norm(arm.elbow - arm.shoulder) == pytest.approx(0.27, abs=1e-12)
        assert np.linalg.norm(arm.hand - arm.elbow) == pytest.approx(0.36, abs=1e-12)
        shoulder = np.linalg.norm(arm.shoulder - frames.neck)
        assert shoulder == pytest.approx(np.hypot(0.18, 0.05), abs=1e-12)
    assert np.linalg.norm(frames.neck - frames.hip) == pytest.approx(0.53, abs=1e-12)
    assert np.linalg.norm(frames.head - frames.hip) == pytest.approx(np.hypot(0.04, 0.71))


@given(ANY_POSTURE)
def test_every_rotation_is_one(d: np.ndarray) -> None:
    frames = pose(BODY, d)
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
    frames, mirror = pose(BODY, d), pose(BODY, mirrored(d))
    flip = np.array([1, -1, 1])
    np.testing.assert_allclose(mirror.head, frames.head * flip, atol=1e-12)
    for got, expected in ((mirror.left, frames.right), (mirror.right, frames.left)):
        for point, other in zip(got[:3], expected[:3], strict=True):
            np.testing.assert_allclose(point, other * flip, atol=1e-12)


@given(arrays(np.float64, (2, 3, N_JOINTS), elements=st.floats(-3.1, 3.1)))
def test_many_postures_at_once_are_each_alone(postures: np.ndarray) -> None:
    together = pose(BODY, postures).keypoints_m
    assert together.shape == (2, 3, 6, 3)
    for index in np.ndindex(2, 3):
        np.testing.assert_allclose(
            together[index], pose(BODY, postures[index]).keypoints_m, atol=1e-12
        )


@given(ANY_POSTURE, st.floats(-2, 2))
def test_torso_y_moves_the_whole_person_aside(d: np.ndarray, shift_m: float) -> None:
    moved = d.copy()
    moved[0] += shift_m
    np.testing.assert_allclose(
        pose(BODY, moved).keypoints_m - pose(BODY, d).keypoints_m,
        np.broadcast_to((0, shift_m, 0), (6, 3)),
        atol=1e-12,
    )


def test_the_place_moves_the_whole_person_nearer_and_up() -> None:
    state = np.zeros(N_STATE)
    state[12:] = (0.5, 0.1)
    moved = pose(BODY, state).points_m - pose(BODY, posture()).points_m
    np.testing.assert_allclose(moved, np.broadcast_to((0.5, 0.0, 0.1), (9, 3)), **NEAR)


@given(ANY_STATE, st.floats(-1.2, 1.2))
def test_the_optical_frame_is_that_of_a_camera(share: np.ndarray, pitch_rad: float) -> None:
    state = within(share)
    camera = Camera(320, 240, 300.0, 300.0, 159.5, 119.5, pitch_rad)
    level, optical = pose(RISING, state), pose(RISING, state, pitch_rad)
    np.testing.assert_allclose(
        optical.points_m, camera.reference_to_optical(level.points_m), atol=1e-12
    )
    turned = camera.reference_to_optical_rotation() @ level.rotations
    np.testing.assert_allclose(optical.rotations, turned, atol=1e-12)


@pytest.mark.parametrize(
    ("degrees", "rise_deg"), [(0, 0), (29, 0), (30, 0), (90, 60), (149, 119), (180, 150)]
)
@pytest.mark.parametrize("side", ["left", "right"])
def test_a_shoulder_rises_with_its_arm_by_hand(side: str, degrees: int, rise_deg: int) -> None:
    """0.077 of 0.36 m for each radian beyond 30 degrees, 0.2 rad inwards from straight up."""
    raised = pose(RISING, posture(**{f"{side}_shoulder_abduction": degrees}))
    rise_m = 0.077 * 0.36 * np.radians(rise_deg)
    sign = 1 if side == "left" else -1
    expected = (-2, sign * (0.18 - np.sin(0.2) * rise_m), -0.02 + np.cos(0.2) * rise_m)
    arm, other = getattr(raised, side), getattr(raised, {"left": "right", "right": "left"}[side])
    np.testing.assert_allclose(arm.shoulder, expected, **NEAR)
    np.testing.assert_allclose(other.shoulder, (-2, -sign * 0.18, -0.02), **NEAR)
    assert raised.clavicles_m[["left", "right"].index(side)] == pytest.approx(rise_m)
    assert raised.clavicles_m.sum() == pytest.approx(rise_m)


@given(ANY_STATE)
def test_a_risen_shoulder_moves_its_arm_and_turns_nothing(share: np.ndarray) -> None:
    state = within(share)
    rigid, rising = pose(BODY, state), pose(RISING, state)
    np.testing.assert_array_equal(rising.rotations, rigid.rotations)
    np.testing.assert_array_equal(rising.points_m[:3], rigid.points_m[:3])
    moved = (rising.points_m - rigid.points_m)[3:].reshape(2, 3, 3)
    np.testing.assert_allclose(moved, moved[:, :1].repeat(3, axis=1), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(moved[:, 0], axis=1), rising.clavicles_m, atol=1e-12)
    given_m = pose(BODY, state, clavicles_m=rising.clavicles_m)
    np.testing.assert_array_equal(given_m.points_m, rising.points_m)


def test_the_rise_is_near_a_clavicle_that_turns_about_its_inner_end() -> None:
    """It turns by 0.18 rad for each radian beyond 30 degrees, and is 0.43 breadths long."""
    elevations = np.radians(np.arange(0, 181, 5))
    postures = np.zeros((len(elevations), N_JOINTS))
    postures[:, LEFT_ARM.start] = elevations
    found = pose(RISING, postures).left.shoulder - pose(BODY, postures).left.shoulder
    turned, clavicle_m = 0.18 * np.maximum(elevations - np.radians(30), 0), 0.43 * 0.36
    circle = np.stack([0 * turned, np.cos(turned) - 1, np.sin(turned)], axis=1) * clavicle_m
    assert np.linalg.norm(found - circle, axis=1).max() < 0.0033
    assert pytest.approx(0.18 * 0.43, abs=5e-4) == SHOULDER_RISE


@given(ANY_STATE, st.sampled_from([None, 0.0, -0.3, 0.7]))
def test_the_jacobian_is_that_of_finite_differences(
    share: np.ndarray, pitch_rad: float | None
) -> None:
    state, step = within(share), 1e-6
    # A shoulder begins to rise at a corner, and at its highest its direction is undefined.
    for first in (4, 8):
        a, f = state[first : first + 2]
        elevation = np.arccos(np.clip(np.cos(a) * np.cos(f), -1, 1))
        assume(abs(elevation - np.radians(30)) > 1e-3 and elevation < np.pi - 0.01)
        assume(elevation > 1e-3)
    found = jacobian(RISING, state, pitch_rad)
    assert found.shape == (9, 3, 14)
    steps = step * np.eye(N_STATE)
    above, below = (pose(RISING, state + sign * steps, pitch_rad).points_m for sign in (1, -1))
    expected = np.moveaxis((above - below) / (2 * step), 0, -1)
    np.testing.assert_allclose(found, expected, atol=2e-6)


def test_jacobians_of_many_states_are_each_alone() -> None:
    states = np.random.default_rng(0).uniform(-1, 1, (2, 3, N_STATE))
    together = jacobian(RISING, states)
    assert together.shape == (2, 3, 9, 3, 14)
    np.testing.assert_array_equal(together[1, 2], jacobian(RISING, states[1, 2]))


def test_the_deviation_of_a_clavicle_follows_from_that_of_its_arm() -> None:
    d = posture(left_shoulder_abduction=90, right_shoulder_abduction=20)
    stddev = np.zeros(N_JOINTS)
    stddev[[4, 8]] = 0.1
    rise_m, deviation_m = clavicles(RISING, d, stddev)
    np.testing.assert_array_equal(rise_m, pose(RISING, d).clavicles_m)
    np.testing.assert_allclose(deviation_m, (0.1 * 0.077 * 0.36, 0.0), atol=1e-12)
    assert not np.any(clavicles(BODY, d, stddev))


PARTS = body_parts(BODY.sizes)


@pytest.mark.parametrize("turn_rad", [0.0, 0.5])
def test_the_gaze_starts_in_the_head_and_turns_with_the_torso(turn_rad: float) -> None:
    posed = pose(BODY, posture(torso_yaw=float(np.degrees(turn_rad))))
    start, end = gaze_m(PARTS, posed, np.zeros(2))
    np.testing.assert_allclose(start, posed.head, atol=1e-12)
    direction = (np.cos(turn_rad), np.sin(turn_rad), 0.0)
    np.testing.assert_allclose((end - start) / PARTS.head.height_m, direction, atol=1e-12)


def test_yaw_turns_left_and_pitch_lowers_the_face() -> None:
    left, down = neck_rotation(np.array([np.pi / 2, 0.0])), neck_rotation(np.array([0.0, 0.4]))
    np.testing.assert_allclose(left[:, 0], (0.0, 1.0, 0.0), atol=1e-12)
    np.testing.assert_allclose(down[:, 0], (np.cos(0.4), 0.0, -np.sin(0.4)), atol=1e-12)


def test_the_head_of_a_neck_at_rest_is_the_models() -> None:
    middle = np.add(neck_pivot_m(PARTS), head_from_pivot_m(PARTS))
    np.testing.assert_allclose(middle, (PARTS.head.forward_m, 0.0, PARTS.head.middle_m))
