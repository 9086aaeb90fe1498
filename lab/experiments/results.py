"""Tables of an evaluation by motion: ``results.json`` and ``per_frame.csv``."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cardbox_tracker.common.files import atomic_path
from lab.evaluation.results import read_json
from lab.experiments.tracking import FloatArray

Curves = Mapping[tuple[str, str], Mapping[str, FloatArray]]
"""Columns of ``per_frame.csv`` by motion and strategy."""


def write_curves(curves: Curves, path: Path) -> None:
    """Write one row for each motion, strategy and image."""
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file, lineterminator="\n")
        header: list[str] | None = None
        for (motion, strategy), columns in curves.items():
            if header is None:
                header = list(columns)
                rows.writerow(["motion", "strategy", *header])
            for values in zip(*(columns[name] for name in header), strict=True):
                rows.writerow([motion, strategy, *(f"{value:.5g}" for value in values)])


def motions_in(results: Mapping[str, Any]) -> list[str]:
    """Return the motions among the keys of ``results.json``."""
    return [
        name
        for name, value in results.items()
        if isinstance(value, dict) and {"drs", "srs"} <= set(value)
    ]


def recorded_results(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the results of recorded sessions in the folders inside ``folder``, by session."""
    found = {}
    for path in sorted(folder.glob("*/results.json")):
        results = read_json(path)
        if "session" in results:
            found[path.parent.name] = results
    return found
