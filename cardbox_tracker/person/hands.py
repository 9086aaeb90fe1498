"""The hands: rows of the skeleton behind the forearms, for people whose hands are measured.

A hand turns about the forearm, bends to its palm, and then to the little finger:

    R_palm = R_forearm Rz(-+turn) Rx(-+flexion) Ry(deviation)

with the upper sign for the left hand. All is zero if the palm of a hanging arm faces the body. The
turn is against the frame of the forearm, which the joints of the elbow define, so it is known for a
straight arm, too, and can have any value. The other ranges are those of the American Academy of
Orthopaedic Surgeons, see :mod:`.skeleton`: flexion 80, extension 70, deviation to the thumb 20 and
to the little finger 30 degrees, with 20 degrees more for errors of the measurement.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from cardbox_tracker.person.parts import BodyParts
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import REVOLUTE, Group, Joint, Point, Y

WRIST_SHARE = 0.75
"""Where between elbow and knuckles the wrist is."""


def _wrist_m(parts: BodyParts[float]) -> Point:
    return 0.0, 0.0, WRIST_SHARE * parts.forearm.bottom_m


def _hand(name: str, side: float) -> Iterator[Joint]:
    """Yield the joints of a hand; ``side`` is +1 for the left one, -1 for the right."""
    free, letter = (Group.NOTHING, REVOLUTE), name[0]
    yield Joint(
        *(f"{name}_forearm_turn", free[0], f"{name}_elbow_flexion", free[1]),
        *((0.0, 0.0, -side), (-math.pi, math.pi), f"{letter}_y_wrist"),
    )
    yield Joint(
        *(f"{name}_wrist_flexion", free[0], f"{name}_forearm_turn", free[1], (-side, 0.0, 0.0)),
        *((math.radians(-90), math.radians(100)), f"{letter}_r_wrist", "", _wrist_m),
    )
    yield Joint(
        *(f"{name}_wrist_deviation", free[0], f"{name}_wrist_flexion", free[1], Y),
        *((math.radians(-40), math.radians(50)), f"{letter}_p_wrist", f"{name}_palm"),
    )


HANDS: tuple[Joint, ...] = (*_hand("left", 1.0), *_hand("right", -1.0))
"""Joints of the hands, where they are measured (:mod:`.tracking.hands`)."""
HAND_NAMES = tuple(joint.name for joint in HANDS)
"""The 6 joints of the hands, three of the left one first; all are in rad."""
WRIST_NAMES = HAND_NAMES[1:3], HAND_NAMES[4:6]
"""Flexion and deviation of the left and the right wrist."""
HAND_OPEN_NAMES = "left_hand_open", "right_hand_open"
"""How open the hands are, 0 to 1."""


def turn_of(palm: FloatArray, forearm: FloatArray, side: float) -> float:
    """Return the turn of a hand about its forearm, rad.

    ``palm`` (3,) is the normal out of the palm, ``forearm`` (3, 3) the rotation of its frame in the
    same axes; ``side`` is +1 for the left hand, -1 for the right.
    """
    x, y, _ = forearm.T @ palm
    return -side * math.atan2(side * float(x), -side * float(y))


_LOWEST, _HIGHEST = np.array([joint.limits for joint in HANDS[:3]]).T


def limited(joints_rad: FloatArray) -> FloatArray:
    """Return turn, flexion and deviation (3,) within their limits."""
    return np.clip(joints_rad, _LOWEST, _HIGHEST)
