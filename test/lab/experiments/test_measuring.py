"""The initialization experiment on few people."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.person.sizes import DEFAULT_SIZES, N_SIZES, SIZE_NAMES
from lab.experiments.measuring import ROUNDS, measure, person_calls, seed_calls, summarize_measuring


def measured(off_m: float) -> dict[str, np.ndarray]:
    """The result of a search whose sizes are off by a known amount."""
    return {
        "true_m": DEFAULT_SIZES,
        "found_m": DEFAULT_SIZES + off_m,
        "iou": np.full(3, 0.9),
        "rounds": np.array([10, 20, 30]),
        "cost": np.full((3, ROUNDS + 1), 0.5),
        "search_s": np.array(abs(off_m)),
    }


def test_summary_by_hand() -> None:
    people, seeds = ([measured(m) for m in off] for off in ((0.01, -0.03), (0.02, 0.04)))
    results, timing = summarize_measuring(people, seeds)
    for name, expected in (
        ("mean_abs_error_m", 0.02),
        ("bias_m", -0.01),
        ("std_error_m", 0.04 / np.sqrt(2)),
        ("std_over_seeds_m", 0.02 / np.sqrt(2)),
        ("spread_of_people_m", 0.0),
    ):
        assert results[name] == pytest.approx(dict.fromkeys(SIZE_NAMES, expected), abs=1e-12)
    assert results["mean_rounds"] == {"O1": 10.0, "O2": 20.0, "O3": 30.0}
    assert len(results["relative_cost_by_round"]["O2"]["percentile_50"]) == ROUNDS + 1
    assert timing["median_s"] == pytest.approx(0.02)


def test_measuring_a_person() -> None:
    found = measure(0, 1, 1)
    assert found["found_m"].shape == (N_SIZES,)
    assert np.all(found["iou"] > 0.7)
    assert np.abs(found["found_m"] - found["true_m"]).mean() < 0.04
    curves = found["cost"]
    assert np.all(curves[:, 0] == 1.0)
    assert np.all(np.diff(curves, axis=1) <= 0)
    assert np.all(curves[:, -1] < 0.9)


def test_people_differ_and_seeds_measure_the_same_one() -> None:
    first, second = (call.function(*call.arguments) for call in person_calls(2, 0))
    assert not np.array_equal(first["true_m"], second["true_m"])
    one, other = (call.function(*call.arguments) for call in seed_calls(2, 0))
    np.testing.assert_array_equal(one["true_m"], other["true_m"])
    assert not np.array_equal(one["found_m"], other["found_m"])
