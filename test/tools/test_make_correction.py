"""The network learns where keypoints are beside those that were found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.estimation.filtering.low_pass import LowPass
from cardbox_tracker.estimation.filtering.networks import read_recurrent_network
from tools import make_correction as tool
from tools import networks

FEATURES = 5


def session(seed: int, images: int = 400) -> tool.Samples:
    """Somebody whose forearms hang, but in truth turn by the sum of what was seen twice."""
    rng = np.random.default_rng(seed)
    features = rng.standard_normal((images, 2, FEATURES))
    arms = [[[0.2 * side, y, 2.0] for y in (0.0, 0.3, 0.6)] for side in (1, -1)]
    found = np.tile(np.reshape(arms, (6, 3)), (images, 1, 1))
    true = found.copy()
    for arm, (elbow, hand) in enumerate(((1, 2), (4, 5))):
        seen = features[:, arm, 0]
        angle = 0.4 * (seen[1:] + seen[:-1])
        turned = 0.3 * np.stack([np.zeros_like(angle), np.cos(angle), np.sin(angle)], axis=1)
        true[1:, hand] = true[1:, elbow] + turned
    true[::7] = np.nan
    return tool.Samples(features, found, true, np.arange(images) * 66_666_667)


def test_what_is_missing_is_learned_and_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("torch", reason="PyTorch is not installed")
    for name, value in {
        "NETWORKS": 2,
        "EPOCHS": 30,
        "STEADY": 0.0,
        "NOISE": 0.1,
        "LENGTH": 40,
        "BATCH": 4,
    }.items():
        monkeypatch.setattr(tool, name, value)
    network = tool.learn([session(seed) for seed in range(4)])
    other = session(9)
    before, _, _, after, _, _ = tool.check(network, other)
    assert after < 0.5 * before
    networks.save(network, tmp_path / "network.npz", "a test")
    stored = read_recurrent_network(tmp_path / "network.npz")
    assert np.allclose(tool.corrected(stored, other), tool.corrected(network, other), atol=1e-4)


def test_it_goes_on_with_what_was_learned(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("torch", reason="PyTorch is not installed")
    for name, value in {"EPOCHS": 1, "EPOCHS_ON": 0, "LENGTH": 40, "BATCH": 4}.items():
        monkeypatch.setattr(tool, name, value)
    sessions, other = [session(0), session(1)], session(9)
    begin = tool.learn(sessions)
    same = tool.learn(sessions, seed=5, begin=begin)
    assert np.allclose(tool.corrected(same, other), tool.corrected(begin, other), atol=1e-6)


def test_it_learns_with_the_low_pass_of_the_tracker(monkeypatch: pytest.MonkeyPatch) -> None:
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    monkeypatch.setattr(tool, "SMOOTHING_S", 0.08)
    points = np.random.default_rng(0).standard_normal((2, 30, 6, 3))
    periods_s = np.array([1 / 15, 1 / 30])
    found = tool._steadied(torch.tensor(points), torch.tensor(periods_s)).numpy()
    for sequence, period_s, steadied in zip(points, periods_s, found, strict=True):
        low_pass = LowPass(0.08)
        expected = [low_pass(one, float(period_s)) for one in sequence]
        assert np.allclose(steadied, expected, atol=1e-6)


def test_errors_are_of_all_keypoints_and_without_the_shoulders() -> None:
    true = np.zeros((4, 6, 3))
    found = true.copy()
    found[..., 2] = 0.1
    found[:, 2, 2] = 0.4
    stamps_ns = np.arange(4) * 100_000_000
    samples = tool.Samples(np.zeros((4, 2, 1)), found, true, stamps_ns)
    # One of six is 30 cm farther away than the others, which are 10 cm off.
    assert tool.errors(found, samples) == pytest.approx((15.0, 5.0, 0.0))
    # It shakes by 30 cm: second differences of 60 cm in 0.1 s, of one of six.
    found[1::2, 2, 2] = 0.1
    assert tool.errors(found, samples)[2] == pytest.approx(10.0)


def test_errors_across_a_pause_are_no_acceleration() -> None:
    found = np.zeros((6, 6, 3))
    found[3:, :, 2] = 1.0
    stamps_ns = np.array([0, 1, 2, 6, 7, 8]) * 100_000_000
    samples = tool.Samples(np.zeros((6, 2, 1)), found, np.zeros((6, 6, 3)), stamps_ns)
    assert tool.errors(found, samples)[2] == 0.0
