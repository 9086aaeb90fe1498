"""Term of the cost that compares the model's visible surface with a depth image.

An outline hardly constrains the distance of a part. A depth image (of a depth camera, or of a
rectified pair, :mod:`cardbox_tracker.camera.stereo`) measures it. The term compares both at points
of trunk, head and limbs inside the silhouette, see
:mod:`cardbox_tracker.terms.depth_kernels`. The cost saturates for differences far beyond
``unit_m``. Without a depth image the term is zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.array_checks import ANY, check_array
from cardbox_tracker.common.settings import Settings, setting
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import (
    BOTTOM_WIDTH,
    FOREARM,
    HEAD,
    HEIGHT,
    TOP_WIDTH,
    UPPER_ARM,
    WAIST,
    shape_of,
)
from cardbox_tracker.person.parts import TORSO as TORSO_PART
from cardbox_tracker.person.posture import N_STATE
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms import depth_kernels as kernels
from cardbox_tracker.terms.term import Frame, Posed, Term, TermObservation


@dataclass(frozen=True)
class Depth(Settings):
    """Settings of the term for depth images."""

    weight: float = setting(
        1.0,
        "weight of a pixel with a quite different depth, in pixels of the outline",
        limits=(0.0, 100.0),
    )
    unit_m: float = setting(
        0.1,
        "difference of depths that costs half of this weight",
        unit="m",
        limits=(0.001, 1.0),
    )
    # It makes points without a measured depth as good as average points.
    expected: float = setting(0.3, "mean cost of a point, which is subtracted", limits=(0.0, 1.0))

    def build(self, person: BodyModel, camera: Camera) -> Term:
        """Return the term for a person before a working camera."""
        return DepthTerm(self, person, camera)


class DepthTerm:
    """The term for one person and one camera, of at most ``body_px`` for a whole body."""

    def __init__(self, config: Depth, person: BodyModel, camera: Camera) -> None:
        """Prepare for one person and one camera."""
        self.config = config
        parts, _ = shape_of(person.sizes)
        # Areas at the place of the body model, so that a nearer state has no advantage.
        per_m = camera.fx / person.placement.distance_m
        parts = parts[[TORSO_PART, WAIST, HEAD, UPPER_ARM, FOREARM]]
        wide = 0.5 * (parts[:, BOTTOM_WIDTH] + parts[:, TOP_WIDTH])
        areas_px = config.weight * per_m**2 * parts[:, HEIGHT] * wide
        self._areas_px = np.ascontiguousarray(areas_px)
        # The areas of the limbs count for both arms.
        self.body_px = float(areas_px[:3].sum() + 2.0 * areas_px[3:].sum())

    def observe(self, frame: Frame) -> TermObservation | None:
        """Return the term's observation; None without a depth image."""
        if frame.depth_m is None:
            return None
        # Pixels at the outline can show the person or the background.
        inside = cv2.erode(frame.silhouette, np.ones((3, 3), np.uint8))
        known = (inside > 0) & np.isfinite(frame.depth_m)
        depth_m = np.where(known, frame.depth_m, 0.0).astype(np.float32)
        return DepthObservation((depth_m, self._areas_px, self.config.unit_m, self.config.expected))


@dataclass(frozen=True, eq=False)
class DepthObservation(TermObservation):
    """The depth of one frame."""

    surface: kernels.SurfaceTuple  #: fields of :class:`~.depth_kernels.Surface`

    def rate(self, posed: Posed) -> FloatArray:
        """Rate the visible surface of the parts that count."""
        check_array("states", posed.states, (ANY, N_STATE), np.float64)
        costs = np.empty(len(posed))
        states = np.ascontiguousarray(posed.states)
        kernels.depth_costs(states, posed.parts, posed.body, self.surface, costs)
        return costs
