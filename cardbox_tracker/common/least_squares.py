"""Nonlinear least squares: Levenberg-Marquardt steps over named, robust residuals within limits.

N fits of n unknowns x run side by side; each minimizes

    sum over named residuals of rho(r(x)) + sum(((x - mean) / deviation)^2),    low <= x <= high

A step solves the normal equations of the residuals, each with the weight of its loss at x
(iteratively reweighted least squares). Their diagonal is multiplied by a factor, which is 1 at
first, four times as large after a step that makes the cost larger, and a quarter after others
(Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", 1963).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.array_checks import check_array
from cardbox_tracker.common.compiling import inlined_allocation, inlined_kernel, kernel

Floats = NDArray[np.float64]
Equations = tuple[Floats, Floats, Floats, Floats]
"""Values (N, n), upper triangles of the matrices (N, n, n) and right sides (N, n) of the normal
equations there, and costs (N, K), of which the last one is that of the prior."""
Rules = tuple[Floats, Floats, Floats, Floats]
"""Damping, lowest and highest values, and largest change of a step, each (n,)."""
Loss = Callable[[Floats], tuple[Floats, Floats]]
"""Takes squares of residuals in units of a scale; returns robust squares, and their derivatives."""

PRIOR = "prior"
"""Name of the prior among the costs."""
# Change of the diagonal's factor after a step, and its largest value.
_FACTOR, _LARGEST_FACTOR = 4.0, 4.0**8
# Least square of a pivot: what no residual depends on stays.
_LEAST = 1e-12


class Residuals(NamedTuple):
    """Robust residuals of N fits."""

    #: residuals in units of their deviations, times the root of their robust weight, (N, R)
    values: Floats
    #: derivatives of ``values`` by the unknowns, (N, R, n), with constant weights
    jacobian: Floats
    #: robust costs, (N,), which a step should reduce; None for the sums of squared ``values``
    costs: Floats | None = None


class Prior(NamedTuple):
    """A normal prior of the unknowns."""

    mean: Floats  #: (n,), or (N, n) for each fit
    inverse: Floats  #: inverse variances, (n,)


class Solution(NamedTuple):
    """The result of N fits."""

    values: Floats  #: unknowns, (N, n)
    #: matrix of the normal equations there, (N, n, n): the inverse of the posterior's covariance
    information: Floats
    costs: Mapping[str, Floats]  #: robust cost by the name of the residuals, (N,); and the prior's

    @property
    def total(self) -> Floats:
        """Sums of all costs, (N,)."""
        return np.asarray(sum(self.costs.values()))


def minimize(
    residuals: Mapping[str, Callable[[Floats], Residuals | None]],
    start: Floats,
    prior: Prior | None = None,
    limits: tuple[Floats | float, Floats | float] = (-np.inf, np.inf),
    *,
    steps: int,
    largest: Floats | float = np.inf,
    damping: Floats | float = 0.0,
    least_gain: float = 0.0,
) -> Solution:
    """Return unknowns (N, n) with a smaller cost near ``start`` (N, n), with their information.

    Args:
        residuals: what gives the residuals of unknowns (N, n), by name; None if there are none.
        start: values to begin with; they may be beyond the limits.
        prior: prior of the unknowns.
        limits: lowest and highest values. One that would go on beyond its limit is left out.
        steps: most steps; each computes the residuals once.
        largest: largest change of an unknown in a step, (n,) or one for all.
        damping: inverse variance of a step, (n,) or one for all.
        least_gain: share of its cost from which on a step that gains less is a fit's last one.

    Raises:
        ValueError: residuals or their Jacobian have another shape or type.
    """
    size = start.shape[1]
    low, high = (np.zeros(size) + one for one in limits)
    by_step, most = np.zeros(size) + damping, np.zeros(size) + largest
    values, factors = np.array(start, np.float64), np.ones(len(start))
    if prior is None:
        prior = Prior(np.zeros(size), np.zeros(size))
    given = np.atleast_2d(prior.mean), prior.inverse
    now = _equations(residuals, given, values)
    is_done = now[-1].sum(axis=1) <= 0.0
    are_done = bool(is_done.all())
    for _ in range(steps):
        if are_done:
            break
        moved = np.empty_like(values)
        _propose(now, factors, (by_step, low, high, most), moved)
        after = _equations(residuals, given, moved)
        are_done = _accept(now, after, factors, least_gain, is_done)
    return solution_of(now, tuple(residuals))


def solution_of(found: Equations, names: tuple[str, ...]) -> Solution:
    """Return the solution of ``found`` equations with residuals of these names."""
    values, upper, _, costs = found
    lower = np.tri(values.shape[1], dtype=np.bool_)
    information = np.where(lower, upper.swapaxes(1, 2), upper)
    return Solution(values, information, dict(zip((*names, PRIOR), costs.T, strict=True)))


def _equations(
    residuals: Mapping[str, Callable[[Floats], Residuals | None]],
    prior: tuple[Floats, Floats],
    values: Floats,
) -> Equations:
    """Return the normal equations of the residuals, and of the prior with mean (N, n)."""
    count, size = values.shape
    information, right = np.zeros((count, size, size)), np.empty((count, size))
    found = values, information, right, np.zeros((count, len(residuals) + 1))
    _begin(found, *prior)
    for number, (name, residuals_of) in enumerate(residuals.items()):
        rows = residuals_of(values)
        if rows is not None:
            shape = count, len(rows.values.T)
            check_array(name, rows.values, shape, np.float64)
            check_array(f"Jacobian of {name}", rows.jacobian, (*shape, size), np.float64)
            _add(rows.values, rows.jacobian, number, found)
            if rows.costs is not None:
                found[-1][:, number] = rows.costs
    return found


@kernel
def _begin(found: Equations, means: Floats, inverse: Floats) -> None:
    """Add the prior to equations that are 0; ``means`` are (1, n) or (N, n)."""
    values, information, right, costs = found
    for n in range(values.shape[0]):
        for i in range(values.shape[1]):
            away = values[n, i] - means[n if means.shape[0] > 1 else 0, i]
            information[n, i, i] = inverse[i]
            right[n, i] = -inverse[i] * away
            costs[n, -1] += inverse[i] * away**2


@kernel
def _add(values: Floats, jacobian: Floats, number: int, found: Equations) -> None:
    """Add residuals (N, R) with a Jacobian (N, R, n) to the equations, and their squares."""
    _, information, right, costs = found
    size = right.shape[1]
    for n in range(values.shape[0]):
        for r in range(values.shape[1]):
            costs[n, number] += values[n, r] ** 2
            for i in range(size):
                slope = jacobian[n, r, i]
                if slope != 0.0:
                    right[n, i] -= slope * values[n, r]
                    for j in range(i, size):
                        information[n, i, j] += slope * jacobian[n, r, j]


@kernel
def _propose(now: Equations, factors: Floats, rules: Rules, moved: Floats) -> None:
    """Write the values after a step, (N, n); damped by ``factors`` (N,)."""
    values, information, right, _ = now
    damping, low, high, largest = rules
    size = values.shape[1]
    matrix, change, is_held = np.empty((size, size)), np.empty(size), np.empty(size, np.bool_)
    for n in range(values.shape[0]):
        for i in range(size):
            pull = right[n, i]
            is_held[i] = values[n, i] <= low[i] if pull < 0.0 else values[n, i] >= high[i]
            change[i] = 0.0 if is_held[i] else pull
        for i in range(size):
            for j in range(i, size):
                is_left_out = is_held[i] or is_held[j]
                matrix[i, j] = 0.0 if is_left_out else information[n, i, j]
            matrix[i, i] = 1.0 if is_held[i] else factors[n] * matrix[i, i] + damping[i]
        _solve(matrix, change)
        for i in range(size):
            value = values[n, i] + min(max(change[i], -largest[i]), largest[i])
            moved[n, i] = min(max(value, low[i]), high[i])


@inlined_kernel
def _solve(matrix: Floats, right: Floats) -> None:
    """Solve a linear system in place by a Cholesky decomposition; ``right`` (n,) is the solution.

    The matrix (n, n) is symmetric and positive definite; its upper triangle is overwritten.
    """
    size = right.shape[0]
    for i in range(size):
        root = sqrt(max(matrix[i, i], _LEAST))
        for j in range(i, size):
            matrix[i, j] /= root
        right[i] /= root
        for k in range(i + 1, size):
            share = matrix[i, k]
            if share != 0.0:
                right[k] -= share * right[i]
                for j in range(k, size):
                    matrix[k, j] -= share * matrix[i, j]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]


@kernel
def _accept(
    now: Equations, after: Equations, factors: Floats, least_gain: float, is_done: NDArray[np.bool_]
) -> bool:
    """Take over the fits whose costs are not larger than before; return whether all are done."""
    values, information, right, costs = now
    are_done = True
    for n in range(values.shape[0]):
        if is_done[n]:
            continue
        before, gain = 0.0, 0.0
        for k in range(costs.shape[1]):
            before += costs[n, k]
            gain += costs[n, k] - after[3][n, k]
        if gain >= 0.0:
            factors[n] = max(factors[n] / _FACTOR, 1.0)
            is_done[n] = is_done[n] or gain <= least_gain * before
            for k in range(costs.shape[1]):
                costs[n, k] = after[3][n, k]
            for i in range(values.shape[1]):
                values[n, i], right[n, i] = after[0][n, i], after[2][n, i]
                for j in range(i, values.shape[1]):
                    information[n, i, j] = after[1][n, i, j]
        else:
            factors[n] *= _FACTOR
            is_done[n] = is_done[n] or factors[n] > _LARGEST_FACTOR
        are_done = are_done and is_done[n]
    return are_done


def differences(
    function: Callable[[Floats], Floats], values: Floats, step: float
) -> tuple[Floats, Floats]:
    """Return a function's results (N, R) at N x n values, and their derivatives (N, R, n).

    The ``function`` gives (..., R) for (..., n) values; it is called once, with (n + 1, N, n).
    """
    size = values.shape[1]
    here, *moved = function(values + step * np.eye(size + 1, size, -1)[:, None])
    return here, (np.stack(moved, axis=2) - here[..., None]) / step


@inlined_allocation
def minimize_compiled(
    write: Callable[[Floats, Any, Floats], Any],
    given: Any,
    start: Floats,
    prior: tuple[Floats, Floats],
    rules: Rules,
    ends: tuple[int, float],
    differences: tuple[int, float],
) -> Equations:
    """Do as :func:`minimize` in compiled code, with residuals that a kernel writes.

    Args:
        write: takes values (n,) and ``given``, and writes R residuals, (R,).
        given: other arguments of ``write``.
        start: values to begin with, (N, n).
        prior: means (1, n) or (N, n), and inverse variances (n,).
        rules: damping, limits and largest change of a step, each (n,).
        ends: most steps, and least gain.
        differences: R, and the change of a value for its derivatives.
    """
    (count, size), rows = start.shape, differences[0]
    errors, jacobian, above = np.empty((count, rows)), np.empty((count, rows, size)), np.empty(rows)
    now = _zeros(count, size)
    now[0][:] = start
    factors, is_done = np.ones(count), np.zeros(count, np.bool_)
    for step in range(ends[0] + 1):
        after = now if step == 0 else _zeros(count, size)
        if step > 0:
            _propose(now, factors, rules, after[0])
        values = after[0]
        for n in range(count):
            if is_done[n]:
                continue
            write(values[n], given, errors[n])
            for j in range(size):
                value = values[n, j]
                values[n, j] = value + differences[1]
                write(values[n], given, above)
                values[n, j] = value
                for i in range(rows):
                    jacobian[n, i, j] = (above[i] - errors[n, i]) / differences[1]
        _begin(after, prior[0], prior[1])
        _add(errors, jacobian, 0, after)
        if step > 0 and _accept(now, after, factors, ends[1], is_done):
            break
    return now


@inlined_allocation
def _zeros(count: int, size: int) -> Equations:
    matrices = np.zeros((count, size, size))
    return np.zeros((count, size)), matrices, np.zeros((count, size)), np.zeros((count, 2))


def pseudo_huber(squares: Floats) -> tuple[Floats, Floats]:
    """Return the loss that is linear in residuals far above the scale."""
    root = np.sqrt(1.0 + squares)
    return 2.0 * (root - 1.0), 1.0 / root


def geman_mcclure(squares: Floats) -> tuple[Floats, Floats]:
    """Return the loss below 1, by which residuals of the scale have a quarter of the weight."""
    return squares / (1.0 + squares), (1.0 + squares) ** -2.0


def weighted(
    errors: Floats, jacobian: Floats, loss: Loss, scale: float, weight: Floats | float = 1.0
) -> Residuals:
    """Return robust residuals of errors (N, R) with a Jacobian (N, R, n), both in deviations.

    The ``scale`` is that of the loss, deviations; ``weight``, (N, R) or one for all, multiplies it.
    """
    robust, weights = loss((errors / scale) ** 2)
    roots = np.sqrt(weight * weights)
    costs = scale**2 * (weight * robust).sum(axis=1)
    return Residuals(roots * errors, roots[..., None] * jacobian, costs)
