"""Log-odds that are too sure become true on recordings that were not trained with."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("sklearn", reason="scikit-learn is not installed")

from cardbox_tracker.estimation.filtering.correction import N_ANSWERS, N_FEATURES
from cardbox_tracker.estimation.filtering.networks import RecurrentNetwork
from learning import odds

SURE = 4.0


def network() -> RecurrentNetwork:
    """Its log-odds are ``SURE`` times the first feature; it moves nothing."""
    last = np.zeros((1, 2, N_ANSWERS))
    last[0, 0, 9:], last[0, 1, 9:] = SURE, -SURE
    first = np.zeros((1, 3, 2))
    first[0, 1, 0], first[0, 2, 1] = 1.0, 1.0
    inputs = np.zeros((1, N_FEATURES, 2))
    inputs[0, 0] = 1.0, -1.0
    nothing = np.zeros((1, 2, 3)), np.zeros((1, 1, 3))
    return RecurrentNetwork(
        *(np.zeros(N_FEATURES), np.ones(N_FEATURES), 10.0),
        *((inputs, np.zeros((1, 1, 2))), nothing, (np.zeros((1, 1, 3)), np.zeros((1, 1, 3)))),
        ((first, np.zeros((1, 1, 2))), (last, np.zeros((1, 1, N_ANSWERS)))),
        np.ones(N_ANSWERS),
    )


@pytest.fixture
def samples(make_samples: Any) -> Any:
    """Keypoints are wrong with the odds exp(feature - 1)."""
    rng = np.random.default_rng(5)
    count = 4000
    features = np.zeros((count, 2, N_FEATURES))
    features[:, :, 0] = rng.normal(size=(count, 2))
    chance = 1.0 / (1.0 + np.exp(1.0 - features[:, :, 0]))
    is_wrong = rng.random((count, 2, 3)) < chance[:, :, None]
    one = make_samples(count, features=features)
    one.true_m[:] = one.found_m
    one.true_m[..., 2] += 0.5 * is_wrong.reshape(count, 6)
    one.true_m[::9] = np.nan
    return one


def test_the_chances_are_true_after_calibration(samples: Any) -> None:
    before, off_m = odds.odds_of(network(), samples)
    known = np.isfinite(samples.true_m).all(axis=(1, 2))
    feature = np.repeat(samples.features[known][:, :, 0], 3, axis=1)
    assert np.allclose(before, SURE * feature)
    after, _ = odds.odds_of(odds.calibrated(network(), [samples]), samples)
    assert np.abs(after - (feature - 1.0)).mean() < 0.15
    said = 1.0 / (1.0 + np.exp(-after))
    assert said.mean() == pytest.approx((off_m > 0.3).mean(), abs=0.01)


def test_figures_count_images_whose_hands_are_tracked(samples: Any) -> None:
    found = odds.figures_of(odds.calibrated(network(), [samples]), [samples])
    hands = found["keypoint_states"]["hand"]["states"]
    assert sum(number for number, _ in hands.values()) == 2 * found["frames"]
    right_share = 1.0 - hands["tracked"][1] / hands["tracked"][0]
    # A hand is tracked if it is wrong in at most 15 % of the images.
    assert right_share > 0.8
    assert 0 < found["states"]["tracking"] < found["frames"]
    assert found["hand_far_but_tracking"] >= found["far_but_tracking"]


def test_keypoints_that_are_never_wrong_keep_their_log_odds(samples: Any) -> None:
    samples.true_m[:] = samples.found_m
    before, _ = odds.odds_of(network(), samples)
    after, _ = odds.odds_of(odds.calibrated(network(), [samples]), samples)
    assert np.array_equal(before, after)
