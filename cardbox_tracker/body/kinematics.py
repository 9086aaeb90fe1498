"""Forward kinematics of the upper body (paper, section II-A; frames as in ``docs/conventions.md``).

The torso turns about the middle of the hips with Rz(yaw) Ry(pitch) Rx(roll). A limb hangs along -Z
of its frame; a positive abduction (about X) raises either arm outwards, a positive flexion (about Y
of the turned frame) forwards:

    R_upper_arm = R_torso Rx(+-abduction) Ry(-flexion),   R_forearm = R_upper_arm Rx(..) Ry(..)

with + for the left arm and - for the right.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.parts import BodyParts, body_parts
from cardbox_tracker.body.posture import LEFT_ARM, PITCH, RIGHT_ARM, ROLL, TORSO_Y, YAW
from cardbox_tracker.body.sizes import FloatArray

KEYPOINT_NAMES: tuple[str, ...] = (
    "left_shoulder",
    "left_elbow",
    "left_hand",
    "right_shoulder",
    "right_elbow",
    "right_hand",
)


class Arm(NamedTuple):
    """One arm in the reference frame: joints (..., 3) in metres and rotations (..., 3, 3)."""

    shoulder: FloatArray
    elbow: FloatArray
    hand: FloatArray
    upper_arm_rotation: FloatArray
    forearm_rotation: FloatArray


class BodyFrames(NamedTuple):
    """Frames of all parts in the reference frame.

    ``hip`` (mid-hip), ``neck`` (middle of the torso's top) and ``head`` (its centre) have shape
    (..., 3), metres; ``torso_rotation`` has shape (..., 3, 3).
    """

    torso_rotation: FloatArray
    hip: FloatArray
    neck: FloatArray
    head: FloatArray
    left: Arm
    right: Arm


def rotation_x(angle_rad: FloatArray) -> FloatArray:
    """Return rotation matrices (..., 3, 3) about X by ``angle_rad`` (...)."""
    return _rotation(angle_rad, 1, 2)


def rotation_y(angle_rad: FloatArray) -> FloatArray:
    """Return rotation matrices (..., 3, 3) about Y by ``angle_rad`` (...)."""
    return _rotation(angle_rad, 2, 0)


def rotation_z(angle_rad: FloatArray) -> FloatArray:
    """Return rotation matrices (..., 3, 3) about Z by ``angle_rad`` (...)."""
    return _rotation(angle_rad, 0, 1)


def _rotation(angle_rad: FloatArray, i: int, j: int) -> FloatArray:
    """Return the rotation in the plane of axes ``i`` and ``j`` that turns ``i`` towards ``j``."""
    angle = np.asarray(angle_rad, dtype=np.float64)
    matrix = np.zeros((*angle.shape, 3, 3))
    matrix[..., 3 - i - j, 3 - i - j] = 1.0
    matrix[..., i, i] = matrix[..., j, j] = np.cos(angle)
    matrix[..., j, i] = np.sin(angle)
    matrix[..., i, j] = -matrix[..., j, i]
    return matrix


def forward_kinematics(body: BodyModel, postures: FloatArray) -> BodyFrames:
    """Return the frames of the parts of ``body`` in each posture.

    Args:
        body: the measured person.
        postures: shape (..., 12), rad and metres.

    Returns:
        Frames in the reference frame, with the leading shape of ``postures``.
    """
    d = np.asarray(postures, dtype=np.float64)
    rotation = rotation_z(d[..., YAW]) @ rotation_y(d[..., PITCH]) @ rotation_x(d[..., ROLL])
    hip = np.empty((*d.shape[:-1], 3))
    hip[..., 0] = -body.placement.distance_m
    hip[..., 1] = d[..., TORSO_Y]
    hip[..., 2] = body.placement.hip_height_m

    parts = body_parts(body.sizes)
    return BodyFrames(
        rotation,
        hip,
        hip + rotation @ (0.0, 0.0, parts.torso.top_m),
        hip + rotation @ (parts.head.forward_m, 0.0, parts.head.middle_m),
        _arm(parts, rotation, hip, d[..., LEFT_ARM], +1.0),
        _arm(parts, rotation, hip, d[..., RIGHT_ARM], -1.0),
    )


def _arm(
    parts: BodyParts[float], torso: FloatArray, hip: FloatArray, angles: FloatArray, side: float
) -> Arm:
    """Return the frames of an arm; ``side`` is +1 for the left arm, -1 for the right."""
    upper_arm = torso @ rotation_x(side * angles[..., 0]) @ rotation_y(-angles[..., 1])
    forearm = upper_arm @ rotation_x(side * angles[..., 2]) @ rotation_y(-angles[..., 3])
    shoulder = hip + torso @ (0.0, side * parts.shoulder_aside_m, parts.shoulder_height_m)
    elbow = shoulder - parts.upper_arm.height_m * upper_arm[..., 2]
    hand = elbow - parts.forearm.height_m * forearm[..., 2]
    return Arm(shoulder, elbow, hand, upper_arm, forearm)


def with_shoulders(frames: BodyFrames, shoulders_m: FloatArray) -> BodyFrames:
    """Return ``frames`` with both arms translated to the given shoulders.

    The whole-body filter lifts the shoulder of a raised arm; :func:`forward_kinematics` does not,
    as in the paper.

    Args:
        frames: frames of one or many postures.
        shoulders_m: left and right shoulder, (..., 2, 3), metres in the reference frame.
    """
    arms = [
        arm._replace(shoulder=place, elbow=arm.elbow + moved, hand=arm.hand + moved)
        for arm, place in zip(
            (frames.left, frames.right), np.moveaxis(shoulders_m, -2, 0), strict=True
        )
        for moved in [place - arm.shoulder]
    ]
    return frames._replace(left=arms[0], right=arms[1])


def arm_directions(angles_rad: FloatArray, side: float) -> tuple[FloatArray, FloatArray]:
    """Return unit vectors (..., 3) along upper arm and forearm in the torso's frame.

    Args:
        angles_rad: the four angles of an arm, (..., 4).
        side: +1 for the left arm, -1 for the right.
    """
    a = np.asarray(angles_rad, dtype=np.float64)
    upper_arm = rotation_x(side * a[..., 0]) @ rotation_y(-a[..., 1])
    forearm = upper_arm @ rotation_x(side * a[..., 2]) @ rotation_y(-a[..., 3])
    return -upper_arm[..., 2], -forearm[..., 2]


def keypoints_m(body: BodyModel, postures: FloatArray) -> FloatArray:
    """Return shoulder, elbow and hand of the left, then the right arm.

    Args:
        body: the measured person.
        postures: shape (..., 12), rad and metres.

    Returns:
        Shape (..., 6, 3), metres in the reference frame, ordered as ``KEYPOINT_NAMES``.
    """
    frames = forward_kinematics(body, postures)
    return np.stack([*frames.left[:3], *frames.right[:3]], axis=-2)
