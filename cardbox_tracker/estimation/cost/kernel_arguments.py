"""A body and a camera as the kernels take them: plain numbers, computed once."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.parts import parts_of_bodies
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.kernels import PlaceTuple, ViewTuple
from cardbox_tracker.vision.camera import Camera


def view_of(camera: Camera) -> ViewTuple:
    """Return ``camera`` as the fields of :class:`~cardbox_tracker.estimation.cost.kernels.View`."""
    pitch = camera.pitch_rad
    intrinsics = (float(camera.fx), float(camera.fy), float(camera.cx), float(camera.cy))
    return (*intrinsics, float(np.cos(pitch)), float(np.sin(pitch)))


def place_of(body: BodyModel) -> PlaceTuple:
    """Return the fields of :class:`~cardbox_tracker.estimation.cost.kernels.Place`."""
    return float(body.placement.distance_m), float(body.placement.hip_height_m)


def shape_of(sizes_m: FloatArray, neck_to_head: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Return parts and shoulders of one or many bodies, metres.

    Args:
        sizes_m: shape (..., 18).
        neck_to_head: width of the neck as a fraction of the head's; 0, as in the paper, draws none.

    Returns:
        Shape (..., 6, 6): the six lengths of each :class:`~cardbox_tracker.body.parts.Part`, the
        parts ordered as in :class:`~cardbox_tracker.body.parts.BodyParts`; and (..., 2): how far
        aside and how high a shoulder joint is in the torso's frame.
    """
    *parts, aside, height = parts_of_bodies(sizes_m, neck_to_head)
    lengths = np.array([length for part in parts for length in part])
    # Lengths were rows, one body after the other; now each body's lengths lie together.
    bodies = np.ascontiguousarray(lengths.T).reshape(*np.shape(sizes_m)[:-1], len(parts), -1)
    return bodies, np.ascontiguousarray(np.array([aside, height]).T)
