"""Random sizes of a body's parts: each segment is stretched, the weights blend the seams."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from learning.bodies.rigged import INDEX, FloatArray, RiggedBody, blend, chain
from learning.segments import SEGMENTS

_SIDES = ("left", "right")


@dataclass(frozen=True)
class Shape:
    """Factors of sizes; 1 leaves the body as it is.

    ``forward_m`` moves the shoulders forward against the hips, metres, by a shear of the trunk.
    ``upper_arm`` and ``forearm`` are lengths; ``hand`` and ``head`` scale all directions;
    ``breadth`` is the distance of the shoulders, ``depth`` and ``width`` belong to the trunk, and
    ``limbs`` is the girth of arms and legs.
    """

    stature: float = 1.0
    forward_m: float = 0.0
    upper_arm: float = 1.0
    forearm: float = 1.0
    hand: float = 1.0
    head: float = 1.0
    breadth: float = 1.0
    trunk: float = 1.0
    legs: float = 1.0
    depth: float = 1.0
    width: float = 1.0
    limbs: float = 1.0


def draw_shape(rng: np.random.Generator) -> Shape:
    """Return a random shape.

    Shoulders move by up to 5 cm; the arms' length and the share of the upper arm vary by 4 %.
    """

    def around(spread: float) -> float:
        return float(rng.uniform(1 - spread, 1 + spread))

    arm, share, girth = around(0.04), rng.uniform(-0.04, 0.04), around(0.1)
    return Shape(
        stature=around(0.1),
        forward_m=float(rng.uniform(-0.05, 0.05)),
        upper_arm=arm * (1 + share),
        forearm=arm * (1 - share),
        hand=around(0.08),
        head=around(0.05),
        breadth=around(0.05),
        trunk=around(0.03),
        legs=around(0.04),
        depth=girth * around(0.05),
        width=girth,
        limbs=(1 + girth) / 2 * around(0.05),
    )


def reshaped(body: RiggedBody, shape: Shape) -> RiggedBody:
    """Return the body with other sizes."""
    skeleton, flesh = _stretches(body, shape)
    joints = chain(body.joints, skeleton, body.joints[0])
    shift = joints - np.einsum("sij,sj->si", flesh, body.joints)
    vertices = blend(body.vertices, body.bones, body.shares, flesh, shift)
    hands = [INDEX[f"{side}_hand"] for side in _SIDES]
    head = INDEX["head"]
    knuckles = np.einsum("hij,hj->hi", flesh[hands], body.knuckles) + shift[hands]
    centre = flesh[head] @ body.head_centre + shift[head]
    moved = replace(body, vertices=vertices, joints=joints, knuckles=knuckles, head_centre=centre)
    return moved.scaled(shape.stature)


def _stretches(body: RiggedBody, shape: Shape) -> tuple[FloatArray, FloatArray]:
    """Return the matrices (segments, 3, 3) that move the joints and those that move the skin."""
    skeleton = np.tile(np.eye(3), (len(SEGMENTS), 1, 1))
    flesh = skeleton.copy()
    rest = body.joints
    shoulders = (rest[INDEX["left_upper_arm"]] + rest[INDEX["right_upper_arm"]]) / 2
    shear = np.eye(3)
    shear[0, 2] = shape.forward_m / (shape.trunk * (shoulders[2] - rest[0, 2]))
    for name in ("hips", "spine", "chest"):
        skeleton[INDEX[name]] = shear @ np.diag([1, 1, shape.trunk])
        flesh[INDEX[name]] = shear @ np.diag([shape.depth, shape.width, shape.trunk])
    # The distance of the hip joints follows the width of the trunk only by half.
    skeleton[0] = skeleton[0] @ np.diag([1, (1 + shape.width) / 2, 1])
    skeleton[INDEX["chest"]] = skeleton[INDEX["chest"]] @ np.diag([1, shape.breadth, 1])
    skeleton[INDEX["head"]] = flesh[INDEX["head"]] = shape.head * np.eye(3)
    for side in _SIDES:
        parts = (
            ("collar", "upper_arm", shape.breadth, 1.0),
            ("upper_arm", "forearm", shape.upper_arm, shape.limbs),
            ("forearm", "hand", shape.forearm, shape.limbs),
            ("thigh", "shin", shape.legs, shape.limbs),
            ("shin", "foot", shape.legs, shape.limbs),
        )
        for part, child, length, girth in parts:
            segment, end = INDEX[f"{side}_{part}"], INDEX[f"{side}_{child}"]
            along = rest[end] - rest[segment]
            skeleton[segment] = _stretch(along, length, 1.0)
            flesh[segment] = _stretch(along, length, girth)
        flesh[INDEX[f"{side}_hand"]] = shape.hand * np.eye(3)
    return skeleton.astype(np.float32), flesh.astype(np.float32)


def _stretch(along: FloatArray, length: float, girth: float) -> NDArray[np.float64]:
    """Return the matrix that scales a direction by ``length`` and those across by ``girth``."""
    unit = along / np.linalg.norm(along)
    return np.asarray(girth * np.eye(3) + (length - girth) * np.outer(unit, unit))
