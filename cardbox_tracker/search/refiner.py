"""Refiner: states that fit all cues of a frame best, by robust least squares.

Cues give their residuals in the frame of their own camera; a
:class:`~cardbox_tracker.camera.view.View` is linear, so derivatives are carried to the state (14,)
of the first camera by its matrix.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from cardbox_tracker.camera.view import View
from cardbox_tracker.common.least_squares import Residuals, minimize, rules_of
from cardbox_tracker.person.posture import N_STATE
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.multi_view import MultiViewCost
from cardbox_tracker.terms.term import Posed, TermObservation

Cue = tuple[int, TermObservation]
"""Index of the camera, and what it observed."""

# Largest change of a value in a step, rad and m, and tries for each of the few steps.
_MOST_CHANGE, _TRIES = 0.5, 2


class Prior(NamedTuple):
    """A normal prior of a state."""

    mean: FloatArray  #: (14,), or (N, 14) for each state
    inverse: FloatArray  #: inverse variances, (14,)


class Refiner:
    """Fits states of one body before one camera or several."""

    def __init__(self, cost: MultiViewCost, views: Sequence[View]) -> None:
        """Prepare for the cameras of ``cost``."""
        self._cost = cost
        self._turned = [view.turned for view in views]

    def __call__(
        self,
        states: FloatArray,
        cues: Sequence[Cue],
        prior: Prior,
        steps: int,
        damping: FloatArray | float = 0.0,
    ) -> tuple[FloatArray, FloatArray]:
        """Return states (N, 14) near ``states`` that fit the cues, and their information.

        Cues without residuals do not count; ``damping`` is the inverse variance of a step. The
        states are within their limits. The information is (N, 14, 14).
        """
        low, high = self._cost.limits.T
        given = prior._asdict() | {"low": low, "high": high}
        rules = rules_of(N_STATE, damping=damping, largest=_MOST_CHANGE, **given)
        terms = {f"cue {i}": self._of(*cue) for i, cue in enumerate(cues)}
        found = minimize(terms, states, rules, steps, tries=_TRIES)
        return found.values, found.information

    def _of(self, number: int, cue: TermObservation) -> Callable[[FloatArray], Residuals | None]:
        """Return what gives the residuals of a cue for states (N, 14) of the first camera."""
        body, to_view = self._cost.costs[number].body, self._cost.to_views[number]

        def residuals(states: FloatArray) -> Residuals | None:
            found = cue.residuals(Posed(body, to_view(states)))
            if found is None or number == 0:
                return found
            return found._replace(jacobian=found.jacobian @ self._turned[number - 1].T)

        return residuals
