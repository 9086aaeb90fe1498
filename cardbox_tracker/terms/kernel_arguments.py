"""Body and camera as arguments of the kernels, computed once.

Python passes plain tuples, because numba unpacks them several times faster than named ones; the
kernels name the fields again with :func:`body_of` and :func:`cardbox_of`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.compiling import copied_kernel
from cardbox_tracker.person.kinematics import Place, girdle_of
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import BOTTOM, FOREARM, HEAD, HEIGHT, NECK, WAIST, shape_of
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig

# Overlap of neck and head, as a fraction of the head's height: an outline has no gap below the jaw.
_NECK_INTO_HEAD = 0.25

Floats = NDArray[np.float64]
Whole = NDArray[np.int32]
Counts = NDArray[np.int64]


class Intrinsics(NamedTuple):
    """A camera: focal lengths and principal point, px, and cosine and sine of its pitch."""

    fx: float
    fy: float
    cx: float
    cy: float
    cos_pitch: float
    sin_pitch: float


class Cardbox(NamedTuple):
    """A cardbox model before a camera."""

    parts: Floats  #: six lengths of six parts, (6, 6), metres; (N, 6, 6) for N bodies
    #: the shoulder joint in the torso's frame, aside and upwards, (2,), metres; (N, 2).
    shoulder: Floats
    place: Place  #: place of the hips
    camera: Intrinsics  #: intrinsics and pitch of the camera


class Body(NamedTuple):
    """A whole body with a shoulder girdle before a camera."""

    parts: Floats  #: the measured parts, (6, 6), metres
    drawn: Floats  #: the parts whose outlines are drawn, with a longer waist, neck and forearm
    girdle: Floats  #: shoulder joints and how they rise with the arms, (3,)
    place: Place  #: place of the hips
    camera: Intrinsics  #: intrinsics and pitch of the camera


IntrinsicsTuple = tuple[float, float, float, float, float, float]
PlaceTuple = tuple[float, float]
CardboxTuple = tuple[Floats, Floats, PlaceTuple, IntrinsicsTuple]
BodyTuple = tuple[Floats, Floats, Floats, PlaceTuple, IntrinsicsTuple]
Drawn = tuple[bool, bool, bool]
"""Whether trunk, left arm and right arm are drawn, in this order."""


@copied_kernel
def cardbox_of(fields: CardboxTuple) -> Cardbox:
    """Return a cardbox model with its fields named."""
    parts, shoulder, place, camera = fields
    return Cardbox(parts, shoulder, Place(*place), Intrinsics(*camera))


@copied_kernel
def body_of(fields: BodyTuple) -> Body:
    """Return a body with its fields named."""
    parts, drawn, girdle, place, camera = fields
    return Body(parts, drawn, girdle, Place(*place), Intrinsics(*camera))


def intrinsics_of(camera: Camera) -> IntrinsicsTuple:
    """Return the fields of :class:`Intrinsics` of ``camera``."""
    pitch = camera.pitch_rad
    intrinsics = (float(camera.fx), float(camera.fy), float(camera.cx), float(camera.cy))
    return (*intrinsics, float(np.cos(pitch)), float(np.sin(pitch)))


def place_of(body: BodyModel) -> PlaceTuple:
    """Return the fields of :class:`Place` of ``body``."""
    return float(body.placement.distance_m), float(body.placement.hip_height_m)


def body_tuple(
    body: BodyModel, camera: Camera, config: WholeBodyCostConfig | None = None
) -> BodyTuple:
    """Return the fields of :class:`Body` of a body before a camera."""
    config = config or WholeBodyCostConfig()
    parts, _ = shape_of(body.sizes, config.neck_to_head)
    drawn = _drawn_parts(parts, config)
    return parts, drawn, girdle_of(body), place_of(body), intrinsics_of(camera)


def _drawn_parts(parts: Floats, config: WholeBodyCostConfig) -> Floats:
    """Return the parts (6, 6) whose outlines are drawn."""
    drawn = parts.copy()
    drawn[WAIST, BOTTOM] -= config.waist_extension_m
    drawn[WAIST, HEIGHT] += config.waist_extension_m
    into_m = _NECK_INTO_HEAD * parts[HEAD, HEIGHT]
    drawn[NECK, HEIGHT] += into_m
    drawn[FOREARM, HEIGHT] += config.fingers_m
    return drawn
