"""What a covered camera costs, on a synthetic session of two cameras."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

from cardbox_tracker.evaluation.recorded.session import load_session
from cardbox_tracker.simulation.session import synthesize_session
from tools.covered_camera import KINDS, rows_of, table


def test_a_covered_camera_loses_nobody(tmp_path: Path) -> None:
    synthesize_session(tmp_path / "bag", "bow", fps=5.0, width=320, height=240, cameras=2)
    for name in ("ground_truth.json", "extrinsics.yaml"):
        shutil.move(tmp_path / "bag" / name, tmp_path / name)
    rows = list(rows_of(tmp_path, 2.0, 1))
    assert [(row.camera, row.kind) for row in rows] == [
        (camera, kind) for camera in ("cam0", "cam1") for kind in KINDS
    ]
    for row in rows:
        assert row.lost == 0
        assert np.isfinite(list(row.errors_cm.values())).all()
        # One camera less is not as good, and afterwards it is as good as before.
        assert row.errors_cm["during"][0] != row.errors_cm["during"][1]
        after, undisturbed = row.errors_cm["1 to 4 s after"]
        assert after < undisturbed + 4.0
    assert "| `cam1` silent | 0 |" in table(load_session(tmp_path), iter(rows))
