"""The cost of a posture: a sum of terms, each in pixels of the image.

A tracker's cost is the silhouette's term (paper, equation (2)) and any further ones. A
:class:`Term` is made once for a body before a camera. For each frame its :meth:`~Term.observe`
returns a :class:`TermObservation`, the evidence of the term in this frame. An observation is
constant, so several filters and threads may use it at the same time.

A hierarchical filter first rates torsos and then arms beside the torso that it has found. So an
observation has three methods:

    observation.torsos_beside(arms)(torsos)         (N, 4) -> (N,)    the arms are fixed
    observation.arms_beside(torso)(side, arms)      (N, 4) -> (N,)    the torso is fixed
    observation.postures(postures)                  (N, 12) -> (N,)

The first call of the first two methods computes the values that all particles share. The whole-body
filter also estimates ``torso_x`` and ``torso_z``. It rates torsos without arms, and appends these
two values to torsos, (N, 6) or (6,), and to postures, (N, 14). So a term reads d1..d4 and d1..d12
by index and uses the last two values if they are given. A new term is one
new file with a settings class, see ``docs/extending.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import LEFT_ARM, RIGHT_ARM
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.detection.image_points import ImagePoints
from cardbox_tracker.vision.camera import Camera

Silhouette = NDArray[np.uint8]
Image = NDArray[np.uint8]
DepthImage = NDArray[np.float32]

USUAL_INTERVAL_S = 1.0 / 15.0
"""Interval between frames without stamps, s."""

ARMS = {"left": LEFT_ARM, "right": RIGHT_ARM}
"""Slice of each arm's joints in a posture."""

TorsoCosts = Callable[[FloatArray], FloatArray]
"""Takes torsos d1..d4, (N, 4), rad and metres; returns costs (N,), px."""

ArmCosts = Callable[[str, FloatArray], FloatArray]
"""Takes ``left`` or ``right`` and that arm's joints, (N, 4), rad; returns costs (N,), px."""


@dataclass(frozen=True)
class Frame:
    """The data of one camera at one time, prepared for filter and terms.

    Attributes:
        silhouette: (H, W), 0 or 255, of the camera's size; do not write to it.
        rows: number of rows that count, from the top to the hips.
        foreground_px: foreground pixels in those rows.
        image: (H, W) grey or (H, W, 3) bgr of the same frame, undistorted; None without one.
        posture: state of the previous frame, (12,) or with ``torso_x`` and ``torso_z`` (14,), rad
            and metres; None at the start of tracking.
        depth_m: (H, W), metres along the optical axis; unknown depths are 0 or not finite; None
            without a depth image.
        interval_s: time since the previous frame, s.
        stamp_ns: time of the frame, ns; None if it is unknown.
        points: the person's joints in the image, from a detector; None without one.
    """

    silhouette: Silhouette
    rows: int
    foreground_px: int
    image: Image | None = None
    posture: FloatArray | None = None
    depth_m: DepthImage | None = None
    interval_s: float = USUAL_INTERVAL_S
    stamp_ns: int | None = None
    points: ImagePoints | None = None

    def with_foreground(self, foreground_px: int) -> Frame:
        """Return the frame with other foreground pixels, faster than ``dataclasses.replace``."""
        whole = self.image, self.posture, self.depth_m, self.interval_s, self.stamp_ns, self.points
        return Frame(self.silhouette, self.rows, foreground_px, *whole)


class TermObservation(Protocol):
    """The evidence of one term in one frame; all costs are in pixels, float64."""

    def torsos_beside(self, arms: FloatArray | None) -> TorsoCosts:
        """Return the function that rates torsos.

        Args:
            arms: posture (12,) whose arms keep their place in the image while the torsos move; None
                to rate torsos without arms.
        """

    def arms_beside(self, torso: FloatArray) -> ArmCosts:
        """Return the function that rates arms beside the torso ``torso``, (4,) or (6,)."""

    def postures(self, postures: FloatArray) -> FloatArray:
        """Return the costs (N,) of whole postures, (N, 12) or (N, 14)."""


class Term(Protocol):
    """One summand of the cost of a posture."""

    def observe(self, frame: Frame) -> TermObservation:
        """Return the observation of ``frame``."""


class TermSettings(Protocol):
    """The settings of a term, an element of ``TrackerConfig.terms``."""

    def build(self, body: BodyModel, camera: Camera) -> Term:
        """Return the term for a measured person and a working camera."""


class Silence:
    """A term, and its observation, with zero costs."""

    def observe(self, frame: Frame) -> TermObservation:
        """See :class:`Term`."""
        return self

    def torsos_beside(self, arms: FloatArray | None) -> TorsoCosts:
        """See :class:`TermObservation`."""
        return self.postures

    def arms_beside(self, torso: FloatArray) -> ArmCosts:
        """See :class:`TermObservation`."""
        return lambda side, arms: self.postures(arms)

    def postures(self, postures: FloatArray) -> FloatArray:
        """See :class:`TermObservation`."""
        return np.zeros(len(postures))


@dataclass(frozen=True)
class SumOfTerms:
    """The sum of the observations of several terms."""

    parts: tuple[TermObservation, ...]

    def torsos_beside(self, arms: FloatArray | None) -> TorsoCosts:
        """See :class:`TermObservation`."""
        costs = [part.torsos_beside(arms) for part in self.parts]
        return costs[0] if len(costs) == 1 else lambda torsos: _total(c(torsos) for c in costs)

    def arms_beside(self, torso: FloatArray) -> ArmCosts:
        """See :class:`TermObservation`."""
        costs = [part.arms_beside(torso) for part in self.parts]
        if len(costs) == 1:
            return costs[0]
        return lambda side, arms: _total(c(side, arms) for c in costs)

    def postures(self, postures: FloatArray) -> FloatArray:
        """See :class:`TermObservation`."""
        return _total(part.postures(postures) for part in self.parts)


def _total(costs: Iterator[FloatArray]) -> FloatArray:
    """Return the sum of arrays (N,) in their order; the first array is overwritten."""
    total = next(costs)
    for cost in costs:
        total += cost
    return total
