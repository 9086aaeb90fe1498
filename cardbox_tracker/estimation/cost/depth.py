"""Term of the cost that compares the model's visible surface with a depth image.

An outline hardly constrains the distance of a part. A depth image (of a depth camera, or of a
rectified pair, :mod:`cardbox_tracker.vision.stereo`) measures it. The term compares both at points
of trunk, head and limbs inside the silhouette, see
:mod:`cardbox_tracker.estimation.cost.depth_kernels`. The cost saturates for differences far beyond
``unit_m``. Without a depth image the term is zero.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.parts import (
    BOTTOM_WIDTH,
    FOREARM,
    HEAD,
    HEIGHT,
    TOP_WIDTH,
    UPPER_ARM,
    WAIST,
)
from cardbox_tracker.body.parts import TORSO as TORSO_PART
from cardbox_tracker.body.posture import N_STATE, PLACE, POSTURE, TORSO
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost import depth_kernels as kernels
from cardbox_tracker.estimation.cost.inner_cue_arms import torsos_of
from cardbox_tracker.estimation.cost.kernel_arguments import Drawn
from cardbox_tracker.estimation.cost.terms import (
    ARMS,
    ArmCosts,
    DepthImage,
    Frame,
    Silence,
    Term,
    TermObservation,
    TorsoCosts,
)
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.settings import Settings, setting
from cardbox_tracker.vision.array_checks import ANY, check_array
from cardbox_tracker.vision.camera import Camera

_SILENCE = Silence()


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

    def build(self, body: BodyModel, camera: Camera) -> Term:
        """Return the term for a measured person and a working camera."""
        return DepthTerm(self, body, camera)


class DepthTerm:
    """The term for one person and one camera.

    Attributes:
        body_px: largest cost of a whole body, px.
    """

    def __init__(self, config: Depth, body: BodyModel, camera: Camera) -> None:
        """Prepare for one body and one camera, and compile the kernel if necessary."""
        self.config = config
        self._size = camera.height, camera.width
        model = WholeBodyCost(body, camera, WholeBodyCostConfig())
        self.body = model.body
        # Areas at the place of the body model, so that a nearer state has no advantage.
        per_m = camera.fx / body.placement.distance_m
        parts = model.parts[[TORSO_PART, WAIST, HEAD, UPPER_ARM, FOREARM]]
        wide = 0.5 * (parts[:, BOTTOM_WIDTH] + parts[:, TOP_WIDTH])
        areas_px = config.weight * per_m**2 * parts[:, HEIGHT] * wide
        self.areas_px = np.ascontiguousarray(areas_px)
        # The areas of the limbs count for both arms.
        self.body_px = float(areas_px[:3].sum() + 2.0 * areas_px[3:].sum())
        self.costs(np.zeros((1, N_STATE)), np.zeros(self._size, np.float32))

    def observe(self, frame: Frame) -> TermObservation:
        """Return the term's observation, which is zero without a depth image."""
        if frame.depth_m is None:
            return _SILENCE
        # Pixels at the outline can show the person or the background.
        inside = cv2.erode(frame.silhouette, np.ones((3, 3), np.uint8))
        known = (inside > 0) & np.isfinite(frame.depth_m)
        return DepthObservation(self, np.where(known, frame.depth_m, 0.0).astype(np.float32))

    def costs(
        self,
        states: FloatArray,
        depth_m: DepthImage,
        drawn: Drawn = (True, True, True),
    ) -> FloatArray:
        """Return the costs (N,), px, of some parts of states (N, 14).

        Raises:
            ValueError: the shape of an array is another one.
        """
        check_array("states", states, (ANY, N_STATE), np.float64)
        check_array("depth_m", depth_m, self._size, np.float32)
        costs = np.empty(len(states))
        kernels.depth_costs(
            np.ascontiguousarray(states, dtype=np.float64),
            drawn,
            self.body,
            (depth_m, self.areas_px, self.config.unit_m, self.config.expected),
            costs,
        )
        return costs


@dataclass(frozen=True, eq=False)
class DepthObservation:
    """The depth of one frame; see :class:`~cardbox_tracker.estimation.cost.terms.TermObservation`.

    Attributes:
        term: the term of the person.
        depth_m: (H, W), metres along the optical axis; 0 if unknown.
    """

    term: DepthTerm
    depth_m: DepthImage

    def torsos_beside(self, arms: FloatArray | None) -> TorsoCosts:
        """Rate trunk and head alone."""

        def costs(torsos: FloatArray) -> FloatArray:
            return self.term.costs(_states(torsos), self.depth_m, (True, False, False))

        return costs

    def arms_beside(self, torso: FloatArray) -> ArmCosts:
        """Rate arms of a body whose torso is at ``torso``."""

        def costs(side: str, arms: FloatArray) -> FloatArray:
            states = _states(np.tile(torso, (len(arms), 1)))
            states[:, ARMS[side]] = arms
            is_left = side == "left"
            return self.term.costs(states, self.depth_m, (False, is_left, not is_left))

        return costs

    def postures(self, postures: FloatArray) -> FloatArray:
        """Rate whole bodies."""
        states = _states(torsos_of(postures))
        states[:, POSTURE] = postures[:, POSTURE]
        return self.term.costs(states, self.depth_m)


def _states(torsos: FloatArray) -> FloatArray:
    """Return states (N, 14) of torsos (N, 4), or (N, 6) with x and z; the arms are zero."""
    states = np.zeros((len(torsos), N_STATE))
    places = torsos[:, TORSO.stop :]
    states[:, TORSO] = torsos[:, TORSO]
    states[:, PLACE.start : PLACE.start + places.shape[1]] = places
    return states
