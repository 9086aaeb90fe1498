"""The table of efforts has what was measured, by hand."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tools import effort_table


def test_the_table_by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
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
    head, _, *rows = effort_table.table([Path("a"), Path("b")], range(2))
    assert head == "| effort | ms an image | a, cm | b, cm |"
    assert rows[0] == "| 0.25 | 0.5 | 4.0 | 4.0 |"
    assert rows[-1] == "| 4 | 8.0 | 0.2 | 0.2 |"
