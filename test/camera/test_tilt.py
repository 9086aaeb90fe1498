"""Another pitch of the camera moves nobody in its images."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.tilt import tilted_body, tilted_states
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel, CameraPose
from cardbox_tracker.person.posture import N_JOINTS, N_STATE, PITCH, TORSO_X, TORSO_Z, YAW

CAMERA = Camera(320, 240, 260.0, 260.0, 159.5, 119.5)


def keypoints_m(body: BodyModel, state: np.ndarray) -> np.ndarray:
    there = body.with_values(
        distance_m=body.placement.distance_m - state[TORSO_X],
        hip_height_m=body.placement.hip_height_m + state[TORSO_Z],
    )
    return pose(there, state[:N_JOINTS], body.camera_pose.pitch_rad).keypoints_m


@given(
    *(st.floats(-0.6, 0.6) for _ in range(2)),
    st.lists(st.floats(-0.7, 0.7), min_size=N_STATE, max_size=N_STATE),
    st.sampled_from([0.0, np.pi, -np.pi]),
)
def test_joints_keep_their_places(
    before_rad: float, after_rad: float, values: list[float], facing_rad: float
) -> None:
    body = BodyModel.of(distance_m=2.6, hip_height_m=-0.4, camera_pitch_rad=before_rad)
    state = np.array(values)
    state[YAW] += facing_rad
    other = tilted_body(body, CameraPose(after_rad))
    (found,) = tilted_states(state[None], body, other)
    assert other.camera_pose.pitch_rad == after_rad
    assert keypoints_m(other, found) == pytest.approx(keypoints_m(body, state), abs=1e-9)
    assert abs(found[YAW] - state[YAW]) < np.pi


def test_who_stands_on_the_axis_by_hand() -> None:
    """Hips 2 m ahead of a camera that was taken as level, and looks down by 30 degrees."""
    body = BodyModel.of(distance_m=2.0, hip_height_m=0.0)
    other = tilted_body(body, CameraPose(np.radians(30.0)))
    assert other.placement.distance_m == pytest.approx(np.sqrt(3.0))
    assert other.placement.hip_height_m == pytest.approx(-1.0)
    (found,) = tilted_states(np.zeros((1, N_STATE)), body, other)
    # The image's columns lean away from a camera that looks down.
    assert np.degrees(found[PITCH]) == pytest.approx(-30.0)
    assert np.delete(found, PITCH) == pytest.approx(0.0)


def test_a_trunk_beyond_the_horizontal_keeps_its_yaw() -> None:
    """It bows by 70 degrees before a camera that was taken to look down by 30, and is level."""
    body = BodyModel.of(distance_m=2.0, hip_height_m=0.0, camera_pitch_rad=np.radians(30.0))
    state = np.zeros(N_STATE)
    state[PITCH] = np.radians(70.0)
    (found,) = tilted_states(state[None], body, tilted_body(body, CameraPose(0.0)))
    assert np.degrees(found[PITCH]) == pytest.approx(100.0)
    assert np.delete(found, PITCH) == pytest.approx(0.0)
