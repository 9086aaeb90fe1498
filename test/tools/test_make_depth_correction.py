"""The network learns what recordings lack in depth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.estimation.filtering.networks import read_network
from cardbox_tracker.estimation.filtering.result_features import features_of
from cardbox_tracker.vision.camera import Camera
from tools import make_depth_correction as tool
from tools import networks

COST = WholeBodyCost(
    BodyModel.of(distance_m=2.3),
    Camera(320, 240, 300.0, 300.0, 159.5, 119.5),
    WholeBodyCostConfig(),
)


def session(seed: int, images: int = 400) -> tool.Samples:
    """Somebody whose hands are the farther away than found, the more the shoulder is flexed."""
    rng = np.random.default_rng(seed)
    states = 0.3 * rng.standard_normal((images, 14))
    found = np.array([COST.keypoints(state) for state in states])
    true = found.copy()
    for hand, flexion in ((2, 5), (5, 9)):
        true[:, hand, 2] += 0.3 * states[:, flexion]
    features = features_of(states, np.full((images, 14), 0.1), found, np.full(images, 0.9), 0.1)
    return tool.Samples(features, found, true)


def test_what_is_missing_is_learned_and_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("sklearn", reason="scikit-learn is not installed")
    monkeypatch.setattr(tool, "SHAPE", networks.Shape((64, 32), 4, 10))
    network = tool.learn([session(0), session(1)])
    other = session(2)
    before, _, after, _ = tool.check(network, other, 1.0)
    assert after < 0.7 * before
    networks.save(network, tmp_path / "network.npz", "a test")
    stored = read_network(tmp_path / "network.npz")
    features = other.features[:, 0]
    assert np.allclose(stored(features), network(features), atol=1e-4)


def test_errors_are_of_all_keypoints_and_without_the_shoulders() -> None:
    true = np.zeros((1, 6, 3))
    found = true.copy()
    found[..., 2] = 0.1
    found[0, 2, 2] = 0.4
    # One of six is 30 cm farther away than the others, which are 10 cm off.
    assert tool.errors_cm(found, true) == pytest.approx((15.0, 5.0))
