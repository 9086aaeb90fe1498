"""A silhouette's term that counts its ratings, so that searches are compared at equal numbers."""

from __future__ import annotations

from dataclasses import dataclass

from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.silhouette import SilhouetteObservation, SilhouetteTerm
from cardbox_tracker.terms.term import ArmCosts, Frame, TorsoCosts


class CountingSilhouette(SilhouetteTerm):
    """Gives the costs of another term.

    Attributes:
        ratings: states rated so far: torsos, arms and whole postures.
    """

    def __init__(self, term: SilhouetteTerm) -> None:
        """Count the ratings of ``term``."""
        super().__init__(term.body, term.camera)
        self._term = term
        self.ratings = 0

    def observe(self, frame: Frame) -> SilhouetteObservation:
        """See :class:`SilhouetteTerm`."""
        return _Counting(frame, self._term.observe(frame), self)

    def count(self, costs: FloatArray) -> FloatArray:
        """Count and return ``costs`` (N,)."""
        self.ratings += len(costs)
        return costs


@dataclass(frozen=True)
class _Counting(SilhouetteObservation):
    frame: Frame
    seen: SilhouetteObservation
    counter: CountingSilhouette

    def torsos_beside(self, arms: FloatArray | None) -> TorsoCosts:
        rate = self.seen.torsos_beside(arms)
        return lambda torsos: self.counter.count(rate(torsos))

    def arms_beside(self, torso: FloatArray) -> ArmCosts:
        rate = self.seen.arms_beside(torso)
        return lambda side, arms: self.counter.count(rate(side, arms))

    def postures(self, postures: FloatArray) -> FloatArray:
        return self.counter.count(self.seen.postures(postures))

    def overlap(self, posture: FloatArray) -> tuple[int, float]:
        return self.seen.overlap(posture)
