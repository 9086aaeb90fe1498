"""Computes the shapes of the body's parts and the places of its joints from the 18 sizes.

Every part is a box or frustum in a frame of its own: X forwards, Y to the person's left, Z up,
metres. Torso, waist, neck and head share the torso's frame, whose origin is the middle of the hips.
The origin of an upper arm is the shoulder joint, that of a forearm the elbow joint; both hang down
along -Z.

All representations of a body use these shapes: the patches, the boxes of the volumetric model, the
URDFs, the simulated person and, through the patches, the compiled cost.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from cardbox_tracker.person.sizes import SIZE_INDEX, FloatArray

# Rows of the lengths of :func:`shape_of`, ordered as ``BodyParts``, and columns, as ``Part``.
TORSO, WAIST, NECK, HEAD, UPPER_ARM, FOREARM = 0, 1, 2, 3, 4, 5
BOTTOM, HEIGHT, BOTTOM_WIDTH, TOP_WIDTH, DEPTH, FORWARD = 0, 1, 2, 3, 4, 5

Length = TypeVar("Length", float, FloatArray)
"""Metres: a number for one body, an array (...) for many."""


class Part(NamedTuple, Generic[Length]):
    """Extent of one part in its frame, metres; it is symmetric to the plane of X and Z."""

    bottom_m: Length
    """Z coordinate of its bottom."""
    height_m: Length
    bottom_width_m: Length
    """Width along Y at its bottom."""
    top_width_m: Length
    """Width along Y at its top."""
    depth_m: Length
    """Depth along X."""
    forward_m: Length
    """X coordinate of its axis."""

    @property
    def top_m(self) -> Length:
        """Z coordinate of its top."""
        return self.bottom_m + self.height_m

    @property
    def middle_m(self) -> Length:
        """Z coordinate of its centre."""
        return self.bottom_m + self.height_m / 2

    @property
    def mean_width_m(self) -> Length:
        """Mean width, for shapes that are not trapezoids."""
        return (self.top_width_m + self.bottom_width_m) / 2


class BodyParts(NamedTuple, Generic[Length]):
    """All parts and the places of the shoulder joints; both arms are alike.

    The middle of the torso's top is ``torso.top_m``, the chin ``head.bottom_m``, the crown
    ``head.top_m``; an arm's part ends at minus its ``height_m``.
    """

    torso: Part[Length]
    waist: Part[Length]
    neck: Part[Length]
    head: Part[Length]
    upper_arm: Part[Length]
    forearm: Part[Length]
    shoulder_aside_m: Length
    """Distance of a shoulder joint from the plane of X and Z of the torso's frame."""
    shoulder_height_m: Length
    """Height of the shoulder joints along Z of the torso's frame."""


def body_parts(sizes_m: FloatArray, neck_to_head: float = 0.0) -> BodyParts[float]:
    """Return the parts of one body, with a neck of a fraction of the head's width, or without."""
    return _parts(np.asarray(sizes_m).tolist(), neck_to_head)


def parts_of_bodies(sizes_m: FloatArray, neck_to_head: float = 0.0) -> BodyParts[FloatArray]:
    """Return the parts of many bodies (..., 18) at once, every length of shape (...)."""
    return _parts(list(np.moveaxis(np.asarray(sizes_m), -1, 0)), neck_to_head)


def shape_of(sizes_m: FloatArray, neck_to_head: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Return parts and shoulders of bodies with sizes (..., 18), metres.

    They are the six lengths of each :class:`Part`, (..., 6, 6), ordered as in :class:`BodyParts`,
    and the lateral and vertical coordinate of a shoulder joint in the torso's frame, (..., 2).
    ``neck_to_head`` is the width of the neck as a fraction of the head's, 0 for none.
    """
    # Python adds numbers of one body several times faster than NumPy.
    of = body_parts if np.ndim(sizes_m) == 1 else parts_of_bodies
    *parts, aside, height = of(sizes_m, neck_to_head)
    lengths = np.array([length for part in parts for length in part])
    # Each body's lengths become contiguous.
    bodies = np.ascontiguousarray(lengths.T).reshape(*np.shape(sizes_m)[:-1], len(parts), -1)
    return bodies, np.ascontiguousarray(np.array([aside, height]).T)


def _parts(sizes: Sequence[Length], neck_to_head: float) -> BodyParts[Length]:
    def size(name: str) -> Length:
        return sizes[SIZE_INDEX[name]]

    middle = 0.0 * sizes[0]

    def limb(name: str) -> Part[Length]:
        length, width = size(f"{name}_length"), size(f"{name}_width")
        return Part(-length, length, width, width, width, middle)

    torso = Part(
        size("waist_height"),
        size("torso_height"),
        size("torso_bottom_width"),
        size("torso_top_width"),
        size("torso_depth"),
        middle,
    )
    hips_width, hips_depth = size("waist_width"), size("waist_depth")
    waist = Part(middle, size("waist_height"), hips_width, hips_width, hips_depth, middle)
    head_width, forward = size("head_width"), size("head_offset")
    # A neck leads from the torso's axis to the head's.
    width = neck_to_head * head_width
    neck = Part(torso.top_m, size("neck_length"), width, width, width, forward / 2)
    head = Part(
        neck.top_m, size("head_height"), head_width, head_width, size("head_depth"), forward
    )
    return BodyParts(
        torso,
        waist,
        neck,
        head,
        limb("upper_arm"),
        limb("forearm"),
        size("shoulder_breadth") / 2,
        torso.top_m - size("shoulder_drop"),
    )
