"""Calls in several processes, and the cache of their results."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.common.errors import CardboxError
from lab.experiments import parallel
from lab.experiments.measuring import person_calls
from lab.experiments.parallel import Call, Progress, Runner
from lab.experiments.sessions import recorded_session


def square(log: Path, number: int) -> int:
    with log.open("a") as file:
        file.write(f"{number} ")
    return number**2


def calls(log: Path, count: int) -> list[Call]:
    return [Call(square, (log, number)) for number in range(count)]


def performed(log: Path) -> list[int]:
    return [int(word) for word in log.read_text().split()]


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """The file in which calls leave their numbers."""
    return tmp_path / "log"


def test_each_call_is_done_once(tmp_path: Path, log: Path, silent: Progress) -> None:
    first, second = (Runner(tmp_path / "parts", 1, silent) for _ in range(2))
    done = first.run("squares", [*calls(log, 4), *calls(log, 4)])
    assert [done[call].result for call in calls(log, 4)] == [0, 1, 4, 9]
    assert performed(log) == [0, 1, 2, 3]
    assert second.run("squares", calls(log, 5))[calls(log, 5)[4]].result == 16
    assert performed(log) == [0, 1, 2, 3, 4]


def test_an_interrupted_run_resumes(tmp_path: Path, log: Path, silent: Progress) -> None:
    @contextmanager
    def interrupting(text: str) -> Iterator[Callable[[float], None]]:
        def show(fraction: float) -> None:
            if fraction >= 0.5:
                raise KeyboardInterrupt

        yield show

    with pytest.raises(KeyboardInterrupt):
        Runner(tmp_path / "parts", 1, interrupting).run("squares", calls(log, 6))
    assert performed(log) == [0, 1, 2]
    Runner(tmp_path / "parts", 1, silent).run("squares", calls(log, 6))
    assert performed(log) == [0, 1, 2, 3, 4, 5]


def test_results_of_other_sources_are_not_reused(
    tmp_path: Path, log: Path, silent: Progress, monkeypatch: pytest.MonkeyPatch
) -> None:
    for digest in ("before", "edited"):
        monkeypatch.setattr(parallel, "source_digest", lambda digest=digest: digest)
        Runner(tmp_path / "parts", 1, silent).run("squares", calls(log, 1))
    assert performed(log) == [0, 0]


def test_two_processes_give_the_same_as_one(tmp_path: Path, silent: Progress) -> None:
    people = person_calls(2, 5)
    alone, both = (Runner(tmp_path / str(n), n, silent).run("people", people) for n in (1, 2))
    for call in people:
        expected, found = alone[call].result, both[call].result
        assert expected.keys() == found.keys()
        for name in ("true_m", "found_m", "iou", "rounds", "cost"):
            np.testing.assert_array_equal(expected[name], found[name])


@pytest.mark.parametrize("jobs", [1, 2])
def test_the_error_of_a_call_comes_through(tmp_path: Path, jobs: int, silent: Progress) -> None:
    failing = [Call(recorded_session, (tmp_path, seed)) for seed in (0, 1)]
    with pytest.raises(CardboxError, match=r"ground_truth\.json"):
        Runner(tmp_path / "parts", jobs, silent).run("sessions", failing)


def test_a_file_in_the_way_of_the_folder_is_told(tmp_path: Path, silent: Progress) -> None:
    (tmp_path / "parts").write_text("")
    with pytest.raises(CardboxError, match=r"parts.*--output"):
        Runner(tmp_path / "parts", 1, silent)
