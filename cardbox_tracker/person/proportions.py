"""Mean sizes and lengths of bones of people of a stature, as shares of it.

The lengths of trunk and legs, and the place of the wrist, are from Drillis & Contini, "Body
Segment Parameters", 1966 (also in Winter, "Biomechanics and Motor Control of Human Movement").
Upper arm, and forearm with the hand up to its knuckles, are the means of men and women of de Leva,
"Adjustments to Zatsiorsky-Seluyanov's Segment Inertia Parameters", 1996. Breadths and depths are
from ANSUR II, 2012; the distance between the shoulder joints is the mean biacromial breadth of both
sexes, 0.237 and 0.224 of the stature, less 3 cm on either side.

Among people of one stature lengths vary by about 6 % and breadths by about 20 %, so such a
body is less exact than a measured one.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.person.parts import BodyParts
from cardbox_tracker.person.sizes import DEFAULT_SIZES, SIZE_INDEX, FloatArray

STATURE_M = 1.72
"""Stature that ``DEFAULT_SIZES`` belongs to, metres."""

USUAL_STATURE_M, USUAL_STDDEV_M = 1.69, 0.09
"""Mean stature of adults, women and men alike, and its standard deviation, metres."""

HIP_SHARE, THIGH_SHARE, SHANK_SHARE, ANKLE_SHARE = 0.06, 0.245, 0.246, 0.039
"""Hip joint from the middle of the hips, thigh, shank to the ankle, and ankle above the floor."""
WRIST_SHARE = 0.73
"""Place of the wrist between elbow and knuckles: forearm and half of the hand have 0.146 and 0.054
of the stature."""
MARKED_HEIGHTS: FloatArray = np.array([0.915, 0.932, 0.811, 0.507, 0.283, 0.063])
"""Heights above the floor at which MediaPipe marks nose, ears, shoulders, hips, knees and ankles of
people who stand upright."""
MASS_SHARES = 0.4244, 0.3670, 0.1393, 0.0693
"""Shares of the middles of shoulders, hips, knees and ankles in that of the mass.

Trunk with head and arms, thighs, shanks and feet have 0.678, 0.2, 0.093 and 0.029 of it; the
centres are at 0.626, 0.433 and 0.433 of the way from the hips to the shoulders, from the hips to
the knees, and from these to the ankles (Winter, table 4.1).
"""
_CROWN_SHARE = 0.83 / STATURE_M
LENGTH_SHARES = {"upper_arm_length": 0.160, "forearm_length": 0.2005, "shoulder_breadth": 0.197}
"""Upper arm, forearm to the knuckles, and distance of the shoulder joints."""

STATURE_LIMITS_M = (1.1, 2.2)
"""Range of the stature, metres: a child of six to a very tall adult."""

BREADTHS: tuple[str, ...] = (
    "shoulder_breadth",
    "torso_top_width",
    "torso_bottom_width",
    "waist_width",
    "head_width",
    "upper_arm_width",
    "forearm_width",
)
"""Sizes that depend little on the stature and that the outline from the front shows."""


def sizes_of_stature(stature_m: float) -> FloatArray:
    """Return the mean sizes (18,) of people of a stature, metres."""
    sizes: FloatArray = DEFAULT_SIZES * stature_m / STATURE_M
    for name, share in LENGTH_SHARES.items():
        sizes[SIZE_INDEX[name]] = share * stature_m
    return sizes


def stature_of(parts: BodyParts[float]) -> float:
    """Return the stature of a person with this trunk and head, metres."""
    return parts.head.top_m / _CROWN_SHARE
