"""Random postures of an arm, by the places that hands take.

Places are lengths of the leg, from the shoulder, in axes of the chest: forward, outwards, up. An
arm is described as if it was the left one; the right arm is its mirror image.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from learning.motions.rotations import (
    FloatArray,
    about_axis,
    between,
    from_quaternions,
    to_quaternions,
    unit,
)

UPPER_ARM, FOREARM = 0.33, 0.36
"""Shoulder to elbow, and elbow to the middle of the hand."""
# Boxes of places of the hand (from, to), and the direction in which the elbow gives way.
KINDS: dict[str, tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]] = {
    "hanging": ((-0.05, 0.00, -0.69), (0.20, 0.15, -0.60), (-1.0, 0.3, 0.0)),
    "sideways": ((-0.12, 0.35, -0.30), (0.30, 0.69, 0.35), (-0.4, 0.0, -1.0)),
    "raised beside": ((-0.10, 0.15, 0.10), (0.25, 0.50, 0.55), (-0.3, 0.8, -0.6)),
    "forward": ((0.50, -0.25, -0.25), (0.69, 0.25, 0.25), (-0.2, 0.4, -1.0)),
    "before the body": ((0.12, -0.35, -0.50), (0.60, 0.30, 0.20), (-0.4, 0.7, -0.8)),
    "near the chest": ((0.08, -0.35, -0.40), (0.30, 0.10, 0.10), (-0.4, 0.8, -0.7)),
    "at the face": ((0.08, -0.25, 0.10), (0.30, 0.00, 0.35), (0.3, 0.5, -1.0)),
    "on the hip": ((-0.06, 0.00, -0.50), (0.08, 0.06, -0.42), (-0.5, 1.0, 0.0)),
    "behind the back": ((-0.30, -0.30, -0.50), (-0.18, 0.00, -0.25), (-0.5, 1.0, 0.1)),
    "backwards": ((-0.35, 0.05, -0.60), (-0.15, 0.25, -0.45), (-0.6, 0.6, 0.3)),
    "overhead": ((-0.05, -0.15, 0.42), (0.25, 0.30, 0.69), (0.2, 1.0, -0.2)),
    "across": ((0.15, -0.50, -0.35), (0.45, -0.20, 0.15), (-0.2, 0.6, -0.8)),
}
# Places of everyday gestures that the others lack; the first four are in the frontal plane.
GESTURES: dict[str, tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]] = {
    "low": ((-0.03, 0.12, -0.68), (0.06, 0.40, -0.45), (-0.1, 1.0, 0.3)),
    "level": ((-0.03, 0.40, -0.25), (0.06, 0.69, 0.25), (-0.1, 0.1, -1.0)),
    "high": ((-0.03, 0.10, 0.25), (0.06, 0.50, 0.66), (0.0, 1.0, -0.4)),
    "waving": ((-0.03, 0.20, 0.05), (0.10, 0.45, 0.45), (0.0, 0.8, -0.8)),
    "apart": ((0.25, -0.10, -0.25), (0.50, 0.15, 0.00), (-0.3, 0.7, -0.8)),
    "together": ((0.25, -0.24, -0.25), (0.50, -0.19, 0.00), (-0.3, 0.7, -0.8)),
    "folded": ((0.10, -0.40, -0.36), (0.20, -0.25, -0.20), (-0.1, 0.6, -1.0)),
    "swung": ((0.15, 0.02, -0.65), (0.40, 0.12, -0.45), (-1.0, 0.3, 0.0)),
}
SHARES = {"hanging": 2.0, "before the body": 3.0, "near the chest": 1.5, "forward": 1.5}
POLE_SPREAD = 0.35
# The trunk is an elliptic cylinder and the head a ball, both as seen from the left shoulder.
TRUNK_MIDDLE, TRUNK_DEPTH, TRUNK_WIDTH = -0.21, 0.115, 0.175
TRUNK_BOTTOM, TRUNK_TOP = -0.65, 0.04
HEAD_MIDDLE, HEAD_RADIUS = (0.02, -0.21, 0.27), 0.13
MOST_BACKWARD = -0.8
TRIES = 40


@dataclass(frozen=True)
class Arm:
    """Posture of the left arm.

    Args:
        upper: quaternion (4,) of the upper arm against the chest.
        elbow_rad: flexion of the elbow, 0 when straight.
    """

    upper: FloatArray
    elbow_rad: float


HANGING = (0.05, 0.04, -0.67)


def reaching(place: ArrayLike, pole: ArrayLike) -> Arm:
    """Return the arm whose hand is at a place, as nearly as it can reach.

    Args:
        place: of the hand (3,).
        pole: direction (3,) in which the elbow leaves the line from shoulder to hand.
    """
    target = np.asarray(place, dtype=float)
    along = unit(target)
    far = float(np.clip(np.linalg.norm(target), 0.17, UPPER_ARM + FOREARM - 0.004))
    cosine = (UPPER_ARM**2 + far**2 - FOREARM**2) / (2 * UPPER_ARM * far)
    aside = np.asarray(pole, dtype=float)
    aside = unit(aside - (aside @ along) * along)
    upper = cosine * along + np.sqrt(max(0.0, 1 - cosine**2)) * aside
    fore = unit(far * along - UPPER_ARM * upper)
    hinge = unit(np.cross(fore, upper))
    turns = np.stack([np.cross(upper, hinge), upper, hinge], axis=1)
    return Arm(to_quaternions(turns), float(np.arccos(np.clip(upper @ fore, -1, 1))))


def directions(upper: FloatArray, elbow_rad: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return unit vectors (..., 3) along upper arm and forearm of postures of the left arm."""
    turns = from_quaternions(upper)
    fore = turns @ about_axis(2, -np.asarray(elbow_rad))
    return turns[..., :, 1], fore[..., :, 1]


def is_free(upper: FloatArray, elbow_rad: ArrayLike) -> bool:
    """Return whether arms (n, 4) and (n,) neither meet trunk or head nor reach too far back."""
    above, fore = directions(upper, elbow_rad)
    shares = np.linspace(0.2, 1.0, 5)[:, None, None]
    points = np.concatenate([UPPER_ARM * above[None], UPPER_ARM * above + shares * FOREARM * fore])
    x, y, z = np.moveaxis(points, -1, 0)
    inside = (x / TRUNK_DEPTH) ** 2 + ((y - TRUNK_MIDDLE) / TRUNK_WIDTH) ** 2 < 1
    in_trunk = inside & (z > TRUNK_BOTTOM) & (z < TRUNK_TOP)
    in_head = np.linalg.norm(points - HEAD_MIDDLE, axis=-1) < HEAD_RADIUS
    return not bool(np.any(in_trunk | in_head) or np.any(above[..., 0] < MOST_BACKWARD))


def is_way_free(start: Arm, end: Arm) -> bool:
    """Return whether the arm is free all the way from one posture to another."""
    share = np.linspace(0, 1, 9)
    upper = between(np.tile(start.upper, (9, 1)), np.tile(end.upper, (9, 1)), share)
    elbow = start.elbow_rad + share * (end.elbow_rad - start.elbow_rad)
    return is_free(upper, elbow)


def drawn(kind: str, start: Arm, rng: np.random.Generator) -> Arm:
    """Return a random arm of a kind that ``start`` can reach; ``start`` itself if none is found."""
    low, high, pole = (KINDS | GESTURES)[kind]
    for _ in range(TRIES):
        arm = reaching(rng.uniform(low, high), unit(pole) + POLE_SPREAD * rng.normal(size=3))
        if is_way_free(start, arm):
            return arm
    return start


def random_kind(rng: np.random.Generator) -> str:
    """Return the name of a kind of posture at random."""
    shares = np.array([SHARES.get(kind, 1.0) for kind in KINDS])
    return str(rng.choice(list(KINDS), p=shares / shares.sum()))
