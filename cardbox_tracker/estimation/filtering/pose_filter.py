"""What a tracker asks of the filter that follows a posture."""

from __future__ import annotations

from typing import Protocol

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.terms import TermObservation


class PoseFilter(Protocol):
    """Follows a posture (12,), rad and metres, from observation to observation."""

    def initialize(
        self, observation: TermObservation, posture: FloatArray, noise_scale: float = 1.0
    ) -> None:
        """Start around ``posture`` (12,), with ``noise_scale`` times the usual noise."""

    def iterate(
        self, observation: TermObservation, noise_scale: float = 1.0, explore: float = 0.0
    ) -> None:
        """Run one estimation cycle.

        Args:
            observation: what rates postures.
            noise_scale: factor on the noise.
            explore: fraction of the arms' particles to draw from anywhere within the joint limits.
        """

    def estimate(self) -> FloatArray:
        """Return the posture (12,) found by the latest call of one of the above."""

    def stddev(self) -> FloatArray:
        """Return the standard deviation (12,) of each joint around the estimate."""
