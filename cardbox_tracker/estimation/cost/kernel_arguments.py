"""Body and camera as arguments of the kernels, computed once.

Python passes plain tuples, because numba unpacks them several times faster than named ones; the
kernels name the fields again with :func:`body_of` and :func:`cardbox_of`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.parts import parts_of_bodies
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.compiling import copied_kernel
from cardbox_tracker.vision.camera import Camera

Floats = NDArray[np.float64]
Whole = NDArray[np.int32]
Counts = NDArray[np.int64]

# Rows of ``parts`` and ``drawn`` (6, 6), ordered as ``BodyParts`` of body/parts.py.
TORSO, WAIST, NECK, HEAD, UPPER_ARM, FOREARM = 0, 1, 2, 3, 4, 5
# Columns of these arrays, ordered as ``Part``, metres.
BOTTOM, HEIGHT, BOTTOM_WIDTH, TOP_WIDTH, DEPTH, FORWARD = 0, 1, 2, 3, 4, 5

# Values of ``girdle`` (5,): shoulder joint of a hanging arm in the torso's frame, and radius of the
# circle of its lift, m; lift per elevation, rad/rad; elevation at which the lift begins, rad.
ASIDE, UPWARDS, CLAVICLE, LIFT_GAIN, LIFT_FROM = 0, 1, 2, 3, 4


class Intrinsics(NamedTuple):
    """A camera: focal lengths and principal point, px, and cosine and sine of its pitch."""

    fx: float
    fy: float
    cx: float
    cy: float
    cos_pitch: float
    sin_pitch: float


class Place(NamedTuple):
    """The middle of the hips in the reference frame: (-distance, d1, height), metres."""

    distance_m: float
    hip_height_m: float


class Cardbox(NamedTuple):
    """A cardbox model before a camera.

    Attributes:
        parts: six lengths of six parts, (6, 6), metres; (N, 6, 6) for N bodies.
        shoulder: the shoulder joint in the torso's frame, aside and upwards, (2,), metres; (N, 2).
        place: place of the hips.
        camera: intrinsics and pitch of the camera.
    """

    parts: Floats
    shoulder: Floats
    place: Place
    camera: Intrinsics


class Body(NamedTuple):
    """A whole body with a shoulder girdle before a camera.

    Attributes:
        parts: the measured parts, (6, 6), metres.
        drawn: the parts whose outlines are drawn, with a longer waist, neck and forearm.
        girdle: shoulder joints and how the arms lift them, (5,).
        place: place of the hips.
        camera: intrinsics and pitch of the camera.
    """

    parts: Floats
    drawn: Floats
    girdle: Floats
    place: Place
    camera: Intrinsics


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


def shape_of(sizes_m: FloatArray, neck_to_head: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Return parts and shoulders of one or many bodies, metres.

    Args:
        sizes_m: shape (..., 18).
        neck_to_head: width of the neck as a fraction of the head's; 0, as in the paper, draws none.

    Returns:
        The six lengths of each :class:`~cardbox_tracker.body.parts.Part`, (..., 6, 6), the parts
        ordered as in :class:`~cardbox_tracker.body.parts.BodyParts`; and the lateral and vertical
        coordinate of a shoulder joint in the torso's frame, (..., 2).
    """
    *parts, aside, height = parts_of_bodies(sizes_m, neck_to_head)
    lengths = np.array([length for part in parts for length in part])
    # Each body's lengths become contiguous.
    bodies = np.ascontiguousarray(lengths.T).reshape(*np.shape(sizes_m)[:-1], len(parts), -1)
    return bodies, np.ascontiguousarray(np.array([aside, height]).T)
