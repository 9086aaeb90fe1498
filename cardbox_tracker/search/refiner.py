"""Refiner: states that fit all cues of a frame best, by robust Gauss-Newton steps.

A state x (14,) of the first camera minimizes

    sum over cameras and cues of rho(r(x)) + sum(((x - mean) / deviation)^2)

Cues give their residuals r, with the weights of their robust cost rho, and the derivatives in the
frame of their own camera (:class:`~cardbox_tracker.terms.term.Residuals`); a
:class:`~cardbox_tracker.camera.view.View` is linear, so derivatives are carried to the
first camera by its matrix. A step that makes the cost larger is shortened.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cardbox_tracker.camera.view import View
from cardbox_tracker.common.compiling import kernel
from cardbox_tracker.person.posture import N_STATE
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms.kernel_arguments import Floats
from cardbox_tracker.terms.linear_kernels import solve
from cardbox_tracker.terms.multi_view import MultiViewCost
from cardbox_tracker.terms.term import Posed, TermObservation

Cue = tuple[int, TermObservation]
"""Index of the camera, and what it observed."""

# Largest change of a value in a step, rad and m, and the share of a step that did not help.
_MOST_CHANGE, _SHORTER = 0.5, 0.25
_SAME = np.eye(N_STATE)


class Prior(NamedTuple):
    """A normal prior of a state."""

    mean: FloatArray  #: (14,), or (N, 14) for each state
    inverse: FloatArray  #: inverse variances, (14,)


class Refiner:
    """Fits states of one body before one camera or several."""

    def __init__(self, cost: MultiViewCost, views: Sequence[View]) -> None:
        """Prepare for the cameras of ``cost``."""
        self._cost = cost
        self._turned = [_SAME, *(np.ascontiguousarray(view.turned) for view in views)]

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
        states are within their limits. The information (N, 14, 14) is the matrix of the normal
        equations at the last accepted state, whose inverse is the covariance of the posterior.
        """
        low, high = self._cost.limits.T
        states = np.ascontiguousarray(states, np.float64)
        by_step = damping * np.ones(N_STATE)
        matrices, rights, costs = self._equations(states, cues, prior)
        for _ in range(steps):
            changes = rights.copy()
            _solve_each(matrices, by_step, changes)
            moved = np.minimum(np.maximum(states + changes, low), high)
            found = self._equations(moved, cues, prior)
            is_worse = ~(found[2] <= costs)
            if is_worse.any():
                shares = np.where(is_worse, _SHORTER, 1.0)[:, None]
                moved = np.minimum(np.maximum(states + shares * changes, low), high)
                found = self._equations(moved, cues, prior)
                # A state that even a short step makes worse stays.
                kept = ~(found[2] <= costs)
                moved[kept] = states[kept]
                for new, old in zip(found, (matrices, rights, costs), strict=True):
                    new[kept] = old[kept]
            states, (matrices, rights, costs) = moved, found
        return states, matrices

    def _equations(
        self, states: FloatArray, cues: Sequence[Cue], prior: Prior
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return matrices (N, 14, 14), right sides (N, 14) and costs (N,) at states (N, 14)."""
        matrices = np.zeros((len(states), N_STATE, N_STATE))
        rights, costs = np.empty(states.shape), np.empty(len(states))
        means = np.atleast_2d(prior.mean)
        _begin(states, means, prior.inverse, matrices, rights, costs)
        posed: dict[int, Posed] = {}
        for number, cue in cues:
            if number not in posed:
                there = self._cost.to_views[number](states)
                posed[number] = Posed(self._cost.costs[number].body, there)
            found = cue.residuals(posed[number])
            if found is not None:
                _add(
                    found.values, found.jacobian, self._turned[number], number > 0, matrices, rights
                )
                costs += found.costs
        return matrices, rights, costs


@kernel
def _begin(
    states: Floats, means: Floats, inverse: Floats, matrices: Floats, rights: Floats, costs: Floats
) -> None:
    """Write the equations of the prior, whose ``means`` are (1, 14) or (N, 14)."""
    for n in range(states.shape[0]):
        costs[n] = 0.0
        for i in range(N_STATE):
            away = states[n, i] - means[n if means.shape[0] > 1 else 0, i]
            matrices[n, i, i] = inverse[i]
            rights[n, i] = -inverse[i] * away
            costs[n] += inverse[i] * away**2


@kernel
def _add(
    values: Floats,
    jacobian: Floats,
    turned: Floats,
    is_turned: bool,
    matrices: Floats,
    rights: Floats,
) -> None:
    """Add J^T J to the lower triangles of ``matrices`` (N, 14, 14) and -J^T r to ``rights``."""
    row, there = np.empty(N_STATE), np.empty(N_STATE)
    for n in range(values.shape[0]):
        matrix, right = matrices[n], rights[n]
        for r in range(values.shape[1]):
            is_zero = True
            for j in range(N_STATE):
                row[j] = jacobian[n, r, j]
                is_zero = is_zero and row[j] == 0.0
            if is_zero:
                continue
            if is_turned:
                for i in range(N_STATE):
                    there[i] = 0.0
                    for j in range(N_STATE):
                        there[i] += turned[i, j] * row[j]
                for i in range(N_STATE):
                    row[i] = there[i]
            for i in range(N_STATE):
                right[i] -= row[i] * values[n, r]
                for j in range(i + 1):
                    matrix[i, j] += row[i] * row[j]


@kernel
def _solve_each(matrices: Floats, damping: Floats, rights: Floats) -> None:
    """Overwrite ``rights`` (N, 14) by the changes; lower triangles of the matrices are read."""
    matrix = np.empty((N_STATE, N_STATE))
    for n in range(matrices.shape[0]):
        for i in range(N_STATE):
            for j in range(i + 1):
                matrix[i, j] = matrices[n, i, j]
            matrix[i, i] += damping[i]
        solve(matrix, rights[n])
        for i in range(N_STATE):
            rights[n, i] = min(max(rights[n, i], -_MOST_CHANGE), _MOST_CHANGE)
