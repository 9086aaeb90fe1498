"""Formats and detectors of another distribution are found by name, and its faults are told."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.applications.exporting.formats import formats, read_result
from cardbox_tracker.applications.exporting.motion import Motion
from cardbox_tracker.commands.main import main
from cardbox_tracker.commands.tracking_request import points_named
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.extensions import called
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.recordings.result_table import result_table
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.tracking.estimate import Estimate

MODULE = """
from cardbox_tracker.applications.exporting.formats import Format

def write(path, motion, body):
    path.write_text(f"{len(motion.state)} images\\n")

counted = Format(".counted", write)
no_format = 7
no_ending = Format("", write)
no_text = Format(type("NoText", (), {"__str__": None})(), write)
elsewhere = Format("./../x", write)
no_library = Format(".none", write, lambda: 1 / 0)

class Sees:
    def detect(self, image):
        return []
"""


@pytest.fixture
def add(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., None]]:
    """Install a distribution of a name with entry points, beside a module ``beside``."""
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "beside.py").write_text(MODULE)

    def install(name: str, group: str, *points: str) -> None:
        folder = tmp_path / f"{name}-1.0.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        lines = (f"[cardbox_tracker.{group}]", *points)
        (folder / "entry_points.txt").write_text("\n".join(lines))

    formats.cache_clear()
    yield install
    formats.cache_clear()
    sys.modules.pop("beside", None)


def table_in(folder: Path) -> Path:
    """Return a table of one image."""
    table, grey = folder / "person.csv", np.zeros((2, 2), np.uint8)
    seen = Estimate("tracking", np.zeros(12), np.ones(12), np.ones((6, 3)), 10, 0.9)
    with result_table(table, has_points=False) as add_row:
        add_row(RecordedFrame(0, 0.0, grey, grey), seen)
    return table


def test_a_format_is_written_by_its_name_and_by_its_ending(
    add: Callable[..., None], tmp_path: Path
) -> None:
    add("counts", "exporters", "counted = beside:counted")
    table = table_in(tmp_path)
    output = tmp_path / "out.counted"
    assert main(["export", str(table), "--to", "counted", "--output", str(output)]) == 0
    assert output.read_text() == "1 images\n"
    result = read_result(table)
    result.save(tmp_path / "other.counted")
    assert (tmp_path / "other.counted").read_text() == "1 images\n"
    with pytest.raises(CardboxError, match=r"the ending of x\.csv; those are .*\.counted"):
        result.save("x.csv")


def test_a_detector_is_found_by_its_name(add: Callable[..., None]) -> None:
    add("eyes", "detectors", "eyes = beside:Sees")
    found = points_named("eyes")
    assert isinstance(found, Detector)
    assert found.start().all_in(0, np.zeros((4, 4, 3), np.uint8)) == []
    with pytest.raises(CardboxError, match="'eye'; expected mediapipe, eyes, or points"):
        points_named("eye")


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ("broken = nowhere:x", "broken of counts cannot be imported from nowhere:x: ModuleNot"),
        ("broken = beside:absent", "broken of counts cannot be imported .*: AttributeError"),
        ("broken = beside:no_format", "broken of counts is no <class .*Format"),
        ("broken = beside:no_ending", "broken of counts is no <class .*Format.* ending"),
        ("broken = beside:no_text", "broken of counts is no <class .*Format.* ending"),
        ("broken = beside:elsewhere", "broken of counts is no <class .*Format.* ending"),
        ("broken = beside:no_library", "broken of counts cannot be used: ZeroDivisionError"),
    ],
)
def test_a_broken_format_names_its_distribution(
    add: Callable[..., None], point: str, expected: str
) -> None:
    add("counts", "exporters", point)
    # The others go on.
    assert formats()["trc"].check() is None
    # Distributions are searched once: request and tracking ask for each name.
    assert formats() is formats()
    with pytest.raises(CardboxError, match=expected):
        formats()["broken"].check()


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("path.write_text('half'); raise OSError('no ink')", "fails, .*OSError: no ink"),
        ("path.write_text('half'); raise SystemExit(3)", "fails, .*SystemExit: 3"),
        ("(path.parent.parent / 'elsewhere').touch()", "not written the file"),
        ("path.unlink(missing_ok=True); path.symlink_to(__file__)", "not written the file"),
    ],
)
def test_a_format_that_fails_leaves_the_old_file(
    add: Callable[..., None], tmp_path: Path, code: str, expected: str
) -> None:
    (tmp_path / "beside.py").write_text(MODULE.replace("path.write_text", f"{code}; (lambda _: 0)"))
    add("counts", "exporters", "counted = beside:counted")
    (tmp_path / "results").mkdir()
    path = tmp_path / "results" / "me.counted"
    path.write_text("old")
    with pytest.raises(CardboxError, match=f"counted of counts .*{expected}"):
        formats()["counted"].write(path, Motion.of(read_result(table_in(tmp_path))), None)
    assert path.read_text() == "old"
    assert list(path.parent.iterdir()) == [path]


def test_a_format_cannot_change_what_others_write(add: Callable[..., None], tmp_path: Path) -> None:
    (tmp_path / "beside.py").write_text(
        MODULE.replace("path.write_text", "motion.states[:] = 7; path.write_text")
    )
    add("counts", "exporters", "counted = beside:counted")
    motion = Motion.of(read_result(table_in(tmp_path)))
    before = motion.states.copy()
    formats()["counted"].write(tmp_path / "me.counted", motion, None)
    assert np.array_equal(motion.states, before, equal_nan=True)


def test_what_closes_the_standard_output_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", StringIO())
    with pytest.raises(CardboxError, match="it fails: OSError: it closes the standard output"):
        called(sys.stdout.close, "it fails")


def test_a_name_that_two_have_is_told(add: Callable[..., None]) -> None:
    add("one", "exporters", "same = beside:counted")
    add("two", "exporters", "same = beside:counted")
    with pytest.raises(
        CardboxError, match=r"same of exporters comes from (one and from two|two and from one)"
    ):
        formats()
    add("three", "detectors", "mediapipe = beside:Sees")
    with pytest.raises(CardboxError, match="mediapipe of detectors comes from three and from card"):
        points_named("x")
