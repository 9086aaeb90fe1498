"""Bent wrists for motions whose capture left the hands in line with the forearms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from learning.motions.motion import Motion, smoothed
from learning.motions.rotations import FloatArray, about_vector, to_quaternions
from learning.segments import SEGMENTS

SIDES = ("left", "right")
MOST_DEG = np.array([60.0, 60.0, 30.0])
"""Largest bends: pronation, flexion (palm to forearm) and deviation (to thumb or little finger)."""
SMOOTHING_S = 0.35
STIFF_DEG = 6.0


def wrist_turns(motion: Motion, side: str) -> FloatArray:
    """Return rotations (frames, 3, 3) of a hand in the axes of its forearm."""
    forearm, hand = (SEGMENTS.index(f"{side}_{limb}") for limb in ("forearm", "hand"))
    turns = motion.turns.astype(float)
    return np.asarray(np.swapaxes(turns[:, forearm], 1, 2) @ turns[:, hand])


def has_stiff_wrists(motion: Motion) -> bool:
    """Return whether both wrists hardly move throughout the motion."""
    return all(spread_deg(wrist_turns(motion, side)) < STIFF_DEG for side in SIDES)


def spread_deg(turns: FloatArray) -> float:
    """Return the root mean square angle of rotations (frames, 3, 3) from their mean, deg."""
    q = to_quaternions(turns)
    mean = np.linalg.eigh(q.T @ q)[1][:, -1]
    angles = 2 * np.degrees(np.arccos(np.clip(np.abs(q @ mean), 0, 1)))
    return float(np.sqrt(np.mean(angles**2)))


def with_wrists(motion: Motion, rng: np.random.Generator) -> Motion:
    """Return the motion with wrists that bend smoothly and at random, in place of its own."""
    turns = motion.turns.copy()
    for side in SIDES:
        forearm, hand = (SEGMENTS.index(f"{side}_{limb}") for limb in ("forearm", "hand"))
        bends = np.radians(MOST_DEG * wandering(len(motion), motion.fps, rng))
        turns[:, hand] = turns[:, forearm] @ bend(bends, side)
    return replace(motion, turns=turns.astype(np.float32))


def wandering(frames: int, fps: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return smooth random values (frames, 3) between -1 and 1 about a random middle."""
    middle = rng.uniform(-0.4, 0.4, 3)
    deviation = SMOOTHING_S * fps
    noise = smoothed(rng.normal(size=(frames, 3)), deviation)
    # Smoothing white noise divides its deviation by this, away from the ends.
    size = np.sqrt(2 * np.sqrt(np.pi) * deviation)
    return np.asarray(np.tanh(middle + rng.uniform(0.1, 0.6) * size * noise))


def bend(angles_rad: FloatArray, side: str) -> FloatArray:
    """Return rotations (..., 3, 3) of a hand against its forearm.

    Args:
        angles_rad: pronation, flexion and deviation (..., 3); positive ones turn the thumb down,
            the palm to the forearm, and the hand to the side of the thumb.
        side: "left" or "right".
    """
    pronation, flexion, deviation = np.moveaxis(angles_rad, -1, 0)
    # In the T-pose the palms face down and the thumbs forward.
    mirror = 1.0 if side == "left" else -1.0
    zero = np.zeros_like(pronation)
    twist = about_vector(np.stack([zero, pronation, zero], axis=-1))
    bent = about_vector(np.stack([-mirror * flexion, zero, -mirror * deviation], axis=-1))
    return np.asarray(twist @ bent)
