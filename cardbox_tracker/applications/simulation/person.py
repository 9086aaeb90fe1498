"""A synthetic person with rounded body parts; :func:`person_frames` gives the true skeleton.

Each part is the convex hull of neighbouring elliptical rings, which roughly follow the sizes of a
:class:`BodyModel`: limbs taper, the torso narrows at waist and shoulders, and there are a neck,
open hands and legs. Shoulders rise with the arms. So the cardbox model never matches exactly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.person.kinematics import PosedBodies, pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.skeleton import POINT_NAMES

FloatArray = NDArray[np.float64]

_RING_POINTS = 16
_ANGLES = np.linspace(0.0, 2.0 * np.pi, _RING_POINTS, endpoint=False)

FINGER_REACH = 0.247
"""Length of open fingers beyond the knuckles, divided by the distance from elbow to knuckles:
mean of rendered bodies. The value of de Leva, "Adjustments to Zatsiorsky-Seluyanov's Segment
Inertia Parameters", 1996, is 0.28."""

_FOREARM = [
    *((-0.1, 0.6), (0.0, 1.05), (0.25, 1.15), (0.62, 0.85), (0.72, 0.75)),
    *((0.8, 0.95), (0.92, 1.0), (1.0, 0.9)),
    *((1.0 + 0.5 * FINGER_REACH, 0.6), (1.0 + FINGER_REACH, 0.25)),
]
"""Profile of forearm, palm and fingers: position along the axis, factor of the radius. The
keypoint of the hand is at 1, where the fingers begin."""

# Shoulder rhythm: beyond the setting angle, the clavicle rises by a fraction of the arm's elevation
# (Inman, Saunders & Abbott, "Observations on the Function of the Shoulder Joint", 1944, rounded).
_CLAVICLE_OF_BREADTH, _CLAVICLE_RISE, _SETTING_RAD = 0.43, 0.18, np.radians(30.0)

_LEFT, _RIGHT = POINT_NAMES.index("left_shoulder"), POINT_NAMES.index("right_shoulder")

SKIN, SHIRT, TROUSERS = 125, 70, 45
"""Brightness of the parts, grey levels."""


class VolumePart(NamedTuple):
    """Rings (n, 16, 3) in the reference frame, metres, and a brightness in grey levels."""

    rings: FloatArray
    brightness: int


def person_parts(body: BodyModel, posture: FloatArray) -> list[VolumePart]:
    """Return the parts of ``body`` in ``posture`` (12,)."""
    frames = person_frames(body, posture)
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


def person_frames(body: BodyModel, postures: FloatArray) -> PosedBodies:
    """Return frames (...) of a person in postures (..., 12), whose shoulders rise with the arms.

    They are in the reference frame; postures are in rad and metres.
    """
    frames = pose(body.rigid, postures)
    up = frames.torso_rotation[..., 2]
    points_m = frames.points_m.copy()
    for arm, first in ((frames.left, _LEFT), (frames.right, _RIGHT)):
        along = np.sum(up * arm.upper_arm_rotation[..., 2], axis=-1)
        elevation_rad = np.arccos(np.clip(along, -1.0, 1.0))
        lift_m = girdle_lift_m(body.size("shoulder_breadth"), elevation_rad)[..., None] * up
        points_m[..., first : first + 3, :] += lift_m[..., None, :]
    return frames._replace(points_m=points_m)


def girdle_lift_m(breadth_m: float, elevation_rad: FloatArray) -> FloatArray:
    """Return the lift (...) of a shoulder joint along the torso's axis, metres.

    ``breadth_m`` is that of shoulders with hanging arms, ``elevation_rad`` (...) the angle between
    the upper arm and the downward axis of the torso.
    """
    rise_rad = _CLAVICLE_RISE * np.maximum(0.0, np.asarray(elevation_rad) - _SETTING_RAD)
    lift: FloatArray = _CLAVICLE_OF_BREADTH * breadth_m * np.sin(rise_rad)
    return lift


def _trunk(body: BodyModel, frames: PosedBodies) -> VolumePart:
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


def _neck(body: BodyModel, frames: PosedBodies) -> VolumePart:
    parts = body_parts(body.sizes)
    radius = 0.34 * parts.head.top_width_m
    profile = [
        (parts.torso.top_m - 0.03, radius, radius),
        (parts.head.bottom_m + 0.05, radius, radius),
    ]
    origin = frames.hip + frames.torso_rotation @ (parts.neck.forward_m, 0.0, 0.0)
    return VolumePart(_rings(profile, frames.torso_rotation, origin), SKIN)


def _head(body: BodyModel, frames: PosedBodies) -> VolumePart:
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


def _legs(body: BodyModel, frames: PosedBodies) -> list[VolumePart]:
    """Return two vertical legs below the hips; they follow only the yaw of the hips."""
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
    """Return a round part; ``profile`` has (fraction of the length, factor of the radius)."""
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
    """Return rings (n, 16, 3) from (height along Z, half extent along Y, half extent along X)."""
    height, half_y, half_x = np.array(profile).T[..., None]
    rings = np.empty((len(height), _RING_POINTS, 3))
    rings[..., 0] = half_x * np.cos(_ANGLES)
    rings[..., 1] = half_y * np.sin(_ANGLES)
    rings[..., 2] = height
    placed: FloatArray = rings @ rotation.T + origin
    return placed
