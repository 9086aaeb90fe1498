"""The benchmark measures what it says and writes what it promises; no time is asserted."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.applications.simulation.session import SessionFormat, synthesize_session
from cardbox_tracker.commands.main import main
from cardbox_tracker.common.errors import CardboxError
from lab.benchmarks import command as benchmark
from lab.benchmarks import core as benchmark_core
from lab.benchmarks import film, ratios
from lab.benchmarks import report as benchmark_report
from lab.benchmarks.scene import make_scene, recorded_scene
from lab.benchmarks.silhouette import WITHOUT, colored, measure_silhouettes
from lab.benchmarks.stages import WHOLE
from lab.benchmarks.way import STEPS, steps_of
from lab.evaluation.results import read_json

ROOT = Path(__file__).parents[3]
BENCHMARKS = "docs/benchmarks.json"
PROMISED = (
    "frame_ms_median",
    "frame_ms_p95",
    "ratio_opencv",
    "ratio_volumetric",
    "ratio_double_resolution",
    "particles_at_30hz",
    "rss_mb",
)
STREAM = {
    "p50_ms": 5.0,
    "p95_ms": 7.0,
    "p99_ms": 9.0,
    "received_p50_ms": 4.5,
    "received_p95_ms": 6.5,
    "received_p99_ms": 8.5,
    "sent": 300,
    "received": 299,
    "cpu_percent": {"background": 10.0, "tracker": 5.0},
    "cpu_percent_sum": 15.0,
}
NODES = {
    "ready_s": {"background": 1.0, "tracker": 2.0},
    "rss_mb": {"background": 90.0, "tracker": 100.0},
    "streams": {"mono8 320x240 at 30 Hz": STREAM},
    "single_process": {
        "ready_s": {"single_process": 1.5},
        "rss_mb": {"single_process": 150.0},
        "streams": {
            "mono8 320x240 at 30 Hz": {
                **STREAM,
                "p50_ms": 4.0,
                "p95_ms": 6.0,
                "cpu_percent": {"single_process": 15.0},
            }
        },
    },
}

RATIOS = {
    "commit": "0" * 40,
    "silhouette": {"ratio": 1.5, "ratios_without": {"colours": 1.25}},
    "two_views": 1.75,
    "start": {"tracker": {"seconds": 1.25, "ratio": 2.5}},
    "folder": 1.9,
}


# One image with the stamp 0, and a second one that was lost on its way.
NOTES = {
    0: {"received": 10**6, "converted": 2 * 10**6, "cut out": 4 * 10**6}
    | {"delivered": 5 * 10**6, "tracked": 9 * 10**6},
    7: {"received": 10**6},
}
ENDS = {0: (12 * 10**6, 10 * 10**6), 7: (10**6, 10**6)}


def test_the_steps_of_an_image_by_hand() -> None:
    medians = {name: times["p50_ms"] for name, times in steps_of(NOTES, ENDS).items()}
    assert [medians[step] for step in STEPS] == [1.0, 1.0, 2.0, 1.0, 4.0, 1.0, 2.0]
    assert (medians["estimation"], medians["all but estimation"], medians["all"]) == (
        6.0,
        6.0,
        12.0,
    )


def test_the_parts_of_a_frame_are_less_than_the_whole(core: dict[str, Any]) -> None:
    medians = {name: times["median_ms"] for name, times in core["default_stages"].items()}
    whole = medians.pop(WHOLE)
    assert all(0.0 < time < whole for time in medians.values())


@pytest.fixture(scope="module")
def core() -> dict[str, Any]:
    patch = pytest.MonkeyPatch()
    patch.setattr(benchmark_core, "RESOLUTIONS", ((64, 48), (320, 240), (640, 480)))
    patch.setattr(benchmark_core.measure_particles, "__defaults__", ((60, 600),))
    done: list[float] = []
    measured = benchmark_core.measure_core(12, done.append)
    patch.undo()
    assert done == sorted(done)
    assert done[-1] == 1.0
    return measured


def test_the_figures_agree_with_each_other(core: dict[str, Any]) -> None:
    for times in (*core["frames"].values(), *core["stages"].values()):
        assert 0 < times["median_ms"] <= times["p95_ms"]
    assert core["frame_ms_median"] == core["frames"]["paper"]["median_ms"]
    both = core["resolutions"]["640x480"]["median_ms"] / core["resolutions"]["320x240"]["median_ms"]
    assert core["ratio_double_resolution"] == both
    assert set(core["particles"]) == {"60", "600"}
    assert core["rss_mb"] > 10


def test_the_compiled_cost_is_the_faster_one(core: dict[str, Any]) -> None:
    """Ratios of one run, with a wide margin: a busy machine slows both."""
    assert core["ratio_opencv"] > 2
    assert core["ratio_volumetric"] > 1


def test_all_steps_of_the_silhouette_cost_more_than_brightness_alone() -> None:
    scene = make_scene(80, 64, 12, 5)
    empty, images = colored(scene)
    assert np.unique(images[0][scene.silhouettes[0] == 0] // 16).size > 1
    costs = measure_silhouettes(empty, images, 2)
    assert costs["ratio"] > 1.0
    assert set(costs["ratios_without"]) == set(WITHOUT)


def test_a_second_camera_costs_time_and_sees_the_person() -> None:
    scene = make_scene(160, 120, 8, 2)
    assert all(silhouette.any() for silhouette in ratios.seen_by(scene, ratios.beside(scene)))
    assert ratios.measure_two_views(scene, 1) > 1.0


def test_particles_at_30hz_by_hand() -> None:
    measured = {
        "600": 1.0,
        "6000": 100 / 3 - 10,
        "60000": 100 / 3 + 10,
    }
    assert benchmark_core.particles_at_30hz(measured) == 33_000
    assert benchmark_core.particles_at_30hz({"600": 40.0}) == 0


def test_turns_give_every_tracker_every_image_once() -> None:
    scene = make_scene(32, 24, 23, 2)
    seen: dict[str, list[int]] = {"a": [], "b": []}
    times = benchmark_core.frame_times_ms(scene, {n: seen[n].append for n in seen})
    assert seen["a"] == seen["b"] == list(range(23))
    assert all(len(t) == 18 for t in times.values())


def test_the_scene_moves_and_its_background_does_not() -> None:
    scene = make_scene(80, 60, 30, 3)
    assert scene.images.shape == scene.silhouettes.shape == (30, 60, 80)
    assert np.any(scene.silhouettes[0] != scene.silhouettes[-1])
    assert np.abs(np.diff(scene.empty.astype(int), axis=0)).mean() < 6
    assert not np.any(make_scene(80, 60, 1, 3).empty != scene.empty)


def test_the_detector_is_measured_with_a_recorded_person() -> None:
    """Drawn images show it nobody; the text says which images it had."""
    person = {**NODES, "streams": {"bgr8 320x240 at 30 Hz": {**STREAM, "points": 41}}}
    drawn = benchmark_report._nodes({**NODES, "with_detector": NODES})
    seen = benchmark_report._nodes({**NODES, "with_detector": person, "of_detector": person})
    assert "find nobody" in " ".join(drawn) and "| points |" not in " ".join(drawn)
    assert "find nobody" not in " ".join(seen)
    assert " ".join(seen).count("| 299/300 | 41 |") == 2


def test_the_time_up_to_a_robots_command_is_told() -> None:
    robot = {**STREAM, "command_p50_ms": 21.0, "command_p95_ms": 42.0}
    measured = {**NODES, "streams": {"bgr8 320x240 at 30 Hz": robot}}
    text = " ".join(benchmark_report._nodes({**NODES, "detector_with_robot": measured}))
    assert (
        "| detector | bgr8 320x240 at 30 Hz | 5.0 ms | 7.0 ms | 21.0 ms | 42.0 ms | 299/300 |"
        in text
    )
    assert "Up to the command" not in " ".join(benchmark_report._nodes(NODES))


def test_a_recorded_scene_has_its_camera_its_body_and_the_motions(tmp_path: Path) -> None:
    synthesize_session(tmp_path / "bag", "wave", 1, SessionFormat(5, 80, 60))
    truth = json.loads((tmp_path / "bag" / "ground_truth.json").read_text())
    (tmp_path / "ground_truth.json").write_text(json.dumps(truth))
    with pytest.raises(CardboxError, match="stature"):
        recorded_scene(tmp_path, 3, 5)
    truth["person"]["height"] = 1.72
    (tmp_path / "ground_truth.json").write_text(json.dumps(truth))
    scene = recorded_scene(tmp_path, 3, 5)
    size = scene.camera.height, scene.camera.width
    assert scene.images.shape == (3, *size) and scene.empty.shape == (5, *size)
    assert np.abs(scene.images[0].astype(int) - scene.empty[0]).max() > 20


@pytest.mark.parametrize("nodes", [None, NODES])
def test_files_hold_what_is_promised(
    core: dict[str, Any],
    nodes: dict[str, Any] | None,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(benchmark, "measure_core", lambda *_: dict(core))
    monkeypatch.setattr(benchmark, "measure_nodes", lambda *_: nodes)
    monkeypatch.setattr(benchmark, "measure_ratios", lambda _: RATIOS)
    monkeypatch.setattr(benchmark, "measure_way", lambda _: {"one process": steps_of(NOTES, ENDS)})
    json_path, report_path = tmp_path / "b.json", tmp_path / "b.md"
    assert main(["benchmark", "--json", str(json_path), "--report", str(report_path)]) == 0
    results = json.loads(json_path.read_text())
    assert set(PROMISED) <= set(results)
    assert {"versions", "commit", "cpu", "cores"} <= set(results)
    text = report_path.read_text()
    assert results["cpu"] in text
    assert "| start of `tracker` (1.25 s) / imports | 2.5 |" in text
    assert ("Not measured" in text) == (nodes is None)
    assert ("299/300" in text) == (nodes is not None)
    assert ("| posture | 4.00 ms, 4.00 ms |" in text) == (nodes is not None)
    assert (tmp_path / benchmark_report.PICTURE_OF_WAY).exists() == (nodes is not None)
    torso_us = 5 * core["stages"]["cost of all torsos"]["median_ms"]
    assert f"A rating takes {torso_us:.1f} us (torso)" in text
    assert "times faster" in capsys.readouterr().out


def test_a_folder_that_is_not_there_is_told_before_anything_is_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(benchmark, "measure_core", lambda *_: pytest.fail("measured"))
    assert main(["benchmark", "--json", str(tmp_path / "none" / "b.json")]) == 1
    assert "none" in capsys.readouterr().err


def test_the_committed_report_is_made_from_the_committed_numbers() -> None:
    results = read_json(ROOT / BENCHMARKS)
    assert set(PROMISED) <= set(results)
    assert (ROOT / "docs" / "benchmarks.md").read_text() == benchmark_report.report(results)


def test_a_step_takes_the_time_that_its_inner_steps_do_not() -> None:
    clock = film.Clock()

    def busy(seconds: float) -> None:
        end_s = time.thread_time() + seconds
        while time.thread_time() < end_s:
            pass

    inner = clock.timing("resizing", busy)

    def outer() -> None:
        busy(0.02)
        inner(0.04)

    clock.timing("decoding", outer)()
    clock.timing("drawing", outer)()
    assert clock.spent_s["decoding"] == pytest.approx(0.02, abs=0.01)
    assert clock.spent_s["resizing"] == pytest.approx(0.04, abs=0.01)
    assert clock.spent_s["drawing"] == pytest.approx(0.06, abs=0.01)
    assert sum(clock.spent_s.values()) == pytest.approx(0.12, abs=0.02)
