"""The 14 values of a state: names, order, limits, mirror image, and the reference postures.

A state (14,) is a posture d1..d12 followed by ``torso_x`` and ``torso_z``. All other modules take
the places of these values from here.

The order is fixed (paper, equation (3)): 4 of the torso, 4 of the left arm, 4 of the right arm. The
rest posture (upright, arms hanging) is all zero. Angles are radians, ``torso_y`` is metres in the
reference frame, 0 on the optical axis.

In the paper the person's distance and height stay as measured. If they are estimated, they are
called ``torso_x`` and ``torso_z``; they are not part of the posture (12,).

The anatomical ranges are from the American Academy of Orthopaedic Surgeons, "Joint Motion: Method
of Measuring and Recording", 1965 (reprinted in Norkin & White, "Measurement of Joint Motion"), in
degrees: thoraco-lumbar lateral flexion 35, flexion 80, extension 25, rotation 45; hip flexion 120,
abduction 45, rotation 45; shoulder abduction 180, flexion 180, extension 60, horizontal adduction
45; elbow flexion 150, none backwards (10 are allowed for a straight arm).

The torso reaches from the hips to the neck, so the ranges of hips and spine add up, rounded down to
the range of a standing person. The two angles of a limb reach every direction twice: flexion beyond
90 degrees equals less flexion with the abduction turned by half a circle. Flexion therefore ends at
about 90 degrees, and abduction covers the rest. A forearm can point to either side, since the upper
arm of this model does not turn about its axis.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.body.sizes import FloatArray

JOINT_NAMES: tuple[str, ...] = (
    "torso_y",
    "torso_roll",
    "torso_pitch",
    "torso_yaw",
    "left_shoulder_abduction",
    "left_shoulder_flexion",
    "left_elbow_abduction",
    "left_elbow_flexion",
    "right_shoulder_abduction",
    "right_shoulder_flexion",
    "right_elbow_abduction",
    "right_elbow_flexion",
)
N_JOINTS = len(JOINT_NAMES)

PLACE_NAMES: tuple[str, ...] = ("torso_x", "torso_z")
"""How far the hips are nearer to the camera, and higher, than where they were measured, metres."""

N_STATE = N_JOINTS + len(PLACE_NAMES)
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

_TORSO_LIMITS_DEG = ((-45, 45), (-25, 90), (-60, 60))
_ARM_LIMITS_DEG = ((-45, 180), (-60, 90), (-150, 150), (-10, 95))
TORSO_Y_LIMIT_M = 3.0
"""Largest sideways distance at which a fixed camera sees a person, metres."""

JOINT_LIMITS: FloatArray = np.vstack(
    [
        [[-TORSO_Y_LIMIT_M, TORSO_Y_LIMIT_M]],
        np.radians(_TORSO_LIMITS_DEG),
        np.radians(_ARM_LIMITS_DEG),
        np.radians(_ARM_LIMITS_DEG),
    ]
)
"""Shape (12, 2): lowest and highest value of each joint, rad (metres for ``torso_y``)."""
JOINT_LIMITS.setflags(write=False)

_TURN_DEG = 100.0
TURNING_LIMITS: FloatArray = JOINT_LIMITS.copy()
"""Shape (12, 2): limits of a person who also turns with the feet, to walk or to look aside."""
TURNING_LIMITS[YAW] = np.radians([-_TURN_DEG, _TURN_DEG])
TURNING_LIMITS.setflags(write=False)

NEAREST_M, FARTHEST_M = 0.5, 10.0
"""Distances of the hips from the camera between which a person is searched, metres."""
TORSO_Z_LIMITS_M = (-0.6, 0.3)
"""Range of ``torso_z`` between sitting on a low stool and standing on tiptoe, metres."""
_FARTHER_M = 1.0


def place_limits(distance_m: float) -> FloatArray:
    """Return the lowest and highest value of each of ``PLACE_NAMES``, (2, 2), metres.

    The person moves between ``NEAREST_M`` and ``FARTHEST_M`` from the camera; the range always
    contains the measured place, and a step away from it.

    Args:
        distance_m: distance of the hips in the body model.
    """
    farthest_m = max(FARTHEST_M, distance_m + _FARTHER_M)
    nearest_m = min(NEAREST_M, distance_m)
    return np.array([[distance_m - farthest_m, distance_m - nearest_m], TORSO_Z_LIMITS_M])


def state_limits(distance_m: float) -> FloatArray:
    """Return the lowest and highest value of each value of a state, (14, 2); not writable.

    Args:
        distance_m: distance of the hips in the body model, metres.
    """
    limits: FloatArray = np.vstack([TURNING_LIMITS, place_limits(distance_m)])
    limits.setflags(write=False)
    return limits


REFERENCE_NAMES: tuple[str, ...] = ("front", "side", "arms")
SIDE_TURNS: tuple[str, ...] = ("left", "right")

_HANGING_ABDUCTION_RAD = np.radians(20.0)
_STRETCHED_ABDUCTION_RAD = np.radians(80.0)


def reference_posture(name: str, side_turn: str = "left") -> FloatArray:
    """Return the reference posture d_ref with the given name.

    Args:
        name: ``front`` (facing the camera, arms 20 degrees away from the body), ``side`` (the same,
            turned by 90 degrees) or ``arms`` (facing, both arms stretched sideways, 80 degrees).
        side_turn: ``left`` if the person turned to their own left for ``side``, so that their right
            side is towards the camera, or ``right``.

    Returns:
        Shape (12,), rad and metres; ``torso_y`` is 0.

    Raises:
        ValueError: ``name`` or ``side_turn`` is unknown.
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
