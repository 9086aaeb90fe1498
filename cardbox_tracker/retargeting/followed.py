"""The person's angles that a robot can follow, by name.

Besides the joints of the posture and of the neck, each arm has two angles as most robot arms have
them, ``SIDE_elbow_bend`` and ``SIDE_upper_arm_turn``: the elbow bends by the first, 0 if the arm is
stretched, and the bent forearm points forwards, or outwards at a turn of a quarter.
"""

from __future__ import annotations

import math

import numpy as np

from cardbox_tracker.body.posture import (
    ELBOW_ABDUCTION,
    ELBOW_FLEXION,
    LEFT_ARM,
    N_JOINTS,
    RIGHT_ARM,
)
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.body.skeleton import JOINT_NAMES, NECK_NAMES

WITH_NECK: tuple[str, ...] = (*JOINT_NAMES, *NECK_NAMES)
"""Order of a posture with the head, (14,)."""
_ARMS = {"left": LEFT_ARM, "right": RIGHT_ARM}
_ELBOW = {
    f"{side}_{name}": tuple(f"{side}_elbow_{angle}" for angle in ("abduction", "flexion"))
    for side in _ARMS
    for name in ("upper_arm_turn", "elbow_bend")
}
ANGLES: tuple[str, ...] = (*WITH_NECK, *_ELBOW)
"""Names that a joint map may have."""
# The direction of a nearly stretched arm says nothing about its turn.
_LEAST_BEND = math.radians(10.0)


def joints_behind(angle: str) -> tuple[str, ...]:
    """Return the joints of the posture that ``angle`` needs; none for the neck."""
    return _ELBOW.get(angle, () if angle in NECK_NAMES else (angle,))


def with_neck(posture: FloatArray, stddev: FloatArray, most_stddev_rad: float) -> FloatArray:
    """Return a posture with the head, (14,), nan where the head is not known.

    Args:
        posture: d1..d12, with ``neck_yaw`` and ``neck_pitch`` if they are known, (12,) or (14,).
        stddev: standard deviations in the same order, (12,) or (14,).
        most_stddev_rad: largest deviation of a known angle, rad.
    """
    whole = np.full(len(WITH_NECK), np.nan)
    whole[:N_JOINTS] = posture[:N_JOINTS]
    if len(posture) == len(stddev) == len(WITH_NECK):
        sure = stddev[N_JOINTS:] <= most_stddev_rad
        whole[N_JOINTS:][sure] = posture[N_JOINTS:][sure]
    return whole


def angles_of(posture: FloatArray) -> dict[str, float]:
    """Return the value of each of ``ANGLES`` in a posture (14,), rad or m; nan if unknown."""
    found = dict(zip(WITH_NECK, posture.tolist(), strict=True))
    for side, arm in _ARMS.items():
        abduction, flexion = posture[arm][[ELBOW_ABDUCTION, ELBOW_FLEXION]].tolist()
        forwards, outwards = math.sin(flexion), math.cos(flexion) * math.sin(abduction)
        down = math.cos(flexion) * math.cos(abduction)
        bend = math.atan2(math.hypot(forwards, outwards), down)
        is_stretched = min(bend, math.pi - bend) < _LEAST_BEND
        turn = math.nan if is_stretched else math.atan2(outwards, forwards)
        found |= {f"{side}_elbow_bend": bend, f"{side}_upper_arm_turn": turn}
    return found
