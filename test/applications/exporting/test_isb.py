"""The file of ISB angles."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.applications.exporting.formats import write_isb
from cardbox_tracker.person.isb_angles import ISB_NAMES
from cardbox_tracker.person.model import BodyModel


def test_the_table_has_both_kinds_of_angles_and_empty_gaps(
    motion_of: Callable, body: BodyModel, tmp_path: Path
) -> None:
    state = np.zeros(14)
    state[[2, 4, 7, 12]] = 0.3, np.pi / 2, np.pi / 2, 0.25
    write_isb(tmp_path / "a.csv", motion_of([state, np.full(14, np.nan)], body))
    with (tmp_path / "a.csv").open(encoding="utf-8", newline="") as file:
        seen, gap = csv.DictReader(file)
    assert list(seen)[3:14] == [f"{name}_deg" for name in ISB_NAMES]
    assert (seen["stamp_ns"], seen["time_s"], seen["state"]) == ("0", "0.000000", "tracking")
    assert float(seen["thorax_extension_deg"]) == pytest.approx(np.degrees(-0.3), abs=1e-5)
    assert float(seen["left_elevation_deg"]) == pytest.approx(-90)
    assert float(seen["left_internal_rotation_deg"]) == pytest.approx(0, abs=1e-6)
    assert (seen["right_plane_of_elevation_deg"], seen["right_internal_rotation_deg"]) == ("", "")
    assert (seen["torso_pitch_rad"], seen["torso_x_m"]) == ("0.300000", "0.250000")
    assert (gap["stamp_ns"], gap["state"]) == ("100000000", "lost")
    assert not any(list(gap.values())[3:])


def test_the_page_lists_all_columns() -> None:
    text = (Path(__file__).parents[3] / "docs" / "export.md").read_text(encoding="utf-8")
    for name in ISB_NAMES:
        assert (
            f"`{name.replace('right_', 'left_', 1) if name[:6] == 'right_' else name}_deg`" in text
        )
