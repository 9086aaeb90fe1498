"""Error measures, by their standard names.

``MPJPE`` is the mean distance between estimated and true joints. ``PA-MPJPE`` is the same after the
best similarity transform (Procrustes): the error that is left without position, size and heading of
the person. All functions take leading dimensions, such as runs and images.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def distances_m(estimates_m: FloatArray, truth_m: FloatArray) -> FloatArray:
    """Return the distance of each joint (..., k) of ``estimates_m`` (..., k, 3) from the truth."""
    distances: FloatArray = np.linalg.norm(estimates_m - truth_m, axis=-1)
    return distances


def align(estimates_m: FloatArray, truth_m: FloatArray) -> FloatArray:
    """Move, turn and scale each set of joints (..., k, 3) to lie as near to the truth as it can.

    The least-squares solution of Umeyama (1991): with both sets centred and U S V^T the singular
    value decomposition of truth^T estimate, the rotation is U D V^T, where D mirrors the last axis
    back if U V^T were a reflection, and the scale is trace(S D) / |estimate|^2. Joints that all lie
    in one point cannot be scaled and end in the middle of the truth.
    """
    middle_m = truth_m.mean(axis=-2, keepdims=True)
    target = truth_m - middle_m
    source = estimates_m - estimates_m.mean(axis=-2, keepdims=True)
    u, s, vt = np.linalg.svd(np.swapaxes(target, -1, -2) @ source)
    mirror = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    s[..., -1] *= mirror
    u[..., :, -1] *= mirror[..., None]
    extent = np.sum(source**2, axis=(-1, -2))
    scale = np.divide(s.sum(axis=-1), extent, out=np.zeros_like(extent), where=extent > 0)
    aligned: FloatArray = scale[..., None, None] * source @ np.swapaxes(u @ vt, -1, -2) + middle_m
    return aligned


def acceleration_error(difference_m: FloatArray, stamps_ns: NDArray[np.int64]) -> float:
    """Return the mean difference of the accelerations of joints (n, k, 3), m/s^2.

    By second differences over three consecutive images; where one is missing, none counts.

    Args:
        difference_m: estimate minus truth, (n, k, 3), metres; nan where there is none.
        stamps_ns: of the images, (n,).

    Returns:
        nan if there are no three such images.
    """
    steps_s = np.diff(stamps_ns - stamps_ns[0]) / 1e9
    period_s = float(np.median(steps_s))
    is_even = np.abs(steps_s - period_s) < 0.2 * period_s
    second = (difference_m[:-2] - 2 * difference_m[1:-1] + difference_m[2:]) / period_s**2
    norms = np.linalg.norm(second, axis=2)[is_even[:-1] & is_even[1:]]
    return float(np.nanmean(norms)) if np.isfinite(norms).any() else float("nan")


def angle_errors_deg(estimates_rad: FloatArray, truth_rad: FloatArray) -> FloatArray:
    """Return how far angles (...) are apart, the shorter way round, 0 to 180 degrees."""
    turns = (np.asarray(estimates_rad) - truth_rad + np.pi) % (2.0 * np.pi) - np.pi
    errors: FloatArray = np.abs(np.degrees(turns))
    return errors
