"""The 14 values of a state: their places and limits, and the reference postures.

A state (14,) is a posture d1..d12 followed by ``torso_x`` and ``torso_z``, the searched joints of
the skeleton (:mod:`.skeleton`). All other modules take the places of these values from here.

The order is fixed (paper, equation (3)): 4 of the torso, 4 of the left arm, 4 of the right arm.
Angles are radians, ``torso_y`` is metres in the reference frame, 0 on the optical axis.

In the paper the person's distance and height stay as measured. If they are estimated, they are
called ``torso_x`` and ``torso_z``; they are not part of the posture (12,).
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import (
    JOINT_NAMES,
    PLACE_NAMES,
    POSTURE_GROUPS,
    Group,
    joints_of,
    limits_of,
)

N_JOINTS, N_STATE = len(JOINT_NAMES), len(JOINT_NAMES) + len(PLACE_NAMES)
SHOULDER_ABDUCTION, SHOULDER_FLEXION, ELBOW_ABDUCTION, ELBOW_FLEXION = range(4)
ARM_ANGLES = 4
"""Values of an arm, in that order."""

TORSO_Y, ROLL, PITCH, YAW = range(4)
FIRST_ANGLES = 4, 8
"""Indices at which the angles of the left and of the right arm begin."""
TORSO_X, TORSO_Z = N_JOINTS, N_JOINTS + 1

TORSO = slice(0, 4)
TURNS = slice(ROLL, YAW + 1)
LEFT_ARM, RIGHT_ARM = (slice(first, first + ARM_ANGLES) for first in FIRST_ANGLES)
POSTURE, PLACE = slice(0, N_JOINTS), slice(N_JOINTS, N_STATE)


TURNING_LIMITS: FloatArray = limits_of(*POSTURE_GROUPS)
"""Shape (12, 2): lowest and highest value of each joint, rad (metres for ``torso_y``), of a person
who also turns with the feet, to walk, to look aside, or around."""
JOINT_LIMITS: FloatArray = TURNING_LIMITS.copy()
"""Shape (12, 2): the same of a person who stands, with which the paper's filter searches."""
JOINT_LIMITS[PITCH, 1] = np.radians(90.0)
JOINT_LIMITS[YAW] = np.radians([-60.0, 60.0])
JOINT_LIMITS.setflags(write=False)

_ASIDE_RAD = np.radians(100.0)

NEAREST_M, FARTHEST_M = 0.5, 10.0
"""Distances of the hips from the camera between which a person is searched, metres."""
_FARTHER_M = 1.0


def place_limits(distance_m: float) -> FloatArray:
    """Return the lowest and highest value of each of ``PLACE_NAMES``, (2, 2), metres.

    The person moves between ``NEAREST_M`` and ``FARTHEST_M`` from the camera; the range always
    contains the measured place, ``distance_m`` away, and a step away from it.
    """
    farthest_m = max(FARTHEST_M, distance_m + _FARTHER_M)
    nearest_m = min(NEAREST_M, distance_m)
    _, torso_z = joints_of(Group.PLACE)
    return np.array([[distance_m - farthest_m, distance_m - nearest_m], torso_z.limits])


def state_limits(distance_m: float, facing_rad: float = 0.0) -> FloatArray:
    """Return the lowest and highest value of each value of a state, (14, 2); not writable.

    ``distance_m`` is that of the hips in the body model. The person turns around the yaw
    ``facing_rad``: 0 faces the camera, pi or -pi away from it.
    """
    limits: FloatArray = np.vstack([TURNING_LIMITS, place_limits(distance_m)])
    limits[YAW] = facing_rad - _ASIDE_RAD, facing_rad + _ASIDE_RAD
    limits.setflags(write=False)
    return limits


REFERENCE_NAMES: tuple[str, ...] = ("front", "side", "arms")
SIDE_TURNS: tuple[str, ...] = ("left", "right")

_HANGING_ABDUCTION_RAD = np.radians(20.0)
_STRETCHED_ABDUCTION_RAD = np.radians(80.0)


def reference_posture(name: str, side_turn: str = "left") -> FloatArray:
    """Return the reference posture (12,), rad and metres, with the given name; ``torso_y`` is 0.

    It is ``front`` (facing the camera, arms 20 degrees away from the body), ``side`` (the same,
    turned by 90 degrees to the person's own ``left`` or ``right``) or ``arms`` (facing, both arms
    stretched sideways, 80 degrees). Raises ValueError for another name or turn.
    """
    if name not in REFERENCE_NAMES:
        raise ValueError(f"reference posture {name!r} is unknown; it is one of {REFERENCE_NAMES}")
    if side_turn not in SIDE_TURNS:
        raise ValueError(f"side_turn {side_turn!r} is unknown; it is one of {SIDE_TURNS}")
    posture = np.zeros(N_JOINTS)
    abduction = _STRETCHED_ABDUCTION_RAD if name == "arms" else _HANGING_ABDUCTION_RAD
    posture[LEFT_ARM.start] = posture[RIGHT_ARM.start] = abduction
    if name == "side":
        posture[YAW] = np.pi / 2 if side_turn == "left" else -np.pi / 2
    return posture


def clip_to_limits(postures: FloatArray) -> FloatArray:
    """Return ``postures`` (..., 12) with every joint clipped to its limits."""
    return np.clip(postures, JOINT_LIMITS[:, 0], JOINT_LIMITS[:, 1])
