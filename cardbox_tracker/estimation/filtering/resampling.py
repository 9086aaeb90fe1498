"""How the particles of one estimation cycle follow from those of the one before.

A resampler chooses *ancestors*: for each new particle the index of the old one whose neighbourhood
it is drawn from. The filter then adds noise to all but the first, which is kept as it is:

    d_1^k = d_best^{k-1},    d_i^k = d_ancestor(i)^{k-1} + N(0, sigma_beta^2 E),  i > 1

That first particle is the *elite*. The paper keeps it in both of its strategies; without it
(``elite=False``) all N ancestors are drawn, and all get noise, as in a textbook particle filter.

The strategies of the paper (section III-C) and, beside them, the standard schemes:

``drs``
    The paper's deterministic resampling. The particles are ranked by cost; the best e N survive,
    each as its own ancestor, and the rest are redrawn around the single best one. No weights, no
    random numbers: only the order of the costs matters. (The name is the paper's. It has nothing to
    do with "deterministic" schemes that copy particles in proportion to weights, such as residual
    or fixed-offset systematic resampling.) It is truncation selection with an elite, as evolution
    strategies have it, more than a way of sampling from a posterior.
``srs``
    Stratified resampling (Kitagawa 1996). Weights exp(-W^2 / (2 sigma_gamma^2)), and one uniform
    number in each of N equal strata of their cumulative sum. The paper's comparison.
``systematic``
    The same with one uniform number for all strata (Carpenter, Clifford & Fearnhead 1999). The
    least random numbers and, mostly, the least variance; what many libraries take by default.
``residual``
    floor(n w) copies of each particle, and independent draws for what is left over (Liu & Chen
    1998).
``multinomial``
    N independent draws from the weights (Gordon, Salmond & Smith 1993): the bootstrap filter, and
    the one with the highest variance. For comparison only.

Douc, Cappe & Moulines ("Comparison of resampling schemes for particle filtering", 2005) show that
residual and stratified resampling never have more variance than multinomial; Gerber, Chopin &
Whiteley ("Negative association, ordering and convergence of resampling methods", 2019) have the
state of the theory.
All four share the weights, and the weights decide: the paper's sigma_gamma is so wide that they
hardly differ. Stratified and systematic resampling then keep nearly every particle once, and the
swarm spreads from cycle to cycle; the chance copies of multinomial and residual draws, a fault
elsewhere, hold it together a little. ``docs/evaluation`` has the measurement.

In doubt take ``drs``: with a few hundred particles it concentrates on what fits.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.estimation.filtering.particle_kernels import truncate

FloatArray = NDArray[np.float64]
Ancestors = NDArray[np.intp]


class Resampler(Protocol):
    """A strategy."""

    def __call__(
        self,
        costs: FloatArray,
        survival_rate: float,
        sigma_gamma_px: float,
        rng: np.random.Generator,
        elite: bool = True,
    ) -> Ancestors:
        """Return the ancestors (N,) of the next particles.

        Args:
            costs: of the present particles, (N,), px.
            survival_rate: e; DRS alone looks at it.
            sigma_gamma_px: width of the weights; DRS does not look at it.
            rng: source of random numbers.
            elite: the first ancestor is the best particle, and the others are drawn; without it
                all are.
        """


def deterministic(
    costs: FloatArray,
    survival_rate: float,
    sigma_gamma_px: float,
    rng: np.random.Generator,
    elite: bool = True,
) -> Ancestors:
    """Algorithm "DRS": ancestors (N,) from the order of ``costs`` (N,) alone.

    The best particle comes first with or without ``elite``: it survives in either case. The other
    survivors keep their order, so a partition does the work of a sort; of equals, the first ones
    survive.
    """
    # The product may fall short of a whole number by rounding, as 0.29 times 100 does.
    survivors = max(1, int(survival_rate * len(costs) + 1e-9))
    ancestors: Ancestors = truncate(costs, survivors)
    return ancestors


def srs_weights(costs: FloatArray, sigma_gamma_px: float) -> FloatArray:
    """Normalized probabilities (N,) of ``costs`` (N,): p = exp(-W^2 / (2 sigma_gamma^2)) / sum p.

    Computed relative to the best particle, so that large costs do not make all of them 0.
    """
    exponents = -(costs.astype(np.float64) ** 2) / (2.0 * sigma_gamma_px**2)
    weights = np.exp(exponents - exponents.max())
    normalized: FloatArray = weights / weights.sum()
    return normalized


def _draw(costs: FloatArray, sigma_gamma_px: float, numbers: FloatArray, elite: bool) -> Ancestors:
    """Ancestors where ``numbers``, each in [0, 1), fall in the cumulative weights L_i.

    With ``elite`` the best particle comes first, and the last N - 1 of the numbers count.
    """
    cumulative = np.cumsum(srs_weights(costs, sigma_gamma_px))
    cumulative[-1] = 1.0
    n = len(costs)
    ancestors = np.empty(n, dtype=np.intp)
    first = int(elite)
    if elite:
        ancestors[0] = np.argmin(costs)
    # psi = min {j | r <= L_j}
    ancestors[first:] = np.searchsorted(cumulative, numbers[first:])
    return ancestors


def stratified(
    costs: FloatArray,
    survival_rate: float,
    sigma_gamma_px: float,
    rng: np.random.Generator,
    elite: bool = True,
) -> Ancestors:
    """Algorithm "SRS": ancestors (N,) drawn from the weights of ``costs`` (N,), one a stratum."""
    n = len(costs)
    return _draw(costs, sigma_gamma_px, (np.arange(n) + rng.random(n)) / n, elite)


def systematic(
    costs: FloatArray,
    survival_rate: float,
    sigma_gamma_px: float,
    rng: np.random.Generator,
    elite: bool = True,
) -> Ancestors:
    """Ancestors (N,) drawn from the weights, at the same place in each stratum."""
    n = len(costs)
    return _draw(costs, sigma_gamma_px, (np.arange(n) + rng.random()) / n, elite)


def multinomial(
    costs: FloatArray,
    survival_rate: float,
    sigma_gamma_px: float,
    rng: np.random.Generator,
    elite: bool = True,
) -> Ancestors:
    """Ancestors (N,) drawn from the weights, independent of each other."""
    return _draw(costs, sigma_gamma_px, rng.random(len(costs)), elite)


def residual(
    costs: FloatArray,
    survival_rate: float,
    sigma_gamma_px: float,
    rng: np.random.Generator,
    elite: bool = True,
) -> Ancestors:
    """Ancestors (N,): floor(n w) copies of each particle, the rest drawn from what remains.

    n is the number to draw: N, or N - 1 beside the elite.
    """
    drawn = len(costs) - int(elite)
    expected = drawn * srs_weights(costs, sigma_gamma_px)
    copies = np.floor(expected).astype(np.intp)
    missing = drawn - int(copies.sum())
    if missing > 0:
        cumulative = np.cumsum(expected - copies)
        numbers = rng.random(missing) * cumulative[-1]
        np.add.at(copies, np.searchsorted(cumulative, numbers, side="right"), 1)
    ancestors = np.repeat(np.arange(len(costs)), copies)
    return np.concatenate([[np.argmin(costs)], ancestors]) if elite else ancestors


STRATEGIES: MappingProxyType[str, Resampler] = MappingProxyType(
    {
        "drs": deterministic,
        "srs": stratified,
        "systematic": systematic,
        "residual": residual,
        "multinomial": multinomial,
    }
)
"""Every strategy by name."""
