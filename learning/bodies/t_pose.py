"""The turns that bring the rest posture of a rig to the T-pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from learning.bodies.rigged import INDEX, FloatArray
from learning.segments import SEGMENTS

_DOWN = np.array([0.0, 0.0, -1.0])


def turns_to_t_pose(joints: FloatArray, knuckles: FloatArray, across: FloatArray) -> FloatArray:
    """Return the turn of each segment from rest to the T-pose, (segments, 3, 3).

    Trunk, neck, head and collars keep their rest, so that the depth of the shoulders against the
    hips is the rig's own.

    Args:
        joints: joints at rest, (segments, 3).
        knuckles: mean of the finger knuckles of the left and the right hand, (2, 3).
        across: from the knuckle of the index to that of the little finger, (2, 3).
    """
    turns = np.tile(np.eye(3), (len(SEGMENTS), 1, 1))
    for side, (name, out) in enumerate((("left", 1.0), ("right", -1.0))):
        upper, fore, hand = (INDEX[f"{name}_{part}"] for part in ("upper_arm", "forearm", "hand"))
        outward = np.array([0.0, out, 0.0])
        turns[upper] = _swing(joints[fore] - joints[upper], outward)
        bent = turns[upper] @ (joints[hand] - joints[fore])
        turns[fore] = _swing(bent, outward) @ turns[upper]
        flat = _frame(outward, np.array([-1.0, 0.0, 0.0]))
        turns[hand] = flat @ _frame(knuckles[side] - joints[hand], across[side]).T
        thigh, shin, foot = (INDEX[f"{name}_{part}"] for part in ("thigh", "shin", "foot"))
        turns[thigh] = _swing(joints[shin] - joints[thigh], _DOWN)
        bent = turns[thigh] @ (joints[foot] - joints[shin])
        turns[shin] = _swing(bent, _DOWN) @ turns[thigh]
    return turns.astype(np.float32)


def yaw_forward(toe: NDArray[np.floating], ankle: NDArray[np.floating]) -> FloatArray:
    """Return the turn about the vertical that makes a foot point forward, (3, 3)."""
    ahead = np.array([toe[0] - ankle[0], toe[1] - ankle[1], 0.0])
    return _swing(ahead, np.array([1.0, 0.0, 0.0])).astype(np.float32)


def _frame(along: NDArray[np.floating], across: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return unit axes as columns: ``along``, the part of ``across`` normal to it, their cross."""
    first = along / np.linalg.norm(along)
    second = across - (across @ first) * first
    second = second / np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)], axis=1).astype(np.float64)


def _swing(start: NDArray[np.floating], end: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the smallest rotation (3, 3) from one direction to another, less than 180 degrees."""
    a, b = start / np.linalg.norm(start), end / np.linalg.norm(end)
    x, y, z = np.cross(a, b)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + cross + cross @ cross / (1 + a @ b))
