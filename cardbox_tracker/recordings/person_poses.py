"""Where a person is and points, as poses that robots follow."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cardbox_tracker.camera.camera import level_to_optical
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import YAW
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES, KeypointState, rotation_z
from cardbox_tracker.tracking.estimate import Estimate

POSES = ("person_pose", "left_pointing", "right_pointing")
"""Topics of the poses."""


# Nearer to the vertical, rounding decides.
_VERTICAL_M = 1e-6


class Pose(NamedTuple):
    """A frame in the optical frame."""

    place_m: FloatArray  #: its origin, (3,)
    turn: FloatArray  #: its axes in columns, (3, 3), a rotation


def person_poses(estimate: Estimate, body: BodyModel) -> Iterator[tuple[str, Pose]]:
    """Yield the topics of ``POSES`` that are known, and their poses.

    The person is the middle of the hips with X ahead and Z up. A ray begins in a shoulder, and its
    X goes to the hand; it is not known while one of both is not ``tracked``, or its Y, which is
    level, has no direction.
    """
    if estimate.posture is None:
        return
    tilt, posture = body.camera_pose, estimate.posture
    to_optical = level_to_optical(tilt.pitch_rad, tilt.roll_rad)
    hip_m = pose(estimate.placed(body), posture).hip
    yield POSES[0], Pose(to_optical @ hip_m, to_optical @ rotation_z(posture[YAW]))
    points_m = estimate.as_camera_stands(tilt.roll_rad).keypoints_m
    if points_m is None:
        return
    for topic in POSES[1:]:
        side = topic.partition("_")[0]
        ends = [KEYPOINT_NAMES.index(f"{side}_{end}") for end in ("shoulder", "hand")]
        states = estimate.keypoint_states or (KeypointState.TRACKED,) * len(points_m)
        ahead = points_m[ends[1]] - points_m[ends[0]]
        aside = np.cross(to_optical[:, 2], ahead)
        level = np.linalg.norm(aside)
        if level > _VERTICAL_M and all(states[end] == KeypointState.TRACKED for end in ends):
            x, y = ahead / np.linalg.norm(ahead), aside / level
            yield topic, Pose(points_m[ends[0]], np.stack([x, y, np.cross(x, y)], axis=1))
