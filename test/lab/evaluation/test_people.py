"""Sessions of real people: figures of known errors, the report, and the command."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.commands.main import main
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.recordings.truth import GroundTruth
from lab.evaluation.people import people_figures, torso_angles
from lab.evaluation.plan import NO_POINTS, Plan, ways_of
from lab.evaluation.report import BEGIN, END, people_report
from lab.evaluation.session import RecordedSession, load_session
from lab.evaluation.tracking import BACKGROUND, DETECTOR, SessionRun, silhouettes_of

PITCH_DEG = 15.0
BODY = BodyModel.of(hip_height_m=-0.5, camera_pitch_rad=float(np.radians(PITCH_DEG)))
CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5, float(np.radians(PITCH_DEG)))
N = 10
LARGEST_ERROR_CM = 30.0


@pytest.fixture
def postures() -> np.ndarray:
    """Bows and turns to both sides."""
    postures = np.zeros((N, 12))
    postures[:, 1] = np.linspace(-0.3, 0.3, N)
    postures[:, 2] = np.linspace(0.0, 0.5, N)
    postures[:, 3] = np.linspace(-0.8, 0.8, N)
    return postures


@pytest.fixture
def session(postures: np.ndarray) -> RecordedSession:
    hips = pose(BODY.rigid, postures).hip
    return RecordedSession(
        "hand_made",
        Path("bag"),
        None,
        GroundTruth({}, {}, 0, 2.0, PITCH_DEG, "left", stature_m=1.7),
        {},
        0.0,
        np.arange(N, dtype=np.int64) * 33_333_333,
        np.full(N, "dance"),
        CAMERA.reference_to_optical(pose(BODY.rigid, postures).keypoints_m),
        np.full((N, 3), np.nan),
        {},
        None,
        CAMERA.reference_to_optical(hips),
    )


def run_of(session: RecordedSession, postures: np.ndarray, points: np.ndarray) -> SessionRun:
    states = np.full(N, "tracking", dtype="<U16")
    states[:2] = "uncertain"
    stddevs = np.full((N, 12), 0.1)
    of_keypoints = np.full((N, 6), "tracked"), np.full((N, 6), 0.1)
    return SessionRun(
        *(BODY, "", states, points, postures, stddevs), *of_keypoints, np.full(N, 2.0), 30.0
    )


def test_the_torso_is_found_from_hips_and_shoulders(
    session: RecordedSession, postures: np.ndarray
) -> None:
    np.testing.assert_allclose(torso_angles(session), postures[:, 1:4], atol=1e-6)
    assert np.isnan(torso_angles(replace(session, hips_m=None))).all()


def test_wrong_images_are_counted_among_the_tracked(
    session: RecordedSession, postures: np.ndarray
) -> None:
    points = session.keypoints_m.copy()
    points[1:5, 5, 2] += 0.25  # one of these four is only uncertain
    points[7, 1, 0] -= 0.4
    points += (0.0, 0.0, 1.0)  # a wrong place is none of the shape
    found = people_figures(session, run_of(session, postures, points))
    assert found["tracking"] == 8
    assert found["tracking_beyond_20"] == 4
    assert found["tracking_beyond_30"] == 1
    assert found["input_ms"] == 30.0
    # The estimated postures are the true ones.
    assert all(share == 1.0 for share in found["coverage"].values())
    assert len(found["coverage"]) == 11


def test_without_hips_there_is_no_coverage(session: RecordedSession, postures: np.ndarray) -> None:
    alone = replace(session, hips_m=None)
    found = people_figures(alone, run_of(alone, postures, session.keypoints_m))
    assert found["coverage"] == {}
    assert found["aligned"] == pytest.approx(0.0, abs=1e-9)


def entry(name: str, aligned: tuple[float, ...], **changes: Any) -> dict[str, Any]:
    figures = {"frames": 50, "without_estimate": 5, "tracking": 20, "tracking_beyond_20": 5}
    one = {
        "name": name,
        "group": "clips",
        "source": "example.org, CC0",
        "cameras": [],
        "silhouettes": "background",
        "points": NO_POINTS,
        "mediapipe": {},
        "mediapipe_ms": None,
        "runs": [figures | {"aligned": value} for value in aligned],
    }
    return one | changes


def results_of(*entries: dict[str, Any]) -> dict[str, Any]:
    return {
        "command": "cardbox evaluate",
        "preset": "default",
        "seeds": [0, 1],
        "sessions": list(entries),
        "provenance": {"commit": "none", "cpu": "none"},
    }


def cells(report: str, start: str) -> list[str]:
    (line,) = [line for line in report.splitlines() if line.startswith(start)][:1]
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_sessions_with_the_same_inputs_have_a_mean() -> None:
    report = people_report(
        results_of(
            entry("cold", (10.0, 12.0)),
            entry("throw", (20.0, 21.0), mediapipe={"aligned": 9.5}),
            entry("throw", (5.0, 5.0), points="mediapipe"),
        )
    )
    header = cells(report, "| session")
    one, throw = cells(report, "| cold"), cells(report, "| throw")
    mean = cells(report, "| **mean of 2 in clips")
    aligned, spread = header.index("aligned"), header.index("spread")
    assert (one[aligned], one[spread]) == ("11.0", "2.0")
    # The spread is that of the means: 15.0 and 16.5.
    assert (mean[aligned], mean[spread]) == ("15.8", "1.5")
    assert (throw[header.index("MediaPipe aligned")], one[header.index("MediaPipe aligned")]) == (
        "9.5",
        "",
    )
    assert report.count("**mean of") == 2  # one in each table
    assert "`cold`, `throw`: example.org, CC0" in report
    states = report[report.index("## States") :]
    header, one = cells(states, "| session"), cells(states, "| cold")
    assert one[header.index("with estimate, %")] == "90"
    assert one[header.index("of these beyond 20 cm, %")] == "25"


def test_a_failure_is_told_below_its_row() -> None:
    failed = [{"frames": 50, "failure": "no scene"}]
    report = people_report(results_of(entry("cold", ()) | {"runs": failed}))
    assert "- `cold` (one, background, none) has no figures: no scene" in report
    assert cells(report, "| cold")[4:] == [""] * 10


def test_only_the_figures_of_a_document_are_replaced() -> None:
    results = results_of(entry("cold", (10.0,)))
    document = f"# Mine\n\n{BEGIN}\nold\n{END}\nmore\n"
    report = people_report(results, document)
    assert report.startswith(f"# Mine\n\n{BEGIN}\n")
    assert report.endswith(f"{END}\nmore\n")
    assert "old\n" not in report
    assert people_report(results, report) == report
    assert people_report(results, "# Another\n").startswith("# Real people\n")


def test_the_command_compares_inputs(
    unmeasured: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = json.loads((unmeasured / "ground_truth.json").read_text())
    with (tmp_path / "points.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["stamp_ns", "joint", "u", "v", "score"])
        for frame in data["frames"]:
            for name, (u, v) in frame.get("joints_px", {}).items():
                rows.writerow([frame["stamp_ns"], name, u, v, 1.0])
    words = ["evaluate", "--sessions", str(unmeasured), "--output", str(tmp_path / "out")]
    words += ["--seeds", "1", "--jobs", "1", "--detector", "none", str(tmp_path / "points.csv")]
    assert main(words) == 0
    assert "real-people.md" in capsys.readouterr().out
    assert not (tmp_path / "out" / "sessions.md").exists()
    results = json.loads((tmp_path / "out" / "real-people.json").read_text())
    assert results["command"].endswith(f"waves --detector none {tmp_path}/points.csv --output DIR")
    without, with_points = results["sessions"]
    assert (without["silhouettes"], without["points"]) == ("background", NO_POINTS)
    assert with_points["points"] == str(tmp_path / "points.csv")
    for found in (without, with_points):
        (run,) = found["runs"]
        assert 0 < run["aligned"] < LARGEST_ERROR_CM
        assert run["frames"] > 60
    assert (tmp_path / "out" / "real-people.md").read_text() == people_report(results)
    assert main(words) == 1
    assert "real-people.md exists" in capsys.readouterr().err


def test_a_session_without_an_empty_scene_needs_the_detector(
    unmeasured: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "nothing"))
    data = json.loads((unmeasured / "ground_truth.json").read_text())
    data["segments"] = [s for s in data["segments"] if s["name"] != "empty"]
    (tmp_path / "ground_truth.json").write_text(json.dumps(data))
    session = load_session(tmp_path)
    with pytest.raises(CardboxError, match=r"no segment 'empty', so .*cardbox detector --install"):
        silhouettes_of(session)
    with pytest.raises(CardboxError, match=r"no segment 'empty' from which .*--silhouettes"):
        silhouettes_of(session, BACKGROUND)
    with pytest.raises(CardboxError, match="cardbox detector --install"):
        silhouettes_of(load_session(unmeasured), DETECTOR)
    assert silhouettes_of(load_session(unmeasured)) == load_session(unmeasured).spans["empty"]


def test_a_background_is_left_out_where_there_is_none(unmeasured: Path, tmp_path: Path) -> None:
    data = json.loads((unmeasured / "ground_truth.json").read_text())
    data["segments"] = [s for s in data["segments"] if s["name"] != "empty"]
    (tmp_path / "ground_truth.json").write_text(json.dumps(data))
    both = Plan(silhouettes=(BACKGROUND, DETECTOR))
    assert [way.silhouettes for way in ways_of(tmp_path, both)] == [DETECTOR]
    assert [way.silhouettes for way in ways_of(unmeasured, both)] == [BACKGROUND, DETECTOR]
    alone = Plan(silhouettes=(BACKGROUND,))
    assert [way.silhouettes for way in ways_of(tmp_path, alone)] == [BACKGROUND]


def test_cameras_track_together_in_pairs_and_alone(unmeasured: Path, tmp_path: Path) -> None:
    data = json.loads((unmeasured / "ground_truth.json").read_text())
    names = ["front", "aside", "behind"]
    data["cameras"] = [data["camera"] | {"name": name} for name in names]
    (tmp_path / "ground_truth.json").write_text(json.dumps(data))
    plan = Plan(silhouettes=(BACKGROUND, DETECTOR))
    ways = ways_of(tmp_path, plan)
    assert [way.cameras for way in ways[::2]] == [
        ("front", "aside", "behind"),
        ("front", "aside"),
        ("front", "behind"),
        ("front",),
        ("aside",),
        ("behind",),
    ]
    assert [way.silhouettes for way in ways[:2]] == [BACKGROUND, DETECTOR]
    (alone,) = ways_of(unmeasured, Plan())
    assert alone.cameras == ()
