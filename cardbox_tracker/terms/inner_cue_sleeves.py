"""Bare forearms or sleeves, learned while tracking a person without reference postures.

A forearm has the colours of the skin or those of the shirt. Both are possible at first, so the
forearm's histogram is their mixture by the chance that forearms are bare. Each image changes the
chance: the log-likelihood ratio of skin against the part behind, over the forearms of the last
posture, is added to the logarithm of the odds.

The skin of a bare forearm is alike that of a hand, so that a hand on it would gain as much as one
at its end. A hand weighs less, the more probably forearms are bare.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.person.appearance import FOREARM, HAND, TORSO
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.inner_cue_arms import ArmGains, arms_in_image
from cardbox_tracker.terms.term import Posed

# Weight of a nat over the area of a forearm; neighbouring pixels and successive images are alike.
_WEIGHT = 0.1
# Added to each ratio, nats: an arm that is not found shows the shirt, whatever it wears.
_TOWARDS_BARE = 0.2
# Logarithm of the odds before the first image: whoever is not known more often shows the forearms.
_FIRST = 1.0
# Limit of the logarithm of the odds, so that a jacket that is taken off is noticed.
_MOST = 3.0
# Share of a hand's weight that is lost beside bare forearms.
_LOST = 0.5
# Change of the chance that is worth new ratios.
_STEP = 0.01


class Sleeves:
    """The chance that the forearms of one person are bare.

    Attributes:
        log_odds: logarithm of the odds of bare forearms against sleeves.
    """

    def __init__(
        self, histograms: FloatArray, forearm_m: tuple[float, float], px_per_m: float
    ) -> None:
        """Prepare for a person with ``histograms`` (5, bins), probabilities of bins for each part.

        ``forearm_m`` are length and width; ``px_per_m`` is the scale at the expected place.
        """
        self._histograms, self._forearm_m, self._px_per_m = histograms.copy(), forearm_m, px_per_m
        forearm_px = forearm_m[0] * forearm_m[1] * px_per_m**2
        self._weights = np.array([0.0, _WEIGHT / forearm_px])
        self.log_odds, self._told = _FIRST, 0.0

    @property
    def bare(self) -> float:
        """The chance that the forearms are bare, 0 to 1."""
        return float(1.0 / (1.0 + np.exp(-self.log_odds)))

    @property
    def hand_weight(self) -> float:
        """Factor on the weight of a hand, 0 to 1."""
        return 1.0 - _LOST * self.bare

    @property
    def histograms(self) -> FloatArray:
        """Probability of each bin for each part, (5, bins), with forearms as they probably are."""
        self._told = self.bare
        histograms = self._histograms.copy()
        skin, shirt = histograms[HAND], histograms[TORSO]
        histograms[FOREARM] = self._told * skin + (1.0 - self._told) * shirt
        return histograms

    def see(self, skin: NDArray[np.float32], corner: tuple[int, int], posed: Posed) -> bool:
        """Learn from one image; return whether ``histograms`` have changed.

        ``skin`` (h, w) has log-likelihood ratios of the hand against the part behind, nats, and
        begins at the column and row ``corner``; 0 where both are alike. The person has one state.
        """
        inclined = np.where(skin != 0.0, skin + np.float32(_TOWARDS_BARE), np.float32(0.0))
        maps = np.stack([inclined, inclined])
        gains = ArmGains(maps, corner, self._weights, self._px_per_m, self._forearm_m)
        for arm in (0, 1):
            points, hidden = arms_in_image(posed, arm)
            self.log_odds += float(gains(points, hidden, points)[0])
        self.log_odds = float(np.clip(self.log_odds, -_MOST, _MOST))
        return abs(self.bare - self._told) > _STEP
