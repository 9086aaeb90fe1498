"""How the particles of one estimation cycle follow from those of the one before.

A resampler chooses *ancestors*: for each new particle the index of the old one whose neighbourhood
it is drawn from. The filter then adds noise to all but the first, which is kept as it is:

    d_1^k = d_best^{k-1},    d_i^k = d_ancestor(i)^{k-1} + N(0, sigma_beta^2 E),  i > 1

Two strategies are there (paper, section III-C), behind one signature:

``drs``
    The paper's deterministic resampling. The particles are ranked by cost; the best e N survive,
    each as its own ancestor, and the rest are redrawn around the single best one. No weights, no
    random numbers: only the order of the costs matters. (The name is the paper's. It has nothing to
    do with "deterministic" schemes that copy particles in proportion to weights, such as residual
    or fixed-offset systematic resampling.)
``srs``
    Stratified resampling (Kitagawa 1996). Weights exp(-W^2 / (2 sigma_gamma^2)), and one uniform
    number in each of N equal strata of their cumulative sum.

In doubt take ``drs``: with a few hundred particles it concentrates on what fits.
"""

from __future__ import annotations

from collections.abc import Callable
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Ancestors = NDArray[np.intp]
Resampler = Callable[[FloatArray, float, float, np.random.Generator], Ancestors]
"""(costs (N,), survival rate e, sigma_gamma px, generator) -> ancestors (N,); the first is best."""


def deterministic(
    costs: FloatArray, survival_rate: float, sigma_gamma_px: float, rng: np.random.Generator
) -> Ancestors:
    """Algorithm "DRS": ancestors (N,) from the order of ``costs`` (N,) alone.

    The survivors come in no particular order after the first: whoever is an ancestor once is so at
    any place in the list, so a partition does the work of a sort.
    """
    n = len(costs)
    survivors = max(1, int(survival_rate * n))
    best = int(np.argmin(costs))
    ancestors = np.full(n, best, dtype=np.intp)
    if survivors < n:
        kept = np.argpartition(costs, survivors - 1)[:survivors]
    else:
        kept = np.arange(n)
    # Equal costs may leave the best one out of the partition; it has its place already.
    others = kept[kept != best][: survivors - 1]
    ancestors[1 : 1 + len(others)] = others
    return ancestors


def srs_weights(costs: FloatArray, sigma_gamma_px: float) -> FloatArray:
    """Normalized probabilities (N,) of ``costs`` (N,): p = exp(-W^2 / (2 sigma_gamma^2)) / sum p.

    Computed relative to the best particle, so that large costs do not make all of them 0.
    """
    exponents = -(costs.astype(np.float64) ** 2) / (2.0 * sigma_gamma_px**2)
    weights = np.exp(exponents - exponents.max())
    normalized: FloatArray = weights / weights.sum()
    return normalized


def stratified(
    costs: FloatArray, survival_rate: float, sigma_gamma_px: float, rng: np.random.Generator
) -> Ancestors:
    """Algorithm "SRS": ancestors (N,) drawn from the weights of ``costs`` (N,), the best first."""
    n = len(costs)
    cumulative = np.cumsum(srs_weights(costs, sigma_gamma_px))
    cumulative[-1] = 1.0
    numbers = (np.arange(1, n) + rng.random(n - 1)) / n
    ancestors = np.empty(n, dtype=np.intp)
    ancestors[0] = np.argmin(costs)
    ancestors[1:] = np.searchsorted(cumulative, numbers)
    return ancestors


STRATEGIES: MappingProxyType[str, Resampler] = MappingProxyType(
    {"drs": deterministic, "srs": stratified}
)
"""Every strategy by name."""
