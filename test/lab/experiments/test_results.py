"""Results of an evaluation by motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lab.experiments.results import motions_in, write_curves


def test_motions_are_the_keys_with_both_strategies() -> None:
    results = {
        "wave": {"drs": {}, "srs": {}},
        "experiments": {"particles": {}},
        "seed": 0,
        "reach": {"drs": {}, "srs": {}},
    }
    assert motions_in(results) == ["wave", "reach"]


def test_curves_have_a_row_an_image(tmp_path: Path) -> None:
    path = tmp_path / "per_frame.csv"
    columns = {"time_s": np.array([0.0, 0.5]), "cost_px": np.array([10.0, 1 / 3])}
    write_curves({("wave", "drs"): columns, ("wave", "srs"): columns}, path)
    assert path.read_text().splitlines() == [
        "motion,strategy,time_s,cost_px",
        "wave,drs,0,10",
        "wave,drs,0.5,0.33333",
        "wave,srs,0,10",
        "wave,srs,0.5,0.33333",
    ]
