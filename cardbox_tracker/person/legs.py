"""The legs: rows of the skeleton behind the others, for people whose legs are measured.

A thigh turns forwards, outwards, then inwards about its own axis; then the knee bends:

    R_thigh = R_hips Ry(-flexion) Rx(+-abduction) Rz(-+rotation),   R_shank = R_thigh Ry(bend)

with the upper sign for the left leg. The frame of the hips is that which ``torso_yaw`` moves, so it
stays level. All is zero for a leg that hangs.

The ranges are those of the American Academy of Orthopaedic Surgeons, see :mod:`.skeleton`: hip
flexion 120, extension 30, abduction 45, adduction 30, rotation 45; knee flexion 135. Soft tissue
gives way under the weight of a person who squats or sits low, so they have up to 20 degrees more.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import BodyParts, body_parts
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import (
    FIXED,
    REVOLUTE,
    Group,
    Joint,
    X,
    Y,
    rotation_x,
    rotation_y,
    rotation_z,
)

HIP_SHARE, THIGH_SHARE, SHANK_SHARE = 0.06, 0.245, 0.246
"""Hip joint from the middle of the hips, thigh, and shank up to the ankle, as shares of the
stature; the latter two are those of Drillis & Contini (:mod:`.proportions`)."""
ANKLE_SHARE = 0.039
"""Height of the ankle above the floor, as a share of the stature (Drillis & Contini)."""
_CROWN_SHARE = 0.83 / 1.72


def stature_of(parts: BodyParts[float]) -> float:
    """Return the stature of a person with this trunk and head, m, see :mod:`.proportions`."""
    return parts.head.top_m / _CROWN_SHARE


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


def _deg(lowest: float, highest: float) -> tuple[float, float]:
    return math.radians(lowest), math.radians(highest)


def _leg(name: str, side: float) -> Iterator[Joint]:
    """Yield the joints of a leg; ``side`` is +1 for the left one, -1 for the right."""
    free, letter = (Group.NOTHING, REVOLUTE), name[0]

    def joint(what: str, parent: str, *rest: object, **more: object) -> Joint:
        group, kind = free
        return Joint(f"{name}_{what}", group, parent, kind, *rest, **more)  # type: ignore[arg-type]

    yield joint(
        *("hip_flexion", "torso_yaw", (0.0, -1.0, 0.0), _deg(-40, 125), f"{letter}_p_hip"),
        offset=lambda parts: (0.0, side * HIP_SHARE * stature_of(parts), 0.0),
    )
    yield joint(
        "hip_abduction", f"{name}_hip_flexion", (side, 0.0, 0.0), _deg(-35, 65), f"{letter}_r_hip"
    )
    yield joint(
        *("hip_rotation", f"{name}_hip_abduction", (0.0, 0.0, -side), _deg(-50, 50)),
        *(f"{letter}_y_hip", f"{name}_thigh"),
    )
    yield joint(
        *("knee_flexion", f"{name}_hip_rotation", Y, _deg(0, 150), f"{letter}_knee"),
        *(f"{name}_shank", lambda parts: (0.0, 0.0, -THIGH_SHARE * stature_of(parts))),
    )
    yield Joint(
        *(f"{name}_ankle", Group.NOTHING, f"{name}_knee_flexion", FIXED, X, (0.0, 0.0)),
        *(f"{letter}_ankle", f"{name}_foot"),
        lambda parts: (0.0, 0.0, -SHANK_SHARE * stature_of(parts)),
    )


LEGS: tuple[Joint, ...] = (*_leg("left", 1.0), *_leg("right", -1.0))
"""Joints of the legs, which follow the others where legs are measured (:mod:`.tracking.legs`)."""
LEG_NAMES = tuple(joint.name for joint in LEGS if joint.kind == REVOLUTE)
"""The 8 joints of the legs, four of the left one first; all are in rad."""
LEG_LIMITS: FloatArray = np.array([joint.limits for joint in LEGS if joint.kind == REVOLUTE])
"""Shape (8, 2): lowest and highest value of each of ``LEG_NAMES``, rad."""
LEG_LIMITS.setflags(write=False)
LEG_KEYPOINT_NAMES: tuple[str, ...] = (
    *("left_hip", "left_knee", "left_ankle"),
    *("right_hip", "right_knee", "right_ankle"),
)


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
