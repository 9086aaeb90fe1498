"""Tasks are done once, survive an interruption, and give the same in any number of processes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.evaluation.paper.evaluate import read_session
from cardbox_tracker.evaluation.paper.measuring import person_tasks
from cardbox_tracker.evaluation.paper.runner import Arrays, Parts, Task, default_jobs


def square(folder: Path, number: int) -> Arrays:
    with (folder / "log").open("a") as log:
        log.write(f"{number} ")
    return {"square": np.array(number**2)}


def fail(folder: Path, number: int) -> Arrays:
    raise CardboxError(f"number {number} is not possible")


def tasks(count: int) -> list[Task]:
    return [Task("square", square, (number,)) for number in range(count)]


def done(folder: Path) -> list[int]:
    return sorted(int(word) for word in (folder / "log").read_text().split())


def test_every_task_is_done_once(tmp_path: Path) -> None:
    parts = Parts(tmp_path / "parts")
    parts.run([*tasks(4), *tasks(4)], 1)
    assert done(parts.folder) == [0, 1, 2, 3]
    assert [int(parts.load(task)["square"]) for task in tasks(4)] == [0, 1, 4, 9]
    parts.run(tasks(5), 1)
    assert done(parts.folder) == [0, 1, 2, 3, 4]


def test_an_interrupted_run_keeps_what_is_finished(tmp_path: Path) -> None:
    parts = Parts(tmp_path)

    def interrupt(fraction: float) -> None:
        if fraction >= 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        parts.run(tasks(6), 1, interrupt)
    assert len(done(tmp_path)) == 3
    seen: list[float] = []
    Parts(tmp_path).run(tasks(6), 1, seen.append)
    assert done(tmp_path) == [0, 1, 2, 3, 4, 5]
    assert seen == pytest.approx([1 / 3, 2 / 3, 1.0])


def test_a_broken_part_is_done_again(tmp_path: Path) -> None:
    parts = Parts(tmp_path)
    parts.run(tasks(1), 1)
    path = parts.path(tasks(1)[0])
    path.write_bytes(path.read_bytes()[:50])
    assert not parts.is_done(tasks(1)[0])
    parts.run(tasks(1), 1)
    assert int(parts.load(tasks(1)[0])["square"]) == 0
    assert done(tmp_path) == [0, 0]


def test_other_arguments_and_other_sources_are_other_parts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second = tasks(2)
    before = Parts(tmp_path)
    assert before.path(first) != before.path(second)
    monkeypatch.setattr("cardbox_tracker.evaluation.paper.runner.source_digest", lambda: "edited")
    assert Parts(tmp_path).path(first) != before.path(first)


def test_two_processes_give_the_same_as_one(tmp_path: Path) -> None:
    # Functions that another interpreter can import, too.
    people = person_tasks(2, 5)
    alone, both = Parts(tmp_path / "alone"), Parts(tmp_path / "both")
    alone.run(people, 1)
    both.run(people, 2)
    for task in people:
        expected, found = alone.load(task), both.load(task)
        assert expected.keys() == found.keys()
        for name in ("true_m", "found_m", "iou", "rounds", "cost"):
            np.testing.assert_array_equal(expected[name], found[name])


def test_the_error_of_a_task_comes_through(tmp_path: Path) -> None:
    with pytest.raises(CardboxError, match="7"):
        Parts(tmp_path).run([Task("fail", fail, (7,))], 1)


def test_the_error_of_a_task_in_another_process_comes_through(tmp_path: Path) -> None:
    failing = [Task("session", read_session, (str(tmp_path), "", seed)) for seed in (0, 1)]
    with pytest.raises(CardboxError, match=r"ground_truth\.json"):
        Parts(tmp_path / "parts").run(failing, 2)


def test_nothing_but_results_is_left_in_the_folder(tmp_path: Path) -> None:
    parts = Parts(tmp_path / "a" / "b")
    parts.run(tasks(2), 1)
    assert {path.suffix for path in parts.folder.iterdir() if path.name != "log"} == {".npz"}


def test_a_file_in_the_way_of_the_folder_is_told(tmp_path: Path) -> None:
    (tmp_path / "parts").write_text("")
    with pytest.raises(CardboxError, match=r"folder .*parts"):
        Parts(tmp_path / "parts")


def test_at_least_one_core_is_there() -> None:
    assert default_jobs() >= 1
