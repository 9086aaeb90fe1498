"""Learned prior of one arm's posture.

The outline hardly shows whether an arm points to the camera or away from it. The prior is a mixture
of Gaussians over six numbers, the unit vectors of upper arm and forearm in the torso's frame: x
forwards, y outwards (to the left for the left arm, to the right for the right one), z up.
``lab/fits/pose_prior.py`` learns it from motion capture; the data file names the source. Its unit
is the nat: -log p, about 0 at the likeliest posture, never above ``FLOOR_NATS``.

Both arms share it, because a positive abduction raises either arm outwards.
"""

from __future__ import annotations

import json
from functools import cache
from importlib import resources
from math import exp, log
from typing import Any

import numpy as np

from cardbox_tracker.common.compiling import index, inlined_kernel
from cardbox_tracker.person.sizes import FloatArray

FLOOR_NATS = 8.0
"""Approximate cost of a posture that is not in the motion capture; it is finite, so that the image
can still outweigh it."""

_DATA = "pose_prior.json"


@cache
def _data() -> dict[str, Any]:
    text = resources.files(__package__).joinpath(_DATA).read_text(encoding="utf-8")
    data: dict[str, Any] = json.loads(text)
    return data


@cache
def load_gmm() -> FloatArray:
    """Return the mixture, (K, 28), read-only; a row is a Gaussian with mean m and covariance C.

    A row has the logarithm of weight / normalization, minus an offset that makes the lowest cost
    about 0 (1 number), m (6), and the lower triangle of L^-1 with C = L L^T, row by row (21). So
    log p = log(sum of exp(row[0] - |L^-1 (x - m)|^2 / 2)).
    """
    data = _data()
    shares, means = np.array(data["shares"]), np.array(data["means"])
    whitening = np.linalg.inv(np.linalg.cholesky(np.array(data["covariances"])))
    logs = np.log(np.diagonal(whitening, axis1=1, axis2=2)).sum(axis=1)
    constants = np.log(shares) + logs - 0.5 * means.shape[1] * np.log(2 * np.pi) - data["offset"]
    rows, columns = np.tril_indices(means.shape[1])
    gmm: FloatArray = np.hstack([constants[:, None], means, whitening[:, rows, columns]])
    gmm.setflags(write=False)
    return gmm


def sample_bank() -> FloatArray:
    """Sample arms from the mixture: unit vectors of upper arm and forearm, (3000, 6)."""
    data, count = _data(), 3000
    rng = np.random.default_rng(0)
    shares = np.array(data["shares"])
    chosen = rng.choice(len(shares), count, p=shares / shares.sum())
    means = np.array(data["means"])
    # Like rng.multivariate_normal, which would decompose the covariance of every sample again.
    axes, squares, _ = np.linalg.svd(np.array(data["covariances"]))
    factors = axes * np.sqrt(squares)[:, None, :]
    noise = rng.standard_normal((count, means.shape[1]))
    drawn = np.array([means[k] + factors[k] @ one for k, one in zip(chosen, noise, strict=True)])
    limbs = drawn.reshape(count, 2, 3)
    limbs /= np.linalg.norm(limbs, axis=2, keepdims=True)
    return drawn


@inlined_kernel
def nats_of(directions: Any, gaussians: Any, rest: float, logs: Any) -> float:
    """Return -log(p + ``rest``), nats, of unit vectors (6,) of upper arm and forearm.

    ``gaussians`` (28, K) is the transpose of :func:`load_gmm`; the loop over the Gaussians has no
    inner loops, so that it can be vectorized. ``rest`` is the density of postures that the mixture
    does not know; ``logs`` (K,) is scratch.
    """
    g = gaussians
    d0, d1, d2 = directions[0], directions[1], directions[2]
    d3, d4, d5 = directions[3], directions[4], directions[5]
    for one in range(g.shape[1]):
        k = index(one)
        x0, x1, x2 = d0 - g[1, k], d1 - g[2, k], d2 - g[3, k]
        x3, x4, x5 = d3 - g[4, k], d4 - g[5, k], d5 - g[6, k]
        y = g[7, k] * x0
        squares = y * y
        y = g[8, k] * x0 + g[9, k] * x1
        squares += y * y
        y = g[10, k] * x0 + g[11, k] * x1 + g[12, k] * x2
        squares += y * y
        y = g[13, k] * x0 + g[14, k] * x1 + g[15, k] * x2 + g[16, k] * x3
        squares += y * y
        y = g[17, k] * x0 + g[18, k] * x1 + g[19, k] * x2 + g[20, k] * x3 + g[21, k] * x4
        squares += y * y
        y = g[22, k] * x0 + g[23, k] * x1 + g[24, k] * x2 + g[25, k] * x3 + g[26, k] * x4
        y += g[27, k] * x5
        squares += y * y
        logs[k] = g[0, k] - 0.5 * squares
    density = rest
    for one in range(g.shape[1]):
        # Smaller summands would not change the sum, which is at least exp(-FLOOR_NATS).
        if logs[one] > -20.0:
            density += exp(logs[one])
    return -log(density)
