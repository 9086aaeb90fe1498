"""Compiled moves of whole states by random numbers, unit normal or uniform in 0..1."""

from __future__ import annotations

from math import sin

import numpy as np

from cardbox_tracker.common.compiling import inlined_kernel, kernel
from cardbox_tracker.person.posture import (
    ARM_ANGLES,
    FIRST_ANGLES,
    N_STATE,
    PITCH,
    ROLL,
    TORSO_X,
    TORSO_Y,
)
from cardbox_tracker.search.state_choice import least_of
from cardbox_tracker.terms.kernel_arguments import Floats

# Fraction of the noise that is added to a move by a difference.
_NOISE_OF_DIFFERENCE = 0.2
_LEFT, _RIGHT = FIRST_ANGLES


Numbers = tuple[Floats, Floats]
"""Random numbers of N proposals: unit normal, (N, D), and uniform in 0..1, (N, K)."""

Noise = tuple[Floats, Floats, float]
"""Deviations of a state, (14,), its lowest and highest values, (14, 2), and the height of the
shoulders above the hips, m."""


@inlined_kernel
def clip_state(state: Floats, limits: Floats) -> None:
    """Clip a state (14,) to its ``limits`` (14, 2)."""
    for d in range(N_STATE):
        state[d] = min(max(state[d], limits[d, 0]), limits[d, 1])


@inlined_kernel
def pivot(state: Floats, source: Floats, lever_m: float) -> None:
    """Move a rotated torso so that the shoulders, ``lever_m`` above the hips, keep their place."""
    state[TORSO_Y] += lever_m * (sin(state[ROLL]) - sin(source[ROLL]))
    state[TORSO_X] -= lever_m * (sin(state[PITCH]) - sin(source[PITCH]))


@kernel
def combine(
    torso: Floats, left: Floats, left_ratings: Floats, right: Floats, right_ratings: Floats, n: int
) -> Floats:
    """Return ``torso`` (14,) with the best of both arms, (2 n, 14).

    The first n states pair the i-th best left arm with the i-th best right arm. The others pair the
    best left arm with the second to the (n/2 + 1)-th best right arm, and vice versa.
    """
    lefts, rights = least_of(left_ratings, n + 1), least_of(right_ratings, n + 1)
    states = np.empty((2 * n, N_STATE))
    for i in range(2 * n):
        for d in range(N_STATE):
            states[i, d] = torso[d]
        j = i - n
        if i < n:
            one, other = i, i
        elif j < n // 2:
            one, other = 0, j + 1
        else:
            one, other = j - n // 2 + 1, 0
        for d in range(ARM_ANGLES):
            states[i, _LEFT + d] = left[lefts[one], d]
            states[i, _RIGHT + d] = right[rights[other], d]
    return states


@kernel
def move_all(
    sources: Floats,
    noise: Noise,
    differing: int,
    difference_scale: float,
    numbers: Numbers,
) -> Floats:
    """Return states (N, 14) around ``sources`` (M, 14), all joints moved together.

    Every second state rotates about the shoulders. In the first half, states in turn move only the
    torso, only the left arm, and only the right arm. The last ``differing`` states move by the
    difference of two sources, which follows the flat directions of the cost (differential
    evolution). ``numbers`` are (N, 14) and (N, 2).
    """
    sigma, limits, lever_m = noise
    normals, uniforms = numbers
    n, m = normals.shape[0], sources.shape[0]
    states = np.empty((n, N_STATE))
    for i in range(n):
        source, state = sources[i % m], states[i]
        for d in range(N_STATE):
            state[d] = source[d] + sigma[d] * normals[i, d]
        if i % 2 == 1:
            pivot(state, source, lever_m)
        if i >= n - differing:
            base = sources[(i - (n - differing)) % m]
            one, other = sources[int(uniforms[i, 0] * m)], sources[int(uniforms[i, 1] * m)]
            for d in range(N_STATE):
                rest = _NOISE_OF_DIFFERENCE * (state[d] - source[d])
                state[d] = base[d] + difference_scale * (one[d] - other[d]) + rest
        elif i < n // 2:
            part = i % 3
            for d in range(N_STATE):
                is_left = _LEFT <= d < _RIGHT
                is_right = _RIGHT <= d < _RIGHT + ARM_ANGLES
                of = 1 if is_left else (2 if is_right else 0)
                if of != part:
                    state[d] = source[d]
        clip_state(state, limits)
    return states
