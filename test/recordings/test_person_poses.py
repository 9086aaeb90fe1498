"""Poses that robots follow are where the hips, the trunk and the arms are."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.camera.camera import level_to_optical
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.skeleton import JOINT_NAMES, KeypointState
from cardbox_tracker.recordings.messages import pose_message
from cardbox_tracker.recordings.person_poses import POSES, Pose, person_poses
from cardbox_tracker.tracking.estimate import LOST, TRACKING, Estimate

PITCH = 0.3
BODY = BodyModel.of(distance_m=2.0, hip_height_m=-0.4, camera_pitch_rad=PITCH)
TO_OPTICAL = level_to_optical(PITCH)


def seen(**angles: float) -> Estimate:
    posture = np.zeros(12)
    for name, value in angles.items():
        posture[JOINT_NAMES.index(name)] = value
    points = pose(BODY.rigid, posture).keypoints_m @ TO_OPTICAL.T
    return Estimate(TRACKING, posture, np.full(12, 0.1), points, offset_m=np.zeros(2))


def test_the_person_faces_their_yaw() -> None:
    """Who is nearer by 0.5 m, and turned to the left by a quarter, looks along Y."""
    estimate = replace(seen(torso_yaw=np.pi / 2), offset_m=np.array([0.5, 0.1]))
    found = dict(person_poses(estimate, BODY))["person_pose"]
    assert TO_OPTICAL.T @ found.place_m == pytest.approx([-1.5, 0.0, -0.3])
    assert TO_OPTICAL.T @ found.turn == pytest.approx(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]))


def test_an_arm_points_from_its_shoulder() -> None:
    found = dict(person_poses(seen(right_shoulder_flexion=np.pi / 2), BODY))
    # A hanging arm points down, where no level direction is known.
    assert list(found) == ["person_pose", "right_pointing"]
    ray = found["right_pointing"]
    assert TO_OPTICAL.T @ ray.turn == pytest.approx(np.eye(3), abs=1e-9)
    estimate = seen(right_shoulder_flexion=np.pi / 2)
    assert estimate.keypoints_m is not None
    assert ray.place_m == pytest.approx(estimate.keypoints_m[3])
    states = [KeypointState.TRACKED] * 6
    states[5] = KeypointState.UNCERTAIN
    assert list(dict(person_poses(replace(estimate, keypoint_states=tuple(states)), BODY))) == [
        "person_pose"
    ]
    assert not dict(person_poses(Estimate(LOST), BODY))
    assert set(found) <= set(POSES)


def test_a_pose_is_a_message_with_its_quaternion() -> None:
    def new(kind: str, **fields: Any) -> Any:
        return SimpleNamespace(kind=kind, **fields)

    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    made = pose_message(new, "header", Pose(np.array([1.0, 2.0, 3.0]), turn))
    assert made.kind == "geometry_msgs/msg/PoseStamped" and made.header == "header"
    at, of = made.pose.position, made.pose.orientation
    assert (at.x, at.y, at.z) == (1.0, 2.0, 3.0)
    half = np.sqrt(0.5)
    assert (of.x, of.y, of.z, of.w) == pytest.approx((0.0, 0.0, half, half))
