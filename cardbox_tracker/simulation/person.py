"""A person with volume: rounded parts around the skeleton, no cardbox.

Each part is a stack of elliptical rings; what lies between two neighbouring rings is their convex
hull. The rings follow the sizes of a :class:`BodyModel` loosely, as flesh does: limbs taper, the
torso narrows at waist and shoulders, there are a neck, fists and legs. So the cardbox never matches
perfectly, while the skeleton is known exactly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.kinematics import BodyFrames, forward_kinematics
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.parts import body_parts
from cardbox_tracker.body.sizes import DEFAULT_SIZES, SIZE_LIMITS

FloatArray = NDArray[np.float64]

_RING_POINTS = 16
_ANGLES = np.linspace(0.0, 2.0 * np.pi, _RING_POINTS, endpoint=False)

_FOREARM = [
    *((-0.1, 0.6), (0.0, 1.05), (0.25, 1.15), (0.62, 0.85), (0.72, 0.75)),
    *((0.8, 1.0), (0.92, 1.0), (1.0, 0.6)),
]
"""Profile of forearm and fist: place along it, factor on its radius."""

SKIN, SHIRT, TROUSERS = 125, 70, 45
"""Brightness of the parts, grey levels."""


class VolumePart(NamedTuple):
    """Rings (n, 16, 3) in the reference frame, metres, and a brightness."""

    rings: FloatArray
    brightness: int


def person_parts(body: BodyModel, posture: FloatArray) -> list[VolumePart]:
    """Return the parts of ``body`` in ``posture`` (12,)."""
    frames = forward_kinematics(body, posture)
    shapes = body_parts(body.sizes)
    parts = [*_legs(body, frames)]
    parts += [_trunk(body, frames), _neck(body, frames), _head(body, frames)]
    for arm in (frames.left, frames.right):
        parts.append(
            _tube(
                arm.shoulder,
                arm.elbow,
                [(-0.12, 0.5), (-0.06, 0.95), (0.1, 1.12), (0.5, 1.0), (1.0, 0.88), (1.06, 0.6)],
                shapes.upper_arm.top_width_m / 2,
                SHIRT,
            )
        )
        parts.append(_tube(arm.elbow, arm.hand, _FOREARM, shapes.forearm.top_width_m / 2, SKIN))
    return parts


def random_body(rng: np.random.Generator, distance_m: float = 2.0) -> BodyModel:
    """Return a person of random stature (1.55 to 1.9 m) and proportions."""
    stature = rng.uniform(0.9, 1.1)
    sizes = DEFAULT_SIZES * stature * rng.normal(1.0, 0.07, len(DEFAULT_SIZES))
    return BodyModel.of(
        np.clip(sizes, SIZE_LIMITS[:, 0], SIZE_LIMITS[:, 1]),
        distance_m=distance_m,
        hip_height_m=-0.51 * distance_m / 2.0,
    )


def _trunk(body: BodyModel, frames: BodyFrames) -> VolumePart:
    parts = body_parts(body.sizes)
    waist, torso = parts.waist, parts.torso
    height = torso.top_m - torso.bottom_m
    wide, deep = torso.top_width_m, torso.depth_m
    # Height, half width and half depth of each ring.
    profile = [
        (-0.06, 0.5 * waist.top_width_m, 0.46 * waist.depth_m),
        (0.3 * waist.top_m, 0.51 * waist.top_width_m, 0.5 * waist.depth_m),
        (torso.bottom_m, 0.49 * torso.bottom_width_m, 0.48 * deep),
        (torso.bottom_m + 0.55 * height, 0.48 * wide, 0.5 * deep),
        (torso.bottom_m + 0.85 * height, 0.5 * wide, 0.44 * deep),
        (torso.top_m, 0.4 * wide, 0.3 * deep),
        (torso.top_m + 0.3 * parts.neck.height_m, 0.2 * wide, 0.25 * deep),
    ]
    return VolumePart(_rings(profile, frames.torso_rotation, frames.hip), SHIRT)


def _neck(body: BodyModel, frames: BodyFrames) -> VolumePart:
    parts = body_parts(body.sizes)
    radius = 0.34 * parts.head.top_width_m
    profile = [
        (parts.torso.top_m - 0.03, radius, radius),
        (parts.head.bottom_m + 0.05, radius, radius),
    ]
    origin = frames.hip + frames.torso_rotation @ (parts.neck.forward_m, 0.0, 0.0)
    return VolumePart(_rings(profile, frames.torso_rotation, origin), SKIN)


def _head(body: BodyModel, frames: BodyFrames) -> VolumePart:
    head = body_parts(body.sizes).head
    half = head.height_m / 2
    angles = np.radians([-80, -55, -25, 5, 35, 60, 80])
    profile = [
        (
            half * np.sin(angle),
            np.cos(angle) * head.top_width_m / 2,
            np.cos(angle) * head.depth_m / 2,
        )
        for angle in angles
    ]
    return VolumePart(_rings(profile, frames.torso_rotation, frames.head), SKIN)


def _legs(body: BodyModel, frames: BodyFrames) -> list[VolumePart]:
    """Two legs that stand straight below the hips and only turn with them."""
    parts = body_parts(body.sizes)
    aside = parts.waist.bottom_width_m / 4
    radius = 0.98 * aside
    length = 1.6 * parts.torso.top_m
    across = frames.torso_rotation[:, 1] * (1.0, 1.0, 0.0)
    across /= np.linalg.norm(across)
    down = np.array([0.0, 0.0, -length])
    legs = []
    for side in (-1.0, 1.0):
        hip = frames.hip + side * aside * across
        foot = frames.hip + 1.4 * side * aside * across + down
        legs.append(
            _tube(hip, foot, [(-0.05, 0.9), (0.1, 1.0), (0.5, 0.7), (1.0, 0.45)], radius, TROUSERS)
        )
    return legs


def _tube(
    start: FloatArray,
    end: FloatArray,
    profile: list[tuple[float, float]],
    radius_m: float,
    brightness: int,
) -> VolumePart:
    """Round part from ``start`` to ``end``; ``profile`` has (place along it, factor on radius)."""
    axis = end - start
    length = float(np.linalg.norm(axis))
    z = axis / length
    helper = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    y = np.cross(z, helper)
    y /= np.linalg.norm(y)
    rotation = np.column_stack([np.cross(y, z), y, z])
    rings = [(t * length, f * radius_m, f * radius_m) for t, f in profile]
    return VolumePart(_rings(rings, rotation, start), brightness)


def _rings(
    profile: list[tuple[float, float, float]], rotation: FloatArray, origin: FloatArray
) -> FloatArray:
    """Rings (n, 16, 3) from (height along Z, half extent along Y, half extent along X)."""
    height, half_y, half_x = np.array(profile).T[..., None]
    rings = np.empty((len(height), _RING_POINTS, 3))
    rings[..., 0] = half_x * np.cos(_ANGLES)
    rings[..., 1] = half_y * np.sin(_ANGLES)
    rings[..., 2] = height
    placed: FloatArray = rings @ rotation.T + origin
    return placed
