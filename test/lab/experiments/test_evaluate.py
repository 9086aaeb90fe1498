"""``cardbox evaluate`` as a whole, on tiny settings."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import pytest

from cardbox_tracker.applications.simulation.motions import MOTIONS
from cardbox_tracker.commands.main import main
from cardbox_tracker.person.sizes import SIZE_NAMES
from cardbox_tracker.person.skeleton import JOINT_NAMES, KEYPOINT_NAMES
from cardbox_tracker.search.resampling import SCHEMES, STRATEGIES
from lab.experiments.digest import paper_digest
from lab.experiments.evaluate import evaluate
from lab.experiments.parallel import Progress
from lab.experiments.plan import Plan, full_plan, quick_plan

FIGURES = (
    *(f"error_{motion}.png" for motion in MOTIONS),
    *(f"sequence_{motion}.png" for motion in MOTIONS),
    *("cost.png", "reproducibility.png", "survival.png", "particles.png"),
    *("schemes.png", "initialization.png"),
)


@pytest.fixture(scope="module")
def output(
    of_recording: Path,
    tmp_path_factory: pytest.TempPathFactory,
    tiny_plan: Plan,
    silent: Progress,
) -> Path:
    """The results of all experiments, in a folder with those of a recorded session."""
    folder = tmp_path_factory.mktemp("tiny")
    shutil.copytree(of_recording, folder / "person")
    evaluate(folder, tiny_plan, progress=silent)
    return folder


def results_in(folder: Path) -> dict[str, Any]:
    loaded: dict[str, Any] = json.loads((folder / "results.json").read_text())
    return loaded


def without_place(results: dict[str, Any]) -> dict[str, Any]:
    """All but the command, which names the folder."""
    return {name: value for name, value in results.items() if name != "command"}


def test_results_are_keyed_by_motion_and_strategy(output: Path, tiny_plan: Plan) -> None:
    results = results_in(output)
    for motion in ("wave", "bend", "bow"):
        assert set(results[motion]) == {"drs", "srs"}
        for figures in results[motion].values():
            assert figures["mean_cost_px"] > 0
            assert tuple(figures["error_m"]) == KEYPOINT_NAMES
            assert tuple(figures["std_dof"]) == JOINT_NAMES
            assert all(0 < error < 2 for error in figures["error_m"].values())
            assert figures["runs"] == tiny_plan.runs
            assert set(figures["axis_error_m"]) == {"lateral", "vertical", "depth"}
            assert figures["pa_mpjpe_m"] < figures["mpjpe_m"]


def test_results_say_where_they_come_from(output: Path, tiny_plan: Plan) -> None:
    results = results_in(output)
    assert results["command"].startswith("cardbox evaluate --runs 3 --output")
    assert results["seed"] == 0
    assert results["cpu"]
    assert set(results["versions"]) == {"cardbox_tracker", "python", "numpy", "opencv", "numba"}
    assert "commit" in results
    assert results["plan"]["particles"] == list(tiny_plan.particles)


def test_every_experiment_has_its_results(output: Path, tiny_plan: Plan) -> None:
    sides = results_in(output)["experiments"]
    assert set(sides["survival_rate"]) == {"slow", "fast"}
    assert list(sides["survival_rate"]["fast"]) == ["0.005", "0.4", "1"]
    assert list(sides["particles"]["srs"]) == ["25", "50"]
    assert sides["models"]["cardbox"]["planes"] < sides["models"]["volumetric"]["planes"]
    assert set(sides["schemes"]) == set(STRATEGIES)
    assert set(sides["schemes"]["systematic"]) == {"elite", "no_elite"}
    assert set(sides["variants"]) == {"paper", "torso_rated_alone", "default"}
    assert set(sides["tempers"]) == set(SCHEMES)
    sharp, flat = (sides["tempers"]["srs"][factor]["mean"] for factor in ("0.015", "1"))
    assert 1 <= sharp["effective_particles"] < flat["effective_particles"] <= 200
    for cell in (sides["schemes"]["drs"]["elite"], sides["survival_rate"]["slow"]["1"]):
        assert set(cell) == {*MOTIONS, "mean"}
        mean = sum(cell[motion]["mpjpe_m"] for motion in MOTIONS) / len(MOTIONS)
        assert cell["mean"]["mpjpe_m"] == pytest.approx(mean, abs=1e-5)
    assert tuple(sides["initialization"]["mean_abs_error_m"]) == SIZE_NAMES
    assert sides["initialization"]["bodies"] == tiny_plan.bodies


def test_settings_that_experiments_share_give_the_same_figures(output: Path) -> None:
    sides = results_in(output)["experiments"]
    assert sides["schemes"]["drs"]["elite"] == sides["variants"]["paper"]
    assert sides["tempers"]["srs"]["1"] == sides["schemes"]["srs"]["elite"]


def test_all_methods_rate_as_many_states(output: Path) -> None:
    methods = results_in(output)["methods"]
    assert len(methods) == 7
    for name, by_motion in methods.items():
        assert by_motion["mean"]["ratings"] == pytest.approx(600, rel=0.01), name
    assert methods["DRS, Table I"]["bow"]["mpjpe_m"] == results_in(output)["bow"]["drs"]["mpjpe_m"]


def test_results_have_the_digest_of_the_sources(output: Path) -> None:
    assert results_in(output)["digest"] == paper_digest()


def test_figures_and_report_are_there(output: Path) -> None:
    report = (output / "report.md").read_text()
    for name in FIGURES:
        assert cv2.imread(str(output / name)) is not None, name
        assert f"({name})" in report
    for number in range(1, 11):
        assert f"\n## {number}. " in report
    for word in ("DRS below SRS", "commit", "MPJPE"):
        assert word in report
    assert "nan" not in report


def test_no_time_is_in_the_results(output: Path) -> None:
    text = (output / "results.json").read_text()
    timing = json.loads((output / "timing.json").read_text())
    assert "_us" not in text
    assert "wall" not in text
    assert timing["particle_us"]["volumetric"] > 0


def test_every_image_of_every_motion_is_in_the_table(output: Path) -> None:
    with (output / "per_frame.csv").open() as file:
        rows = list(csv.DictReader(file))
    results = results_in(output)
    for motion in MOTIONS:
        for strategy in ("drs", "srs"):
            chosen = [r for r in rows if (r["motion"], r["strategy"]) == (motion, strategy)]
            assert len(chosen) == results[motion][strategy]["frames"]
            mean = sum(float(row["cost_px"]) for row in chosen) / len(chosen)
            assert mean == pytest.approx(results[motion][strategy]["mean_cost_px"], rel=1e-3)


@pytest.fixture(scope="module")
def of_recording(
    recording: Path, tmp_path_factory: pytest.TempPathFactory, silent: Progress
) -> Path:
    """The results of a recorded session with seed 1."""
    folder = tmp_path_factory.mktemp("recorded")
    evaluate(folder, full_plan(2), 1, session=recording, progress=silent)
    return folder


def test_resuming_an_interrupted_evaluation_gives_the_same(
    recording: Path, of_recording: Path, tmp_path: Path, silent: Progress
) -> None:
    @contextmanager
    def interrupting(text: str) -> Iterator[Callable[[float], None]]:
        def show(fraction: float) -> None:
            raise KeyboardInterrupt

        yield show

    with pytest.raises(KeyboardInterrupt):
        evaluate(tmp_path, full_plan(2), 1, session=recording, progress=interrupting)
    assert not (tmp_path / "results.json").exists()
    evaluate(tmp_path, full_plan(2), 1, session=recording, progress=silent)
    assert without_place(results_in(tmp_path)) == without_place(results_in(of_recording))
    assert (tmp_path / "per_frame.csv").read_bytes() == (
        of_recording / "per_frame.csv"
    ).read_bytes()


def test_a_recorded_session_with_another_seed(
    recording: Path, of_recording: Path, tmp_path: Path
) -> None:
    arguments = ["evaluate", "--session", str(recording), "--runs", "2", "--jobs", "1"]
    assert main([*arguments, "--seed", "2", "--output", str(tmp_path / "out")]) == 0
    results = results_in(tmp_path / "out")
    assert set(results["bow"]) == {"drs", "srs"}
    assert results["bow"]["srs"]["runs"] == 2
    # That the same seed gives the same is seen where an evaluation is resumed.
    assert results["bow"]["drs"]["error_m"] != results_in(of_recording)["bow"]["drs"]["error_m"]
    assert results["session"]["name"] == "person"
    assert "experiments" not in results
    report = (tmp_path / "out" / "report.md").read_text()
    assert "recorded session person" in report
    assert "(sequence_bow.png)" in report
    assert (tmp_path / "out" / "sequence_bow.png").exists()


def test_recorded_sessions_below_the_output_are_in_its_report(output: Path) -> None:
    report = (output / "report.md").read_text()
    assert "## Recorded sessions" in report
    assert "[person](person/report.md)" in report


def test_quick_is_smaller_than_full_in_everything() -> None:
    quick, full = quick_plan(100), full_plan(100)
    assert (full.runs, full.bodies, full.seeds) == (100, 50, 50)
    assert full.particles[0] == 25
    assert full.particles[-1] == 1600
    for name in (
        "runs",
        "side_runs",
        "particle_runs",
        "model_runs",
        "peer_runs",
        "bodies",
        "seeds",
    ):
        assert getattr(quick, name) < getattr(full, name)
    assert set(quick.survival_rates) < set(full.survival_rates)
    assert set(quick.particles) < set(full.particles)
    assert full_plan(5).side_runs == 2


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--runs", "1"], "expected a whole number of 2 or more"),
        (["--runs", "many"], "expected a whole number of 2 or more"),
        (["--jobs", "0"], "expected a whole number of 1 or more"),
        (["--seed", "-1"], "expected a whole number of 0 or more"),
    ],
)
def test_bad_numbers_are_told(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["evaluate", "--output", str(tmp_path), *arguments])
    assert stopped.value.code == 2
    assert words in capsys.readouterr().err


def test_an_output_that_cannot_be_a_folder_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    assert main(["evaluate", "--runs", "2", "--output", str(tmp_path / "file")]) == 1
    told = capsys.readouterr().err
    assert str(tmp_path / "file") in told
    assert "--output" in told
    assert "Traceback" not in told


def test_a_session_without_ground_truth_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["evaluate", "--runs", "2", "--jobs", "1", "--session", str(tmp_path)]
    assert main([*arguments, "--output", str(tmp_path / "out")]) == 1
    told = capsys.readouterr().err
    assert "has no ground_truth.json" in told
    assert "Traceback" not in told
