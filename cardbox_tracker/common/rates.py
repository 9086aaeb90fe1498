"""Velocities and accelerations of what follows from values that move, with deviations."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]

# The values are moved by this time, s, and by this share of themselves, for derivatives.
_STEP_S, _STEP = 0.01, 1e-4


def carried(
    function: Callable[[FloatArray], FloatArray],
    values: FloatArray,
    rates: FloatArray,
    are_angles: NDArray[np.bool_] | None = None,
) -> FloatArray:
    """Return the rates (4, n, l) of a function of values at n times.

    Rates are velocities, their deviations, accelerations and their deviations. Velocities and
    accelerations are those of the function along the motion; deviations follow from its derivatives
    (first-order propagation of independent errors).

    Args:
        function: takes values (n, k), returns (n, l), row by row or in order of time.
        values: (n, k).
        rates: those of the values, (4, n, k).
        are_angles: (l,) which ones of the function's are angles, rad, that may jump by a turn.
    """
    velocity, velocity_stddev, acceleration, acceleration_stddev = rates
    here = function(values)

    def moved(by: FloatArray) -> FloatArray:
        change = function(values + by) - here
        if are_angles is not None:
            whole = 2.0 * np.pi * np.round(change / (2.0 * np.pi))
            change = np.where(are_angles, change - whole, change)
        return np.asarray(change)

    bend = 0.5 * _STEP_S**2 * acceleration
    after, before = moved(_STEP_S * velocity + bend), moved(bend - _STEP_S * velocity)
    variances = np.zeros((2, *here.shape))
    for column, step in enumerate(_STEP * np.eye(values.shape[1])):
        slopes = moved(np.broadcast_to(step, values.shape)) / _STEP
        for variance, stddev in zip(variances, (velocity_stddev, acceleration_stddev), strict=True):
            # What does not depend on a value is known without it.
            variance += np.where(slopes == 0.0, 0.0, slopes * stddev[:, column, None]) ** 2
    found = (after - before) / (2.0 * _STEP_S), (after + before) / _STEP_S**2
    stddevs = np.sqrt(variances)
    return np.stack([found[0], stddevs[0], found[1], stddevs[1]])
