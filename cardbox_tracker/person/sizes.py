"""The 18 body sizes a1..a18 of the cardbox model and their three subsets (paper, section II-A).

All sizes are in metres, and both arms are alike. The order is fixed: O1 is measured in the front
view, O2 in the side view, O3 in the front view with the arms stretched sideways.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class Size(NamedTuple):
    """One size: its default, the range a human body can have, all in metres, and its meaning."""

    name: str
    default_m: float
    minimum_m: float
    maximum_m: float
    description: str


# Rounded means of adults; the ranges include a child of ten years and a very large adult.
SIZES: tuple[Size, ...] = (
    Size("torso_top_width", 0.34, 0.10, 0.70, "width of the torso at its top"),
    Size("torso_bottom_width", 0.30, 0.10, 0.80, "width of the torso at its bottom"),
    Size("torso_height", 0.36, 0.15, 0.65, "height of the torso, from the waist's top"),
    Size("waist_width", 0.33, 0.10, 0.80, "width of the waist"),
    Size("waist_height", 0.17, 0.05, 0.40, "height of the waist, from the middle of the hips"),
    Size("head_width", 0.17, 0.08, 0.35, "width of the head, hair included"),
    Size("head_height", 0.24, 0.12, 0.40, "height of the head, chin to crown"),
    Size("neck_length", 0.06, 0.0, 0.20, "gap between the torso's top and the chin"),
    Size("torso_depth", 0.22, 0.08, 0.60, "depth of the torso, chest to back"),
    Size("waist_depth", 0.22, 0.08, 0.60, "depth of the waist"),
    Size("head_depth", 0.20, 0.08, 0.40, "depth of the head, nose to back"),
    Size("head_offset", 0.04, -0.10, 0.20, "head centre forward of the torso's axis"),
    Size("shoulder_breadth", 0.36, 0.15, 0.65, "distance between the shoulder joints"),
    Size("shoulder_drop", 0.05, -0.05, 0.20, "shoulder joint below the torso's top"),
    Size("upper_arm_length", 0.27, 0.12, 0.45, "shoulder joint to elbow joint"),
    Size("upper_arm_width", 0.10, 0.04, 0.25, "width of the upper arm"),
    Size("forearm_length", 0.36, 0.15, 0.55, "elbow joint to the knuckles, where a fist ends"),
    Size("forearm_width", 0.085, 0.03, 0.22, "width of the forearm"),
)

SIZE_NAMES: tuple[str, ...] = tuple(size.name for size in SIZES)
SIZE_INDEX = MappingProxyType({name: i for i, name in enumerate(SIZE_NAMES)})
N_SIZES = len(SIZES)

SUBSETS = MappingProxyType({"O1": slice(0, 8), "O2": slice(8, 12), "O3": slice(12, 18)})
"""The subsets of the paper's three-step estimation, as slices of the size vector."""

DEFAULT_SIZES: FloatArray = np.array([size.default_m for size in SIZES])
SIZE_LIMITS: FloatArray = np.array([[size.minimum_m, size.maximum_m] for size in SIZES])
"""Shape (18, 2): smallest and largest plausible value of each size, metres."""

for _constant in (DEFAULT_SIZES, SIZE_LIMITS):
    _constant.setflags(write=False)
