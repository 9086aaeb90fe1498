"""The peers by hand: weights of the annealed filter, and searches of a known minimum."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.person.posture import JOINT_LIMITS, reference_posture
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.config import paper_preset
from lab.experiments.peers import Annealed, CmaEs, Flat, WholeSearch, annealed


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_the_asked_share_survives_whatever_the_scale_of_the_costs(share: float) -> None:
    costs = np.random.default_rng(0).uniform(500.0, 3000.0, 200)
    for scale in (1.0, 100.0):
        weights = annealed(scale * costs, share)
        assert weights.sum() == pytest.approx(1.0)
        assert 1 / np.sum(weights**2) == pytest.approx(share * 200, rel=1e-3)
        assert np.argmax(weights) == np.argmin(costs)


@pytest.mark.parametrize("peer", [Flat, Annealed, CmaEs])
def test_a_peer_finds_a_minimum_within_its_ratings(peer: type[WholeSearch]) -> None:
    start = reference_posture("front")
    target = start + 0.5 * np.array([0.1, *[0.5] * 11])
    seen: list[FloatArray] = []

    def rate(postures: FloatArray) -> FloatArray:
        seen.append(postures.copy())
        distances: FloatArray = np.linalg.norm((postures - target) * [5.0, *[1.0] * 11], axis=1)
        return 1000.0 * distances

    search = peer(paper_preset(), 320 * 240, np.random.default_rng(1))
    found = search.start(rate, start)
    for _ in range(10):
        found = search.follow(rate)
    rated = np.concatenate(seen)
    assert len(rated) == 11 * 600
    assert np.all((rated >= JOINT_LIMITS[:, 0] - 1e-9) & (rated <= JOINT_LIMITS[:, 1] + 1e-9))
    before, after = rate(np.array([start, found]))
    assert after < 0.5 * before
