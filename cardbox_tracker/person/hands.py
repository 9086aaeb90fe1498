"""The hands behind the forearms, of people whose hands are measured.

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

import numpy as np

from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import HAND_NAMES, Group, limits_of

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


def limited(joints_rad: FloatArray) -> FloatArray:
    """Return turn, flexion and deviation (3,) within their limits."""
    return np.clip(joints_rad, *limits_of(Group.HAND, side="left").T)
