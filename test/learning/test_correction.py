"""The network learns where keypoints are beside those that were found."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation.filtering.correction import moved as moved_joints
from cardbox_tracker.estimation.filtering.low_pass import LowPass
from cardbox_tracker.estimation.filtering.networks import read_recurrent_network
from learning import correction as tool
from learning import networks
from learning.samples import Samples


@pytest.fixture
def session(make_samples: Any) -> Callable[[int], Samples]:
    """Somebody whose forearms hang, but in truth turn by the sum of what was seen twice."""

    def make(seed: int) -> Samples:
        one: Samples = make_samples(400, seed=seed)
        for arm, (elbow, hand) in enumerate(((1, 2), (4, 5))):
            seen = one.features[:, arm, 0]
            angle = 0.4 * (seen[1:] + seen[:-1])
            turned = 0.3 * np.stack([np.zeros_like(angle), np.cos(angle), np.sin(angle)], axis=1)
            one.true_m[1:, hand] = one.true_m[1:, elbow] + turned
        one.true_m[::7] = np.nan
        return one

    return make


def test_what_is_missing_is_learned_and_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, session: Callable[[int], Samples]
) -> None:
    pytest.importorskip("torch", reason="PyTorch is not installed")
    for name, value in {
        "NETWORKS": 2,
        "STEADY": 0.0,
        "NOISE": 0.1,
        "LENGTH": 40,
        "BATCH": 4,
    }.items():
        monkeypatch.setattr(tool, name, value)
    network = tool.learn([session(seed) for seed in range(4)], epochs=30)
    other = session(9)
    before, _, _, after, _, _ = tool.check(network, other)
    assert after < 0.5 * before
    networks.save(network, tmp_path / "network.npz", "a test")
    stored = read_recurrent_network(tmp_path / "network.npz")
    assert np.allclose(tool.corrected(stored, other), tool.corrected(network, other), atol=1e-4)


def test_too_few_images_are_refused(
    monkeypatch: pytest.MonkeyPatch, session: Callable[[int], Samples]
) -> None:
    """Recordings shorter than a sequence do not count; 400 images have 10 sequences of 40."""
    monkeypatch.setattr(tool, "LENGTH", 40)
    monkeypatch.setattr(tool, "BATCH", 21)
    with pytest.raises(CardboxError, match="20 sequences of 40 images; give 21 or more"):
        tool.learn([session(0), session(1)])
    monkeypatch.setattr(tool, "LENGTH", 401)
    with pytest.raises(CardboxError, match="the samples have 0 sequences"):
        tool.learn([session(0)])


def test_sequences_cover_a_recording_and_its_end(
    monkeypatch: pytest.MonkeyPatch, make_samples: Any
) -> None:
    monkeypatch.setattr(tool, "LENGTH", 4)
    samples = make_samples(10, stamps_ns=np.arange(10) * 50_000_000)
    samples.found_m[:, 0, 0] = np.arange(10)
    samples.true_m[3, 5, 1] = np.nan
    columns = tool._sequences([samples, make_samples(3)], np.zeros(5), np.ones(5))
    features, found, true, known, followed, period = columns
    assert found[:, :, 0, 0].tolist() == [[0, 1, 2, 3], [4, 5, 6, 7], [6, 7, 8, 9]]
    assert known.tolist() == followed.tolist() == [[1, 1, 1, 0], [1] * 4, [1] * 4]
    samples.true_m[:] += 1.0
    *_, known, followed, _ = tool._sequences([samples], np.zeros(5), np.ones(5))
    # A person who was never followed teaches chances, but no displacements.
    assert known.any() and not followed.any()
    assert np.isfinite(true).all() and period == pytest.approx(0.05)
    assert features[1] == pytest.approx(np.clip(samples.features[4:8], -2.5, 2.5))


def test_it_learns_with_the_low_pass_of_the_tracker(monkeypatch: pytest.MonkeyPatch) -> None:
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    monkeypatch.setattr(tool, "SMOOTHING_S", 0.08)
    points = np.random.default_rng(0).standard_normal((2, 30, 6, 3))
    periods_s = np.array([1 / 15, 1 / 30])
    found = tool._steadied(torch.tensor(points), tool._shares(periods_s, 30).double()).numpy()
    for sequence, period_s, steadied in zip(points, periods_s, found, strict=True):
        low_pass = LowPass(0.08)
        expected = [low_pass(one, float(period_s)) for one in sequence]
        assert np.allclose(steadied, expected, atol=1e-6)


def test_errors_are_of_all_keypoints_and_without_the_shoulders(make_samples: Any) -> None:
    samples = make_samples(4, stamps_ns=np.arange(4) * 100_000_000)
    found = samples.true_m + np.array([0.0, 0.0, 0.1])
    found[:, 2, 2] += 0.3
    # One of six is 30 cm farther away than the others, which are 10 cm off.
    assert tool.errors(found, samples) == pytest.approx((15.0, 5.0, 0.0))
    # It shakes by 30 cm: second differences of 60 cm in 0.1 s, of one of six.
    found[1::2, 2, 2] -= 0.3
    assert tool.errors(found, samples)[2] == pytest.approx(10.0)


def test_errors_across_a_pause_are_no_acceleration(make_samples: Any) -> None:
    samples = make_samples(6, stamps_ns=np.array([0, 1, 2, 6, 7, 8]) * 100_000_000)
    found = samples.true_m.copy()
    found[3:, :, 2] += 1.0
    assert tool.errors(found, samples)[2] == 0.0


def test_tensors_move_as_the_package_moves_joints() -> None:
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    rng = np.random.default_rng(3)
    found, answers = rng.normal(0.0, 0.5, (2, 4, 6, 3)), rng.normal(0.0, 0.2, (2, 4, 2, 9))
    moved = tool._moved(torch.tensor(found), torch.tensor(answers)).numpy()
    for place in np.ndindex(2, 4):
        # Directions of short vectors are smooth, so they differ a little.
        assert np.allclose(moved[place], moved_joints(found[place], answers[place]), atol=0.01)


def test_disagreement_shortens_the_correction(
    monkeypatch: pytest.MonkeyPatch, make_samples: Any
) -> None:
    """Networks that say 1 cm and 3 cm give 2 cm, and 1.6 cm as their deviation is 1 cm."""
    monkeypatch.setattr(tool, "SMOOTHING_S", 0.0)
    zero = [np.zeros((2, n, m)) for n, m in ((5, 4), (4, 9), (3, 9), (7, 2))]
    layers = [(one, np.zeros((2, 1, one.shape[2]))) for one in zero]
    said = np.zeros((2, 1, 9))
    said[:, 0, 2] = 0.1, 0.3
    last = np.zeros((2, 2, 9)), said
    network = tool.RecurrentNetwork(
        *(np.zeros(5), np.ones(5), 2.5, *layers[:3], (layers[3], last), np.full(9, 0.1))
    )
    samples = make_samples(3)
    for doubt, away_m in ((0.0, 0.02), (1.0, 0.02 * 4 / 5)):
        found = tool.corrected(network, samples, doubt)
        assert np.allclose(found - samples.found_m, (0.0, 0.0, away_m), atol=1e-6)
