"""Arms of posed bodies in the image, and the gains of the inner cue."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms import inner_cue_kernels as kernels
from cardbox_tracker.terms.term import Posed


def arms_in_image(posed: Posed, arm: int) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return column, row and pixels per metre of elbow and hand of one arm, (N, 2, 3).

    ``arm`` is 0 left or 1 right. Also returns whether the hand is behind the trunk, (N,).
    """
    points, hidden = np.empty((len(posed), 2, 3)), np.empty(len(posed), np.bool_)
    kernels.project_arms(posed.states, arm, posed.body, points, hidden)
    return points, hidden


def forearm_of(person: BodyModel) -> tuple[float, float]:
    """Return length, including the fist, and width of a person's forearm, m."""
    return person.size("forearm_length"), person.size("forearm_width")


def zones_of(posed: Posed) -> FloatArray:
    """Return the places of head and torso of the first state, (6,), px, see ``torso_zones``."""
    zones = np.empty(6)
    kernels.torso_zones(posed.states[0], posed.body, zones)
    return zones


@dataclass(frozen=True, eq=False)
class ArmGains:
    """The gains of arms in one image."""

    maps: NDArray[np.float32]  #: log-likelihood ratios of hand and forearm, (2, h, w), nats
    corner: tuple[int, int]  #: column and row of the image where the maps begin
    weights: FloatArray  #: weight of a nat of hand and forearm, px of the outline, (2,)
    px_per_m: float  #: scale at the expected place of the person
    forearm_m: tuple[float, float]  #: length, including the fist, and width of the forearm

    def __call__(
        self, points: FloatArray, hidden: NDArray[np.bool_], others: FloatArray
    ) -> FloatArray:
        """Return the gains (N,), px, of arms; ``points`` and ``hidden`` as :func:`arms_in_image`.

        ``others`` are points of the other arm, (N, 2, 3), or (1, 2, 3) for all.
        """
        gains = np.empty(len(points))
        kernels.arm_gains(points, hidden, others, *self.arguments, gains)
        return gains

    @cached_property
    def arguments(self) -> tuple[kernels.MapsTuple, kernels.ForearmTuple, FloatArray]:
        """The same for the kernels."""
        return (self.maps, *self.corner), (*self.forearm_m, self.px_per_m), self.weights
