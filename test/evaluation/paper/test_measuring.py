"""The initialization experiment on few people."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.body.sizes import DEFAULT_SIZES, N_SIZES, SIZE_NAMES
from cardbox_tracker.evaluation.paper.measuring import (
    ROUNDS,
    measure,
    person_tasks,
    seed_tasks,
    summarize_measuring,
)
from cardbox_tracker.evaluation.paper.runner import Parts, Task


def measured(folder: Path, errors_m: list[float], searches_m: list[float]) -> list[list[Task]]:
    """Finished tasks whose sizes are off by known amounts."""

    def result(folder: Path, off_m: float) -> dict[str, np.ndarray]:
        return {
            "true_m": DEFAULT_SIZES,
            "found_m": DEFAULT_SIZES + off_m,
            "iou": np.full(3, 0.9),
            "rounds": np.array([10, 20, 30]),
            "cost": np.full((3, ROUNDS + 1), 0.5),
            "search_s": np.array(abs(off_m)),
        }

    groups = [
        [Task(name, result, (off_m,)) for off_m in values]
        for name, values in (("person", errors_m), ("seed", searches_m))
    ]
    Parts(folder).run([task for group in groups for task in group], 1)
    return groups


def test_summary_by_hand(tmp_path: Path) -> None:
    people, seeds = measured(tmp_path, [0.01, -0.03], [0.02, 0.04])
    results, timing = summarize_measuring(Parts(tmp_path), people, seeds)
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


def test_measuring_a_person(tmp_path: Path) -> None:
    found = measure(tmp_path, 0, 1, 1)
    assert found["found_m"].shape == (N_SIZES,)
    assert np.all(found["iou"] > 0.7)
    assert np.abs(found["found_m"] - found["true_m"]).mean() < 0.04
    curves = found["cost"]
    assert np.all(curves[:, 0] == 1.0)
    assert np.all(np.diff(curves, axis=1) <= 0)
    assert np.all(curves[:, -1] < 0.9)


def test_people_differ_and_seeds_measure_the_same_one(tmp_path: Path) -> None:
    first, second = (measure(tmp_path, 0, *task.arguments[1:]) for task in person_tasks(2, 0))
    assert not np.array_equal(first["true_m"], second["true_m"])
    one, other = (measure(tmp_path, 0, *task.arguments[1:]) for task in seed_tasks(2, 0))
    np.testing.assert_array_equal(one["true_m"], other["true_m"])
    assert not np.array_equal(one["found_m"], other["found_m"])
