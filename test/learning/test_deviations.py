"""The network learns how large errors are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cardbox_tracker.estimation.filtering.result_features import FEATURES
from learning import deviations as tool
from learning import networks


def session(seed: int, images: int = 2000) -> tool.Errors:
    """Somebody whose errors are as large as the first feature says, beside each arm."""
    rng = np.random.default_rng(seed)
    features = rng.standard_normal((images, 2, FEATURES))
    beside = 0.1 * np.exp(0.5 * features[:, :, 0])
    torso = np.repeat(beside.mean(axis=1)[:, None], 3, axis=1)
    arms = np.repeat(beside, 4, axis=1)
    true = np.hstack([torso, arms])
    return tool.Errors(features, np.abs(true * rng.standard_normal(true.shape)), true)


def test_the_size_of_errors_is_learned(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("torch", reason="PyTorch is not installed")
    monkeypatch.setattr(tool, "SHAPE", networks.Shape((16,), 2, 60))
    network = tool.scaled(tool.learn([session(0), session(1)]), [session(3)])
    other = session(2)
    before, _, after, least = tool.check(network, other)
    # Two deviations of a normal distribution hold 95.4 %.
    assert before == pytest.approx(95.4, abs=1.5)
    assert after == pytest.approx(95.0, abs=2.0) and least > 91.0
    found = network(other.features[:, 0])
    truth = np.log(other.stddevs_rad[:, 3:7])
    assert np.corrcoef(found[:, 3], truth[:, 0])[0, 1] > 0.8


def test_particles_deviations_are_judged_beside_the_learned_ones() -> None:
    errors = tool.Errors(
        np.zeros((4, 2, FEATURES)), np.full((4, 11), 0.1), np.full((4, 11), [0.04] + [0.06] * 10)
    )
    nothing = networks.Network(
        np.zeros(FEATURES),
        np.ones(FEATURES),
        2.5,
        (np.zeros((1, FEATURES, 7)),),
        (np.full((1, 1, 7), np.log(0.06)),),
        np.ones(7),
    )
    # The particles' deviation of one of eleven angles is too small.
    assert tool.check(nothing, errors) == pytest.approx((1000 / 11, 0.0, 100.0, 100.0))


def test_errors_are_those_of_the_angles_where_the_truth_is_known(make_samples: Any) -> None:
    one = make_samples(5)
    # The arms hang along the torso, so all angles are 0.
    one.states[:, 1:12] = 0.0
    one.states[3, 3] = 0.2
    # The left forearm comes forward by a right angle, seen by a level camera.
    one.true_m[4, 2] = one.true_m[4, 1] + (0.0, 0.0, -0.3)
    one.true_m[0, 0, 0] = one.torso_rad[1, 0] = np.nan
    one.stddevs[:] = np.arange(14)
    level = type(one)(**{**vars(one), "pitch_rad": np.array(0.0)})
    found = tool.errors_of(level)
    np.testing.assert_array_equal(found.features, one.result_features[2:])
    assert found.errors_rad[0] == pytest.approx(np.zeros(11), abs=1e-6)
    # d4 is the yaw of the torso, so it is the third of the angles without d1.
    assert found.errors_rad[1] == pytest.approx(np.eye(11)[2] * 0.2, abs=1e-6)
    assert np.sort(found.errors_rad[2])[-1] == pytest.approx(np.pi / 2)
    np.testing.assert_array_equal(found.stddevs_rad[0], np.arange(1.0, 12.0))
