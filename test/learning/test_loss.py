"""The fit of the chance of loss, on frames whose coefficients are known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cardbox_tracker.estimation.filtering.loss import (
    COEFFICIENTS,
    Evidence,
    chance_of_loss,
    features_of_loss,
)
from learning.logistic import chances
from learning.loss import SHIPPED, Frames, fitted, frames_of, quality, report, together

TRUE = np.array([-1.0, *np.linspace(-2.0, 2.0, len(COEFFICIENTS))])


def frames(count: int, seed: int) -> Frames:
    """Frames that are wrong with the chance of the coefficients ``TRUE``."""
    rng = np.random.default_rng(seed)
    features = rng.normal(0.3, 0.5, (count, len(COEFFICIENTS)))
    return Frames(features, rng.random(count) < chances(TRUE, features))


def test_the_shipped_coefficients_give_the_chance_of_the_package() -> None:
    stddev, mean = np.linspace(0.01, 0.1, 14), np.linspace(-0.5, 0.5, 14)
    evidence = Evidence(0.2, 0.1, 0.3, 0.6, 0.05, 0.04, stddev, mean, 3)
    features = np.array([list(features_of_loss(evidence).values())])
    assert chances(SHIPPED, features)[0] == pytest.approx(chance_of_loss(evidence))


def test_known_coefficients_are_recovered() -> None:
    found = fitted(frames(100_000, 0), inverse_penalty=1e6)
    np.testing.assert_allclose(found[1:], TRUE[1:], atol=0.15)


def test_wrong_and_right_frames_weigh_alike() -> None:
    """Leaving out most right frames changes nothing but the noise."""
    every = frames(100_000, 1)
    rare = np.flatnonzero(every.is_wrong)[::10]
    chosen = np.concatenate([np.flatnonzero(~every.is_wrong), rare])
    some = Frames(every.features[chosen], every.is_wrong[chosen])
    np.testing.assert_allclose(fitted(some, 1e6), fitted(every, 1e6), atol=0.3)


def test_the_quality_of_a_perfect_and_of_a_blind_guess() -> None:
    is_wrong = np.array([True, False, False, False])
    assert quality(np.where(is_wrong, 0.99, 0.01), is_wrong)[1] == 1.0
    assert quality(np.full(4, 0.5), is_wrong) == pytest.approx((np.log(2.0), 0.5))


def test_the_report_judges_sessions_that_are_left_out() -> None:
    """The fit is better than the shipped coefficients, which know nothing of these frames."""
    sessions = [frames(5_000, seed) for seed in range(2, 5)]
    lines = report(sessions).splitlines()
    assert f"{'residual':16} " in lines[2]
    (left_out,), (shipped,) = (
        [line.split() for line in lines if line.startswith(name)]
        for name in ("fitted, left out", "shipped")
    )
    assert float(left_out[-2]) < float(shipped[-2])
    assert float(left_out[-1]) > float(shipped[-1])


def test_without_wrong_frames_there_is_no_fit() -> None:
    right = together([frames(100, 5)])._replace(is_wrong=np.zeros(100, bool))
    with pytest.raises(ValueError, match="class"):
        report([right])


def test_frames_without_truth_are_left_out_and_the_corrected_results_count(
    make_samples: Any,
) -> None:
    one = make_samples(4)
    one.true_m[0, 5] = np.nan
    one.result_m[:] = one.true_m
    # A mean of 31 cm is wrong, one of 29 cm is right.
    one.result_m[2, :, 2] += 0.31
    one.result_m[3, :, 2] += 0.29
    found = frames_of(one)
    assert found.is_wrong.tolist() == [False, True, False]
    np.testing.assert_array_equal(found.features, one.evidence[1:])
