"""Breadths that are refined while a person is tracked, slowly and never far from the measured ones.

In each of many sure frames the posture found is rated with parts a little broader and a little
narrower. Where the ratings of a posture are lowest, what a size changes in them at that posture is
what it changes in the best of them, so the posture need not be found again. The mean over a block
of frames, with a prior around the measured size, is a parabola whose minimum is the next size.

Lengths along the bones are left alone: over 22 recorded sessions what the outline said of the upper
arm had nothing to do with how wrong its length was, since an arm out of the plane looks as a
shorter one does.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from cardbox_tracker.body.model import MEASURED, BodyModel
from cardbox_tracker.body.sizes import SIZE_INDEX, SIZE_LIMITS, FloatArray
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.vision.camera import Camera

GROUPS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "trunk": ("torso_top_width", "torso_bottom_width", "waist_width"),
        "arms": ("upper_arm_width", "forearm_width"),
        "head": ("head_width",),
    }
)
"""Sizes that change together, by a common factor."""

LARGEST_CHANGE = 0.15
"""As a logarithm, from the body to begin with."""

# Every so many sure frames are rated, and so many of them make a block: 30 s at 15 Hz, so that no
# single posture decides.
_EVERY, _BLOCK = 3, 150
_STEP = 0.03
# Standard deviations of the prior around measured sizes and such from proportions, as logarithms,
# and the cost of one of them, as in the initialization. The prior weighs the same in each block:
# however long somebody is tracked, the outline does not overrule it.
_MEASURED_SD, _PROPORTIONS_SD, _PRIOR = 0.05, 0.10, 0.003
# Smaller changes are not worth another model.
_LEAST_CHANGE = 0.003


class SizeRefinement:
    """Collects what the frames of one person say of the breadths of their parts."""

    def __init__(self, body: BodyModel, camera: Camera, config: WholeBodyCostConfig) -> None:
        """Start with the sizes of ``body``, as seen by ``camera``, pitched as it stands."""
        self._measured, self._camera, self._config = body, camera, config
        spread = _MEASURED_SD if body.source == MEASURED else _PROPORTIONS_SD
        self._stiffness = _PRIOR / spread**2
        self._change = np.zeros(len(GROUPS))
        self._costs = self._beside(body)
        self._forget()

    def _forget(self) -> None:
        """Begin a block."""
        self._frames, self._rated = 0, 0
        self._sums = np.zeros((len(GROUPS), 2))

    def _beside(self, body: BodyModel) -> list[WholeBodyCost]:
        """Return what rates bodies a little narrower and broader than ``body``, by group."""
        return [
            WholeBodyCost(_changed(body, names, step), self._camera, self._config)
            for names in GROUPS.values()
            for step in (-_STEP, _STEP)
        ]

    def add(self, cost: WholeBodyCost, state: FloatArray) -> BodyModel | None:
        """Rate a sure frame; return a body to go on with at the end of a block, else None.

        Args:
            cost: has seen the frame's silhouette, with the sizes of now.
            state: the best one, (14,).
        """
        self._frames += 1
        if self._frames % _EVERY:
            return None
        now = cost.outline_rating(state)
        for other in self._costs:
            other.share_silhouette(cost)
        ratings = np.array([other.outline_rating(state) for other in self._costs])
        self._sums += ratings.reshape(-1, 2) - now
        self._rated += 1
        if self._rated < _BLOCK:
            return None
        change = self._best_change(self._sums / self._rated)
        self._forget()
        if np.abs(change - self._change).max() < _LEAST_CHANGE:
            return None
        self._change, body = change, self._measured
        for names, of_group in zip(GROUPS.values(), change.tolist(), strict=True):
            body = _changed(body, names, of_group)
        self._costs = self._beside(body)
        return body

    def _best_change(self, means: FloatArray) -> FloatArray:
        """Return logarithms (groups,): where mean rating and prior together are lowest."""
        slope = (means[:, 1] - means[:, 0]) / (2 * _STEP)
        # The outline may be flat or its minimum beyond the steps; the prior has a minimum.
        bend = np.maximum((means[:, 1] + means[:, 0]) / _STEP**2, 0.0)
        stiffness = 2 * self._stiffness
        step = -(slope + stiffness * self._change) / (bend + stiffness)
        step = np.clip(step, -_STEP, _STEP)
        return np.clip(self._change + step, -LARGEST_CHANGE, LARGEST_CHANGE)


def _changed(body: BodyModel, names: tuple[str, ...], change: float) -> BodyModel:
    """Return ``body`` with some sizes times exp(change), within what people can be."""
    sizes = body.sizes.copy()
    which = [SIZE_INDEX[name] for name in names]
    sizes[which] = np.clip(sizes[which] * np.exp(change), *SIZE_LIMITS[which].T)
    return body.with_values(sizes=sizes)
