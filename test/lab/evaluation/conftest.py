"""Sessions that several tests of this folder read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from cardbox_tracker.applications.simulation.session import SessionFormat, synthesize_session

STATURE_M = 1.72


@pytest.fixture(scope="session")
def unmeasured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session as those of real people: an empty scene, motions, and no reference postures."""
    folder = tmp_path_factory.mktemp("people") / "waves"
    folder.mkdir()
    synthesize_session(folder / "bag", "wave", 1, SessionFormat(fps=8.0))
    data = json.loads((folder / "bag" / "ground_truth.json").read_text())
    (folder / "ground_truth.json").write_text(json.dumps(without_references(data)))
    return folder


def without_references(data: dict[str, Any]) -> dict[str, Any]:
    """Return a ground truth whose first seconds after the empty scene are no references."""
    last = next(s for s in data["segments"] if s["name"] == "neutral")
    kept = [s for s in data["segments"] if s["name"] == "empty" or s["start_s"] > last["start_s"]]
    data["segments"] = [s | {"name": s["name"].replace("neutral", "still")} for s in kept]
    data["person"]["height"] = STATURE_M
    data["source"] = "example.org/waves, CC0 1.0"
    names = [s["name"] for s in data["segments"]]
    for entry in data["frames"]:
        entry["segment"] = entry["segment"].replace("neutral", "still")
        entry.pop("torso_rpy_deg", None)
        if entry["segment"] not in names[1:]:
            entry.pop("joints_m", None)
    return data
