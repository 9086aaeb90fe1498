"""Nonlinear least squares: Levenberg-Marquardt steps over named, robust residuals within limits.

N fits of n unknowns x run side by side; each minimizes

    sum over named residuals of rho(r(x)) + sum(((x - mean) / deviation)^2),    low <= x <= high

A step solves the normal equations of the residuals, each with the weight of its loss at x
(iteratively reweighted least squares). Their diagonal is multiplied by a factor, which is 1 at
first, four times as large after a step that makes the cost larger, and a quarter after others
(Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", 1963).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.array_checks import check_array
from cardbox_tracker.common.compiling import inlined_allocation, inlined_kernel, kernel

Floats = NDArray[np.float64]
Counts = NDArray[np.int64]
Equations = tuple[Floats, Floats, Floats, Floats]
"""Values (N, n), upper triangles of the matrices (N, n, n) and right sides (N, n) of the normal
equations there, and costs (N, K), of which the last one is that of the prior."""
Rules = tuple[Floats, Floats, Floats, Floats, Floats, Floats]
"""What :func:`rules_of` returns."""

PRIOR = "prior"
"""Name of the prior among the costs."""
ENDS = 8, 1e-3
"""Steps of small fits, and the share of its cost from which on a step that gains less is the last
one."""
DIFFERENCE = 1e-5
"""Change of an unknown for the derivatives by it."""
ROBUST = 2.0
"""Deviations from which on a residual counts less, where nothing else is known of outliers."""
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


class Solution:
    """The result of N fits.

    Attributes:
        values: unknowns, (N, n).
        information: matrix of the normal equations there, (N, n, n): the inverse of the posterior's
            covariance.
        costs: robust costs (N,) by the name of the residuals, and that of the prior.
        total: sums of all costs, (N,).
    """

    def __init__(self, found: Equations, names: Iterable[str]) -> None:
        """Take the equations of residuals with these names."""
        self.values, upper, _, costs = found
        lower = np.tri(upper.shape[1], dtype=np.bool_)
        self.information: Floats = np.where(lower, upper.swapaxes(1, 2), upper)
        self.costs = dict(zip((*names, PRIOR), costs.T, strict=True))
        self.total: Floats = costs.sum(axis=1)


def rules_of(
    size: int,
    *,
    mean: Floats | float = 0.0,
    inverse: Floats | float = 0.0,
    damping: Floats | float = 0.0,
    low: Floats | float = -np.inf,
    high: Floats | float = np.inf,
    largest: Floats | float = np.inf,
) -> Rules:
    """Return the rules of fits of n = ``size`` unknowns; each is (n,) or a number for all.

    Args:
        size: number of unknowns.
        mean: mean of the prior; (N, n) if each fit has its own.
        inverse: inverse variance of the prior.
        damping: inverse variance of a step.
        low: lowest values; a value that would go on beyond its limit is left out of the step.
        high: highest values.
        largest: largest change in a step.
    """
    one, two, three, four, five = (
        np.zeros(size) + rule for rule in (inverse, damping, low, high, largest)
    )
    return np.array(mean + np.zeros(size), order="C", ndmin=2), one, two, three, four, five


def minimize(
    residuals: Mapping[str, Callable[[Floats], Residuals | None]],
    start: Floats,
    rules: Rules,
    steps: int,
    least_gain: float = 0.0,
    tries: int = 1,
) -> Solution:
    """Return unknowns (N, n) with a smaller cost near ``start`` (N, n), with their information.

    Args:
        residuals: what gives the residuals of unknowns (N, n), by name; None if there are none.
        start: values to begin with; they may be beyond the limits.
        rules: prior, limits and damping.
        steps: most steps.
        tries: mean number of tries for a step; one that makes the cost larger is tried again,
            shorter. Each computes the residuals once.
        least_gain: share of its cost from which on a step that gains less is a fit's last one.

    Raises:
        ValueError: the rules, residuals or their Jacobian have another shape or type.
    """
    factors, left = np.ones(len(start)), np.full(len(start), steps)
    np.broadcast_to(rules[0], start.shape)  # raises for other shapes
    now = _equations(residuals, np.array(start, np.float64, order="C"), rules)
    for _ in range(tries * steps):
        after = _equations(residuals, _proposed(now, factors, rules), rules)
        if _accept(now, after, factors, least_gain, left):
            break
    return Solution(now, residuals)


def _equations(
    residuals: Mapping[str, Callable[[Floats], Residuals | None]], values: Floats, rules: Rules
) -> Equations:
    count, size = values.shape
    found = _begun(values, rules, len(residuals) + 1)
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


@inlined_allocation
def minimize_compiled(
    write: Callable[[Floats, Any, Floats], Any],
    given: tuple[Any, int, float],
    start: Floats,
    rules: Rules,
    ends: tuple[int, float],
) -> Equations:
    """Do as :func:`minimize` in compiled code, for the equations of a :class:`Solution`.

    The kernel ``write`` takes values (n,) and the first of what is ``given``, and writes residuals
    (R,). Then come R and the change of a value for its derivatives. ``ends`` are most steps, and
    least gain.
    """
    factors, left = np.ones(start.shape[0]), np.full(start.shape[0], ends[0])
    now = _linearized(write, given, start.copy(), rules, left)
    for _ in range(ends[0]):
        after = _linearized(write, given, _proposed(now, factors, rules), rules, left)
        if _accept(now, after, factors, ends[1], left):
            break
    return now


@inlined_allocation
def _linearized(
    write: Callable[[Floats, Any, Floats], Any],
    given: tuple[Any, int, float],
    values: Floats,
    rules: Rules,
    left: Counts,
) -> Equations:
    arguments, rows, step = given
    (count, size), above = values.shape, np.empty(rows)
    errors, jacobian = np.zeros((count, rows)), np.zeros((count, rows, size))
    for n in range(count):
        if left[n] == 0:
            continue
        write(values[n], arguments, errors[n])
        for j in range(size):
            value = values[n, j]
            values[n, j] = value + step
            write(values[n], arguments, above)
            values[n, j] = value
            for i in range(rows):
                jacobian[n, i, j] = (above[i] - errors[n, i]) / step
    found = _begun(values, rules, 2)
    _add(errors, jacobian, 0, found)
    return found


@kernel
def _begun(values: Floats, rules: Rules, columns: int) -> Equations:
    """Return the equations of the prior, with so many columns of costs."""
    (count, size), (means, inverse, _, _, _, _) = values.shape, rules
    information, right = np.zeros((count, size, size)), np.empty((count, size))
    costs = np.zeros((count, columns))
    for n in range(count):
        for i in range(size):
            away = values[n, i] - means[n if means.shape[0] > 1 else 0, i]
            information[n, i, i] = inverse[i]
            right[n, i] = -inverse[i] * away
            costs[n, -1] += inverse[i] * away**2
    return values, information, right, costs


@kernel
def _add(values: Floats, jacobian: Floats, number: int, found: Equations) -> None:
    """Add residuals (N, R) with a Jacobian (N, R, n) to the equations, and their squares."""
    _, information, right, costs = found
    size = right.shape[1]
    # Of many unknowns, a residual depends on few.
    known = np.empty(size, np.int64)
    for n in range(values.shape[0]):
        for r in range(values.shape[1]):
            costs[n, number] += values[n, r] ** 2
            count = 0
            for i in range(size):
                if jacobian[n, r, i] != 0.0:
                    known[count] = i
                    count += 1
            for a in range(count):
                i = known[a]
                slope = jacobian[n, r, i]
                right[n, i] -= slope * values[n, r]
                for b in range(a, count):
                    information[n, i, known[b]] += slope * jacobian[n, r, known[b]]


@kernel
def _proposed(now: Equations, factors: Floats, rules: Rules) -> Floats:
    """Return the values after a step, (N, n), damped by ``factors`` (N,)."""
    values, information, right, _ = now
    _, _, damping, low, high, largest = rules
    size, moved = values.shape[1], np.empty(values.shape)
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
    return moved


@inlined_kernel
def _solve(matrix: Floats, right: Floats) -> None:
    """Solve a linear system in place by a Cholesky decomposition; ``right`` (n,) is the solution.

    The matrix (n, n) is symmetric and positive definite; its upper triangle is overwritten.
    """
    size = right.shape[0]
    for i in range(size):
        root = sqrt(max(matrix[i, i], _LEAST))
        matrix[i, i] = root
        for j in range(i + 1, size):
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
    now: Equations, after: Equations, factors: Floats, least_gain: float, left: Counts
) -> bool:
    """Take over the fits whose costs are not larger than before; return whether no step is left."""
    values, information, right, costs = now
    are_done = True
    for n in range(values.shape[0]):
        if left[n] == 0:
            continue
        before, gain = 0.0, 0.0
        for k in range(costs.shape[1]):
            before += costs[n, k]
            gain += costs[n, k] - after[3][n, k]
        if gain >= 0.0:
            factors[n] = max(factors[n] / _FACTOR, 1.0)
            left[n] = 0 if gain <= least_gain * before else left[n] - 1
            for k in range(costs.shape[1]):
                costs[n, k] = after[3][n, k]
            for i in range(values.shape[1]):
                values[n, i], right[n, i] = after[0][n, i], after[2][n, i]
                for j in range(i, values.shape[1]):
                    information[n, i, j] = after[1][n, i, j]
        else:
            factors[n] *= _FACTOR
            left[n] = 0 if factors[n] > _LARGEST_FACTOR else left[n]
        are_done = are_done and left[n] == 0
    return are_done


def pseudo_huber(
    errors: Floats, jacobian: Floats, scale: float = ROBUST, weight: Floats | float = 1.0
) -> Residuals:
    """Return residuals whose loss is linear far above the ``scale``.

    Errors (N, R), their Jacobian (N, R, n) and the scale are in deviations; ``weight``, (N, R) or
    one for all, multiplies the loss.
    """
    root = np.sqrt(1.0 + (errors / scale) ** 2)
    costs = 2.0 * scale**2 * (weight * (root - 1.0)).sum(axis=1)
    roots = np.sqrt(weight / root)
    return Residuals(roots * errors, roots[..., None] * jacobian, costs)


def geman_mcclure(
    errors: Floats,
    jacobian: Floats,
    scale: float = ROBUST,
    deviation: float = 1.0,
    weight: float = 1.0,
) -> Residuals:
    """Return residuals whose loss has a limit (Geman & McClure, 1985).

    At ``scale`` they have a quarter of the weight of squares.

    Errors (N, R), their Jacobian (N, R, n), ``scale`` and the ``deviation`` have one unit;
    ``weight`` multiplies the loss.
    """
    bounded = 1.0 + (errors / scale) ** 2
    costs = weight * ((errors / deviation) ** 2 / bounded).sum(axis=1)
    divisors = deviation / sqrt(weight) * bounded
    return Residuals(errors / divisors, jacobian / divisors[..., None], costs)
