"""The legs: directions and places of their bones.

A thigh turns forwards, outwards, then inwards about its own axis; then the knee bends:

    R_thigh = R_hips Ry(-flexion) Rx(+-abduction) Rz(-+rotation),   R_shank = R_thigh Ry(bend)

with the upper sign for the left leg. The frame of the hips is that which ``torso_yaw`` moves, so it
stays level. All is zero for a leg that hangs.

The ranges are those of the American Academy of Orthopaedic Surgeons, see :mod:`.skeleton`: hip
flexion 120, extension 30, abduction 45, adduction 30, rotation 45; knee flexion 135. Soft tissue
gives way under the weight of a person who squats or sits low, so they have up to 20 degrees more.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.proportions import (
    ANKLE_SHARE,
    HIP_SHARE,
    SHANK_SHARE,
    THIGH_SHARE,
    stature_of,
)
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import rotation_x, rotation_y, rotation_z

LEG_KEYPOINT_NAMES: tuple[str, ...] = (
    *("left_hip", "left_knee", "left_ankle"),
    *("right_hip", "right_knee", "right_ankle"),
)


def floor_m(body: BodyModel) -> float | None:
    """Return the floor's height above the camera, m, by scene or measured person, or None."""
    if body.camera_pose.height_m is not None:
        return -body.camera_pose.height_m
    if "hip_height_m" in body.unknown:
        return None
    leg_m = (THIGH_SHARE + SHANK_SHARE + ANKLE_SHARE) * stature_of(body_parts(body.sizes))
    return body.placement.hip_height_m - leg_m


def legs_m(body: BodyModel, hips_m: FloatArray, yaw: FloatArray, angles: FloatArray) -> FloatArray:
    """Return hips, knees and ankles, ordered as ``LEG_KEYPOINT_NAMES``, (n, 6, 3), metres.

    The bones have the mean lengths of people of that stature. Like the result, the middle of the
    hips (n, 3) is in the reference frame; ``yaw`` (n,) is ``torso_yaw`` and ``angles`` (n, 8) are
    ``LEG_NAMES``, rad.
    """
    stature_m, turn = stature_of(body_parts(body.sizes)), rotation_z(yaw)
    points = []
    for number, side in enumerate((1.0, -1.0)):
        thigh, shank = leg_directions(angles[:, 4 * number : 4 * number + 4], side)
        aside = np.broadcast_to((0.0, side * HIP_SHARE, 0.0), thigh.shape)
        hip = hips_m + stature_m * np.einsum("nij,nj->ni", turn, aside)
        knee = hip + stature_m * np.einsum("nij,nj->ni", turn, THIGH_SHARE * thigh)
        ankle = knee + stature_m * np.einsum("nij,nj->ni", turn, SHANK_SHARE * shank)
        points += [hip, knee, ankle]
    return np.stack(points, axis=1)


def leg_directions(
    angles_rad: FloatArray, side: float | FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return unit vectors (..., 3) along thigh and shank in the frame of the hips.

    The four angles of a leg are (..., 4), rad; ``side`` is +1 for the left leg, -1 for the right,
    (...) or one for all.
    """
    thigh, shank = leg_rotations(angles_rad, side)
    return -thigh[..., 2], -shank[..., 2]


def leg_rotations(
    angles_rad: FloatArray, side: float | FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return rotations (..., 3, 3) from thigh and shank to hips, see :func:`leg_directions`."""
    a = np.asarray(angles_rad, dtype=np.float64)
    thigh = rotation_y(-a[..., 0]) @ rotation_x(side * a[..., 1]) @ rotation_z(-side * a[..., 2])
    return thigh, thigh @ rotation_y(a[..., 3])


def leg_angles(thigh: FloatArray, shank: FloatArray, side: float | FloatArray) -> FloatArray:
    """Return angles (..., 4) of legs with directions (..., 3), see :func:`leg_directions`.

    Knees bend backwards, within a quarter of a turn.
    """
    flexion = np.arctan2(thigh[..., 0], -thigh[..., 2])
    abduction = side * np.arcsin(np.clip(thigh[..., 1], -1.0, 1.0))
    turn = rotation_y(-flexion) @ rotation_x(side * abduction)
    turned = (shank[..., None, :] @ turn)[..., 0, :]
    bend = np.arccos(np.clip(-turned[..., 2], -1.0, 1.0))
    rotation = side * np.arctan2(turned[..., 1], np.maximum(-turned[..., 0], 1e-3))
    return np.stack([flexion, abduction, np.where(bend > 0.05, rotation, 0.0), bend], axis=-1)
