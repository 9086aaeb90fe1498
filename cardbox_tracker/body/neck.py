"""The two angles of the neck: names, limits, and the joint about which the head turns and nods.

They belong to no state: the tracker computes them for each image in which it knows points of the
face. Both are relative to the torso and have the signs of its angles,

    R_head = R_torso Rz(neck_yaw) Ry(neck_pitch),

so a positive yaw turns the face to the person's left, and a positive pitch lowers it.

The range of the yaw, and 45 of the 60 degrees of the pitch, are those of the neck in the source of
:mod:`.posture`; the upper back, which is a part of the torso here, bends with the neck.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.body.kinematics import BodyFrames, rotation_y, rotation_z
from cardbox_tracker.body.parts import BodyParts
from cardbox_tracker.body.sizes import FloatArray

NECK_NAMES: tuple[str, ...] = ("neck_yaw", "neck_pitch")
NECK_LIMITS: FloatArray = np.radians([(-80.0, 80.0), (-60.0, 60.0)])
"""Shape (2, 2): lowest and highest value of each of ``NECK_NAMES``, rad."""
NECK_LIMITS.setflags(write=False)


def neck_rotation(angles_rad: FloatArray) -> FloatArray:
    """Return the rotations (..., 3, 3) from head to torso at angles (..., 2)."""
    angles = np.asarray(angles_rad, dtype=np.float64)
    return rotation_z(angles[..., 0]) @ rotation_y(angles[..., 1])


def neck_pivot_m(parts: BodyParts[float]) -> tuple[float, float, float]:
    """Return the joint of the head, the middle of the neck, in the torso's frame, metres."""
    return parts.neck.forward_m, 0.0, parts.neck.middle_m


def head_from_pivot_m(parts: BodyParts[float]) -> tuple[float, float, float]:
    """Return the middle of the head, metres, in the head's axes from :func:`neck_pivot_m`."""
    x, _, z = neck_pivot_m(parts)
    return parts.head.forward_m - x, 0.0, parts.head.middle_m - z


def gaze_m(parts: BodyParts[float], frames: BodyFrames, angles_rad: FloatArray) -> FloatArray:
    """Return a line from the middle of the head along the direction of the face.

    Args:
        parts: parts of the body.
        frames: its frames in one posture.
        angles_rad: ``neck_yaw`` and ``neck_pitch``, (2,).

    Returns:
        Both ends, (2, 3), metres in the reference frame; the line is as long as the head is high.
    """
    rotation = neck_rotation(angles_rad)
    middle = np.array(neck_pivot_m(parts)) + rotation @ head_from_pivot_m(parts)
    ends = np.array([middle, middle + parts.head.height_m * rotation[:, 0]])
    placed: FloatArray = frames.hip + ends @ frames.torso_rotation.T
    return placed
