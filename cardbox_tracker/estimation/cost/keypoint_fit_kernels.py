"""Compiled Gauss-Newton steps that bring the keypoints of a state to where they are wanted.

Each step solves, with the Jacobian J of the keypoints K(state) and damping in units of ``stddev``,

    (J' J / SPREAD_M^2 + diag(1 / stddev^2)) change = J' (wanted - K(state)) / SPREAD_M^2

Who changes ``whole_body_kernels.py`` has to delete the cache of compiled code of this file.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.compiling import njit
from cardbox_tracker.estimation.cost.kernels import Floats, PlaceTuple, ViewTuple
from cardbox_tracker.estimation.cost.linear_kernels import solve
from cardbox_tracker.estimation.cost.whole_body_kernels import N_STATE, keypoints

_compile = njit(cache=True, nogil=True, error_model="numpy")

KEYPOINTS = 6
SPREAD_M = 0.01
"""How near to the wanted places the keypoints come where a joint has to turn by a deviation."""


@_compile
def fit_keypoints(
    state: Floats,
    parts: Floats,
    girdle: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    wanted: Floats,
    stddev: Floats,
    limits: Floats,
    steps: Floats,
    count: int,
) -> None:
    """Change ``state`` (14,) in place, by ``count`` steps.

    Args:
        state: to begin with.
        parts: as of :func:`~.whole_body_kernels.keypoints`, like the next three.
        girdle: see there.
        place: see there.
        view: see there.
        wanted: keypoints (6, 3), metres in the optical frame.
        stddev: how easily each value of the state moves, (14,); 0: not at all.
        limits: lowest and highest value of each, (14, 2).
        steps: of the central differences, (14,).
        count: how many steps.
    """
    trial = state.copy()
    now = np.empty((KEYPOINTS, 3))
    above, below = np.empty_like(now), np.empty_like(now)
    jacobian = np.empty((N_STATE, KEYPOINTS * 3))
    matrix, change = np.empty((N_STATE, N_STATE)), np.empty(N_STATE)
    scale = 1.0 / (SPREAD_M * SPREAD_M)
    for _ in range(count):
        keypoints(state, parts, girdle, place, view, now)
        for j in range(N_STATE):
            if stddev[j] == 0.0:
                jacobian[j] = 0.0
                continue
            trial[:] = state
            trial[j] = state[j] + steps[j]
            keypoints(trial, parts, girdle, place, view, above)
            trial[j] = state[j] - steps[j]
            keypoints(trial, parts, girdle, place, view, below)
            for i in range(KEYPOINTS * 3):
                jacobian[j, i] = (above[i // 3, i % 3] - below[i // 3, i % 3]) / (2.0 * steps[j])
        for j in range(N_STATE):
            for k in range(j + 1):
                matrix[j, k] = scale * np.sum(jacobian[j] * jacobian[k])
            matrix[j, j] += 1.0 if stddev[j] == 0.0 else 1.0 / stddev[j] ** 2
            total = 0.0
            for i in range(KEYPOINTS * 3):
                total += jacobian[j, i] * (wanted[i // 3, i % 3] - now[i // 3, i % 3])
            change[j] = scale * total
        solve(matrix, change)
        for j in range(N_STATE):
            state[j] = min(max(state[j] + change[j], limits[j, 0]), limits[j, 1])
