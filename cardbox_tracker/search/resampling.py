"""Resampling: the choice of the particles that the next iteration starts from.

Resampling chooses *ancestors*: for each new particle the index of the old particle around which it
is drawn. The filter then adds noise to all particles except the first:

    d_1^k = d_best^{k-1},    d_i^k = d_ancestor(i)^{k-1} + N(0, sigma_beta^2 E),  i > 1

The first particle is the *elite*. The paper keeps it in both of its strategies; without it
(``elite=False``) all N ancestors are drawn, and all get noise, as in a textbook particle filter.

There are two families. :func:`truncation` only uses the order of the costs:

``drs``
    The paper's deterministic resampling. The particles are ranked by cost; the best e N survive,
    each as its own ancestor, and the rest are redrawn around the single best one. It uses neither
    weights nor random numbers. It is the truncation selection with an elite of evolution
    strategies, rather than a sampling from a posterior. The name is the paper's; other
    "deterministic" schemes, such as residual or fixed-offset systematic resampling, copy particles
    in proportion to weights.

The others draw from weights exp(-W^2 / (2 sigma_gamma^2)). Each is a *scheme*, a function
``scheme(weights, n, rng)`` that returns ``n`` indices:

``srs``
    Stratified resampling (Kitagawa 1996) draws one uniform number in each of n equal strata of the
    cumulative weights. The paper compares ``drs`` with it.
``systematic``
    Systematic resampling uses one uniform number for all strata (Carpenter, Clifford & Fearnhead
    1999). It needs the fewest random numbers and usually has the least variance; many libraries use
    it by default.
``residual``
    Residual resampling makes floor(n w) copies of each particle and draws the rest independently
    (Liu & Chen 1998).
``multinomial``
    The bootstrap filter makes n independent draws (Gordon, Salmond & Smith 1993). This scheme has
    the highest variance and serves only for comparison.

Douc, Cappe & Moulines ("Comparison of resampling schemes for particle filtering", 2005) show that
residual and stratified resampling never have more variance than multinomial; Gerber, Chopin &
Whiteley ("Negative association, ordering and convergence of resampling methods", 2019) give the
state of the theory. All four schemes share the weights and hardly differ (``docs/evaluation``).

``drs`` is the recommended strategy: with a few hundred particles it concentrates on states that
fit. The others do so, too, if sigma_gamma is far below Table I's; ``drs`` needs none. A new scheme
is a function in this module and an entry in ``SCHEMES``.
"""

from __future__ import annotations

from collections.abc import Callable
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.search.particle_kernels import truncate

FloatArray = NDArray[np.float64]
Indices = NDArray[np.intp]

Scheme = Callable[[FloatArray, int, np.random.Generator], Indices]
"""Takes normalized weights (N,), the number of draws, and the source of random numbers."""


def stratified(weights: FloatArray, n: int, rng: np.random.Generator) -> Indices:
    """Return ``n`` indices, one drawn in each of n strata of the weights (N,)."""
    return _inverse_cdf(weights, (np.arange(n) + rng.random(n)) / n)


def systematic(weights: FloatArray, n: int, rng: np.random.Generator) -> Indices:
    """Return ``n`` indices, at the same place in each of n strata of the weights (N,)."""
    return _inverse_cdf(weights, (np.arange(n) + rng.random()) / n)


def multinomial(weights: FloatArray, n: int, rng: np.random.Generator) -> Indices:
    """Return ``n`` indices, drawn independently from the weights (N,)."""
    return _inverse_cdf(weights, rng.random(n))


def residual(weights: FloatArray, n: int, rng: np.random.Generator) -> Indices:
    """Return floor(n w) copies of each index; the rest is drawn from the remaining weights."""
    copies = np.floor(n * weights).astype(np.intp)
    rest = n - int(copies.sum())
    if rest > 0:
        cumulative = np.cumsum(n * weights - copies)
        drawn = np.searchsorted(cumulative, rng.random(rest) * cumulative[-1], side="right")
        np.add.at(copies, drawn, 1)
    return np.repeat(np.arange(len(weights)), copies)


def _inverse_cdf(weights: FloatArray, numbers: FloatArray) -> Indices:
    """Return Psi = min {j | r <= L_j} for each r of ``numbers`` in [0, 1)."""
    cumulative = np.cumsum(weights)
    cumulative[-1] = 1.0
    return np.searchsorted(cumulative, numbers)


SCHEMES: MappingProxyType[str, Scheme] = MappingProxyType(
    {
        "srs": stratified,
        "systematic": systematic,
        "residual": residual,
        "multinomial": multinomial,
    }
)
"""Schemes that draw from weights, by name."""

STRATEGIES: tuple[str, ...] = ("drs", *SCHEMES)
"""Allowed values of ``strategy``."""


def gaussian_weights(costs: FloatArray, sigma_gamma_px: float) -> FloatArray:
    """Return the weights p / sum p of ``costs`` W (N,) with p = exp(-W^2 / (2 sigma_gamma^2)).

    They are computed relative to the best particle, so that large costs do not make all p 0.
    """
    exponents = -(costs.astype(np.float64) ** 2) / (2.0 * sigma_gamma_px**2)
    weights = np.exp(exponents - exponents.max())
    normalized: FloatArray = weights / weights.sum()
    return normalized


def truncation(costs: FloatArray, survival_rate: float) -> Indices:
    """Return ancestors (N,) from the order of ``costs`` (N,) (paper, algorithm "DRS").

    The best particle comes first, with or without an elite; the other survivors keep their order,
    so a partition suffices instead of a sort. Of equal costs the first ones survive.
    """
    # The product may fall short of a whole number by rounding, as 0.29 times 100 does.
    survivors = max(1, int(survival_rate * len(costs) + 1e-9))
    ancestors: Indices = truncate(costs, survivors)
    return ancestors


def resample(
    strategy: str,
    costs: FloatArray,
    survival_rate: float,
    sigma_gamma_px: float,
    rng: np.random.Generator,
    elite: bool = True,
) -> Indices:
    """Return the ancestors (N,) of the next particles for their ``costs`` (N,), px.

    ``drs`` uses the ``survival_rate`` and draws nothing, the others ``sigma_gamma_px``. With
    ``elite`` the best particle replaces the first draw.
    """
    if strategy == "drs":
        return truncation(costs, survival_rate)
    weights = gaussian_weights(costs, sigma_gamma_px)
    ancestors = SCHEMES[strategy](weights, len(costs), rng)
    if elite:
        ancestors[0] = np.argmin(costs)
    return ancestors
