"""``cardbox evaluate --sessions`` on a synthetic session: files, figures, refusals."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.applications.simulation.session import SessionFormat, synthesize_session
from cardbox_tracker.commands.main import main
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.search.config import default_preset
from lab.evaluation.evaluate import evaluate_session, evaluate_sessions
from lab.evaluation.plan import Plan, Way
from lab.evaluation.report import sessions_report
from lab.evaluation.session import load_session
from lab.evaluation.tracking import InputSelection, track_session

LARGEST_ERROR_CM = 25.0


ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A synthetic session, laid out as the recorded ones are, with figures of MediaPipe beside."""
    folder = tmp_path_factory.mktemp("sessions") / "waves"
    folder.mkdir()
    synthesize_session(folder / "bag", "wave", 1, SessionFormat(fps=8.0))
    (folder / "bag" / "ground_truth.json").rename(folder / "ground_truth.json")
    peer = {"ms_median": 12.5, "mean": {"motions": {"aligned": 9.9, "pa": 5.0, "joints": {}}}}
    (folder / "peer_mediapipe.json").write_text(json.dumps(peer))
    return folder


def test_a_session_is_scored_after_the_reference_postures(session: Path) -> None:
    loaded = load_session(session)
    assert set(loaded.segments) == {"neutral", "wave"}
    assert len(loaded.stamps_ns) == len(loaded.keypoints_m) > 60
    assert loaded.mediapipe == {"aligned": 9.9, "pa": 5.0}
    assert loaded.mediapipe_ms == 12.5
    assert loaded.spans["front"].start_s > loaded.truth.spans["front"][0]
    whole = load_session(session, postures=True)
    assert {"front", "side", "arms", "transition", "neutral", "wave"} == set(whole.segments)
    assert whole.start_s == loaded.truth.spans["front"][0]


def test_the_command_writes_report_and_numbers(
    session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["evaluate", "--sessions", str(session), "--output", str(tmp_path / "out")]
    assert main([*words, "--seeds", "2", "--jobs", "1", "--preset", "paper"]) == 0
    assert "sessions.md" in capsys.readouterr().out
    results = json.loads((tmp_path / "out" / "sessions.json").read_text())
    (found,) = results["sessions"]
    assert (results["preset"], results["seeds"]) == ("paper", [0, 1])
    assert len(found["runs"]) == 2
    for run in found["runs"]:
        assert 0 < run["aligned"] < LARGEST_ERROR_CM
        assert run["without_estimate"] == 0
    report = (tmp_path / "out" / "sessions.md").read_text()
    assert report == sessions_report(results)
    assert "| waves |" in report
    assert "9.9" in report


def test_sessions_of_development_are_named_as_such() -> None:
    results = json.loads((ROOT / "docs/evaluation/sessions.json").read_text())
    assert "chosen on all sessions, which were thus used in development" in sessions_report(results)
    first = results["sessions"][0]["name"]
    for session in results["sessions"][1:]:
        session["name"] = f"my_{session['name']}"
    assert f"chosen on {first}, which were thus used in development" in sessions_report(results)
    results["sessions"][0]["name"] = "mine"
    assert "used in development" not in sessions_report(results)


def test_a_session_with_depth_images_is_tracked_with_them_too(
    session: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "ranged"
    folder.mkdir()
    data = json.loads((session / "ground_truth.json").read_text())
    data |= {"cameras": [{"name": "camera"}], "depth_topic": "/camera/depth"}
    (folder / "ground_truth.json").write_text(json.dumps(data))
    # Whoever waves has arms and chest about as far away.
    surface_mm = 1000 * data["person"]["distance_m"] - 50
    depth = np.full((data["camera"]["height"], data["camera"]["width"]), surface_mm, np.uint16)
    with BagReader(session / "bag") as old, BagWriter(folder / "bag") as new:
        for message in old.messages():
            new.write_raw(message.topic, message.msgtype, message.raw, message.time_ns)
        for entry in data["frames"]:
            new.write_image("/camera/depth", entry["stamp_ns"], "camera", depth, "16UC1")
    results = evaluate_sessions([folder], tmp_path / "out", Plan(seeds=(0,)), jobs=1)
    alone, ranged = results["sessions"]["sessions"]
    with pytest.raises(CardboxError, match=r"ranged .*left; .*camera"):
        track_session(load_session(folder), default_preset(), (0,), InputSelection("left"))
    assert (alone["name"], ranged["name"]) == ("ranged", "ranged, with depth")
    assert alone["runs"][0]["aligned"] != ranged["runs"][0]["aligned"] < LARGEST_ERROR_CM


@pytest.fixture(scope="module")
def recovered(session: Path) -> dict[str, Any]:
    return evaluate_session(Way(session), Plan("paper", (4,), recovery=True))


def test_the_same_seed_gives_the_same_figures(session: Path, recovered: dict[str, Any]) -> None:
    (again,) = evaluate_session(Way(session), Plan("paper", (4,)))["runs"]
    (first,) = recovered["runs"]
    assert again.keys() == first.keys() - {"recovery"}
    assert all(again[name] == first[name] for name in again if name != "ms")


def test_a_folder_that_is_no_session_is_refused(session: Path, tmp_path: Path) -> None:
    with pytest.raises(CardboxError, match="json of a session"):
        load_session(tmp_path)
    truth = json.loads((session / "ground_truth.json").read_text())
    truth["segments"] = [s for s in truth["segments"] if s["name"] != "side"]
    (tmp_path / "ground_truth.json").write_text(json.dumps(truth))
    with pytest.raises(CardboxError, match="segment side"):
        load_session(tmp_path)


def test_figures_of_mediapipe_that_are_none_are_refused(session: Path, tmp_path: Path) -> None:
    (tmp_path / "ground_truth.json").write_text((session / "ground_truth.json").read_text())
    (tmp_path / "peer_mediapipe.json").write_text("[]")
    with pytest.raises(CardboxError, match=r"peer_mediapipe\.json"):
        load_session(tmp_path)


def test_recovery_counts_its_trials(recovered: dict[str, Any]) -> None:
    recovery = recovered["runs"][0]["recovery"]
    assert set(recovery) == {"absent", "gap", "arm hidden"}
    for kind in recovery.values():
        assert 0 <= kind["recovered"] <= kind["trials"]
        assert kind["trials"] >= 1
    lost = {key: value for key, value in recovered["runs"][0].items() if key != "recovery"}
    report = sessions_report(
        {
            "seeds": [0],
            "preset": "paper",
            "sessions": [recovered, {**recovered, "name": "never followed", "runs": [lost]}],
            "command": "",
            "provenance": {"commit": "", "cpu": ""},
        }
    )
    assert "## Recovery after disturbances" in report
    assert "| never followed | 0 (0) | 0 (0) | 0 (0) |" in report


def test_a_session_that_cannot_be_read_is_told_in_its_row(session: Path, tmp_path: Path) -> None:
    (tmp_path / "ground_truth.json").write_text((session / "ground_truth.json").read_text())
    found = evaluate_session(Way(tmp_path), Plan("paper", (0,)))
    assert "there is no recording" in found["runs"][0]["failure"]
