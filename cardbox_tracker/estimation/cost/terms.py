"""The cost of a posture: a sum of terms, each in pixels of the image.

A tracker's cost is the silhouette's term (paper, equation (2)) and any further ones. A
:class:`Term` is made once for a body before a camera. For each frame its :meth:`~Term.observe`
returns what the term has to say about that frame, a :class:`TermObservation`, which never changes
afterwards; so several filters and threads may ask it at the same time.

A hierarchical filter rates first torsos and then the arms beside the torso it has found, so an
observation is asked in three ways:

    observation.torsos_beside(arms)(torsos)         (N, 4) -> (N,)    arms stay where they are
    observation.arms_beside(torso)(side, arms)      (N, 4) -> (N,)    the torso stays
    observation.postures(postures)                  (N, 12) -> (N,)

The first call of the first two prepares what all particles share. The whole-body filter also finds
how far the hips have moved along the line of sight and up; it asks for torsos without arms, and
appends ``torso_x`` and ``torso_z`` to torsos, (N, 6) or (6,), and to postures, (N, 14). So a term
reads d1..d4 and d1..d12 by their places and uses the last two if they are there. A new term is one
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
from cardbox_tracker.vision.camera import Camera

Silhouette = NDArray[np.uint8]
Image = NDArray[np.uint8]
DepthImage = NDArray[np.float32]

USUAL_INTERVAL_S = 1.0 / 15.0
"""Between frames of which no time is known."""

ARMS = {"left": LEFT_ARM, "right": RIGHT_ARM}
"""Joints of each arm."""

TorsoCosts = Callable[[FloatArray], FloatArray]
"""Takes torsos d1..d4, (N, 4), rad and metres; returns costs (N,), px."""

ArmCosts = Callable[[str, FloatArray], FloatArray]
"""Takes ``left`` or ``right`` and that arm's joints, (N, 4), rad; returns costs (N,), px."""


@dataclass(frozen=True)
class Frame:
    """What one camera shows of the person at one time, prepared for filter and terms.

    Attributes:
        silhouette: (H, W), 0 or 255, of the camera's size; not to be written to.
        rows: rows that count, from the top: those above the hips.
        foreground_px: foreground pixels in those rows.
        image: (H, W) grey or (H, W, 3) bgr of the same frame, undistorted; None without one.
        posture: of the frame before, (12,) or with ``torso_x`` and ``torso_z`` (14,), rad and
            metres; None where tracking starts.
        depth_m: (H, W), metres along the optical axis, not finite or 0 where it is not known; None
            without a depth image.
        interval_s: since the frame before, s.
        stamp_ns: when it was taken, ns; None where that is not known.
    """

    silhouette: Silhouette
    rows: int
    foreground_px: int
    image: Image | None = None
    posture: FloatArray | None = None
    depth_m: DepthImage | None = None
    interval_s: float = USUAL_INTERVAL_S
    stamp_ns: int | None = None


class TermObservation(Protocol):
    """What one term says of one frame; every cost is in pixels, float64."""

    def torsos_beside(self, arms: FloatArray | None) -> TorsoCosts:
        """Return what rates torsos.

        Args:
            arms: posture (12,) whose arms stay where they are in the image while the torsos move;
                None if no arms are considered.
        """

    def arms_beside(self, torso: FloatArray) -> ArmCosts:
        """Return what rates the arms of a body whose torso is at ``torso``, (4,) or (6,)."""

    def postures(self, postures: FloatArray) -> FloatArray:
        """Return the costs (N,) of whole postures, (N, 12) or (N, 14)."""


class Term(Protocol):
    """One reason why a posture costs something."""

    def observe(self, frame: Frame) -> TermObservation:
        """Return what this term says of ``frame``."""


class TermSettings(Protocol):
    """The settings of a term, as ``TrackerConfig.terms`` holds them."""

    def build(self, body: BodyModel, camera: Camera) -> Term:
        """Return the term for a measured person before a working camera."""


class Silence:
    """A term, and its observation, that says nothing."""

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
    """The observations of several terms as one: costs add up."""

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
    """Sum of arrays (N,), in their order; the first one is written to."""
    total = next(costs)
    for cost in costs:
        total += cost
    return total
