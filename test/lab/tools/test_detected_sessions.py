"""The sources of sessions, and weights by source."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.recordings.truth import GroundTruth
from lab.evaluation.session import RecordedSession
from lab.tools.detected_sessions import source_of, source_weights

TRUTH = GroundTruth({}, {}, 0, 2.0, 10.0, "left")
SESSION = RecordedSession(
    *("name", Path("bag"), None, TRUTH, {}, 0.0),
    *(np.empty(0, np.int64), np.empty(0, str), np.empty((0, 6, 3)), np.empty((0, 3))),
    *({}, None),
)


@pytest.mark.parametrize(
    ("said", "source"),
    [("example.org/films, CC0, clip 1.avi", "example.org/films"), ("", "rendered")],
)
def test_the_clips_of_one_repository_are_one_source(said: str, source: str) -> None:
    assert source_of(replace(SESSION, truth=replace(TRUTH, source=said))) == source


def test_each_source_has_the_same_weight() -> None:
    weights = source_weights(["a", "b", "a"], [1, 6, 2])
    assert len(weights) == 9 and weights.sum() == pytest.approx(9.0)
    assert weights[[0, 7, 8]] == pytest.approx(1.5)
    assert weights[1:7] == pytest.approx(0.75)


def test_a_source_without_samples_takes_no_weight_from_others() -> None:
    assert source_weights(["a", "b"], [3, 0]) == pytest.approx(np.ones(3))
    assert len(source_weights(["a"], [0])) == 0
