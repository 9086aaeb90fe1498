"""A stick figure of plain proportions, which shows and measures motions."""

from __future__ import annotations

import numpy as np

from learning.motions.motion import CHEST, Motion
from learning.motions.rotations import FloatArray
from learning.segments import PARENTS, SEGMENTS

ANKLE = 0.08
"""Height of the ankle above the floor, in lengths of the leg."""
THIGH = SHIN = 0.46
# Places of the joints in their parents' axes in the T-pose, in lengths of the leg (left side).
OFFSETS: dict[str, tuple[float, float, float]] = {
    "spine": (0, 0, 0.15), "chest": (0, 0, 0.15), "neck": (0, 0, 0.30), "head": (0, 0, 0.10),
    "collar": (0, 0.03, 0.24), "upper_arm": (0, 0.18, 0), "forearm": (0, 0.33, 0),
    "hand": (0, 0.29, 0), "thigh": (0, 0.10, 0), "shin": (0, 0, -THIGH), "foot": (0, 0, -SHIN),
}  # fmt: skip
ENDS = {"head": (0.0, 0.0, 0.25), "hand": (0.0, 0.10, 0.0), "foot": (0.20, 0.0, -0.05)}
MIRROR = np.array([1.0, -1.0, 1.0])


def offset(segment: str, table: dict[str, tuple[float, float, float]]) -> FloatArray:
    """Return the offset (3,) of a segment from a table of the left side."""
    side, _, limb = segment.partition("_")
    value = np.array(table[limb or segment], dtype=float)
    return value * MIRROR if side == "right" else value


def figures(motion: Motion) -> FloatArray:
    """Return the places of the joints (frames, segments, 3) in lengths of the leg."""
    at = np.zeros((len(motion), len(SEGMENTS), 3))
    at[:, 0] = motion.places
    for index, (segment, parent) in enumerate(zip(SEGMENTS, PARENTS, strict=True)):
        if parent >= 0:
            turned = motion.turns[:, parent].astype(float) @ offset(segment, OFFSETS)
            at[:, index] = at[:, parent] + turned
    return at


def ends(motion: Motion) -> dict[str, FloatArray]:
    """Return the far ends (frames, 3) of head, hands and feet."""
    at = figures(motion)
    return {
        segment: at[:, index] + motion.turns[:, index] @ offset(segment, ENDS)
        for index, segment in enumerate(SEGMENTS)
        if segment.rpartition("_")[2] in ENDS
    }


def hands_in_chest(motion: Motion) -> FloatArray:
    """Return the hands (frames, 2, 3), left and right, from their shoulders in the chest's axes."""
    at, tips = figures(motion), ends(motion)
    seen = [
        np.einsum(
            "nji,nj->ni",
            motion.turns[:, CHEST].astype(float),
            tips[f"{side}_hand"] - at[:, SEGMENTS.index(f"{side}_upper_arm")],
        )
        for side in ("left", "right")
    ]
    return np.stack(seen, axis=1)
