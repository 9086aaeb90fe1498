"""The table of efforts has what was measured, by hand."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib import pyplot

from lab.tools import effort_table
from lab.tools.effort_table import Measured


@pytest.fixture
def rows(monkeypatch: pytest.MonkeyPatch) -> list[Measured]:
    """An effort of e is 1 / e cm off in every axis, and takes 2 e ms."""
    truth = np.zeros((2, 6, 3))

    def load(folder: Path) -> Any:
        return SimpleNamespace(name=folder.name, keypoints_m=truth)

    def track(session: Any, config: Any, seeds: tuple[int, ...]) -> list[Any]:
        effort = config.whole_body.effort
        off_m = np.full((2, 6, 3), 0.01 / effort / np.sqrt(3.0))
        off_m[0, 0] = np.nan  # an image without a result does not count
        run = SimpleNamespace(keypoints_m=off_m, milliseconds=np.array([2.0 * effort]))
        return [run] * len(seeds)

    monkeypatch.setattr(effort_table, "load_session", load)
    monkeypatch.setattr(effort_table, "track_session", track)
    return effort_table.measured([Path("a"), Path("b")], range(2))


def test_the_table_by_hand(rows: list[Measured]) -> None:
    head, _, *lines = effort_table.effort_table(rows).splitlines()
    assert head == "| effort | ms an image | times effort 1 | a, cm | b, cm |"
    assert lines[0] == "| 0.25 | 0.5 | 0.25 | 4.0 | 4.0 |"
    assert lines[-1] == "| 4 | 8.0 | 4.00 | 0.2 | 0.2 |"


def test_the_plot_shows_errors_and_times(
    rows: list[Measured], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pyplot, "close", lambda _: None)
    effort_table.draw(rows, tmp_path / "effort.png")
    errors, times = pyplot.gcf().axes
    monkeypatch.undo()
    pyplot.close("all")
    assert [line.get_label() for line in errors.lines] == ["a", "b"]
    np.testing.assert_allclose(errors.lines[0].get_ydata(), [4.0, 2.0, 1.0, 0.5, 0.25])
    np.testing.assert_allclose(times.lines[0].get_xdata(), effort_table.EFFORTS)
    np.testing.assert_allclose(times.lines[0].get_ydata(), [0.25, 0.5, 1.0, 2.0, 4.0])
    assert (tmp_path / "effort.png").read_bytes().startswith(b"\x89PNG")
