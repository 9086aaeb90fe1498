"""``cardbox evaluate``: recorded sessions with ground truth, or the paper's experiments.

``lab/experiments/`` of a checkout has the experiments.
"""

from __future__ import annotations

import argparse
import os
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from cardbox_tracker.commands.arguments import (
    add_force,
    add_preset,
    add_seed,
    at_least,
    check_outputs,
)
from cardbox_tracker.commands.checkout import from_checkout
from cardbox_tracker.commands.request import points_named

if TYPE_CHECKING:
    from cardbox_tracker.recordings.silhouettes import RecordedFrame
    from cardbox_tracker.tracking.estimate import Estimate
    from cardbox_tracker.tracking.tracker import Tracker

NAME = "evaluate"
HELP = (
    "compare recorded sessions with their truth, or (in a checkout) repeat the paper's experiments"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox evaluate``."""
    parser.add_argument(
        "--runs",
        type=at_least(2),
        default=100,
        metavar="N",
        help="runs of each strategy and motion",
    )
    parser.add_argument(
        "--output", type=Path, required=True, metavar="DIR", help="folder of results"
    )
    parser.add_argument("--quick", action="store_true", help="everything smaller, in two minutes")
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        "--session",
        type=Path,
        metavar="DIR",
        help="a recording with ground_truth.json instead of synthetic ones",
    )
    what.add_argument(
        "--sessions",
        type=Path,
        nargs="+",
        metavar="DIR",
        help="recorded sessions (bag/, ground_truth.json) to track and compare, instead of the "
        "paper's experiments; whoever takes the reference postures in a session is measured first",
    )
    what.add_argument(
        "--films",
        type=Path,
        nargs="+",
        metavar="DIR",
        help="such sessions, made into upright films and films across, and tracked as 'cardbox "
        "track FILM --detector mediapipe' does: with field of view and stature, and with neither",
    )
    parser.add_argument(
        "--silhouettes",
        nargs="+",
        choices=("background", "detector"),
        help="with --sessions: sources of the silhouettes, one run for each; by default the empty "
        "scene of a session, or else the masks of the detector",
    )
    parser.add_argument(
        "--detector",
        nargs="+",
        default=["none"],
        metavar="none|mediapipe|FILE.csv",
        help="with --sessions: sources of 2D points as in 'cardbox track', one run for each",
    )
    parser.add_argument(
        "--seeds",
        type=at_least(1),
        default=3,
        metavar="N",
        help="with --sessions or --films: number of runs, with consecutive seeds from --seed on",
    )
    parser.add_argument(
        "--recovery",
        action="store_true",
        help="with --sessions: also count the recoveries from disturbances",
    )
    add_preset(parser)
    parser.add_argument(
        "--jobs",
        type=at_least(1),
        metavar="N",
        help="number of processes; one per core by default",
    )
    add_seed(parser, "recordings and filters")
    add_force(parser)


def run(options: argparse.Namespace) -> None:
    """Run the experiments and write report, plots and numbers."""
    jobs = options.jobs or len(os.sched_getaffinity(0))
    if options.sessions:
        _sessions(options, jobs)
        return
    if options.films:
        _films(options, jobs)
        return
    inputs = [options.session] if options.session else []
    check_outputs((), options.force, inputs=inputs, results=(options.output / "report.md",))
    experiments = from_checkout("lab.experiments.evaluate", "experiments")
    plans = from_checkout("lab.experiments.plan", "experiments")
    plan = (plans.quick_plan if options.quick else plans.full_plan)(options.runs)
    experiments.evaluate(options.output, plan, options.seed, options.session, jobs)
    print(f"wrote {options.output}/report.md, and all numbers to {options.output}/results.json")


def _sessions(options: argparse.Namespace, jobs: int) -> None:
    from cardbox_tracker.applications.evaluation.evaluate import evaluate_sessions, result_name
    from cardbox_tracker.applications.evaluation.plan import NO_POINTS, Plan
    from cardbox_tracker.common.progress import progress_bar

    names = dict.fromkeys(result_name(folder) for folder in options.sessions)
    results = [options.output / f"{name}.md" for name in names]
    check_outputs((), options.force, inputs=options.sessions, results=results)
    plan = Plan(
        options.preset,
        tuple(range(options.seed, options.seed + options.seeds)),
        options.recovery,
        tuple(options.silhouettes or (None,)),
        {name: None if name == NO_POINTS else points_named(name) for name in options.detector},
    )
    with progress_bar("evaluate") as show:
        evaluate_sessions(options.sessions, options.output, plan, jobs, show)
    for path in results:
        print(f"wrote {path} and {path.with_suffix('.json')}")


def _films(options: argparse.Namespace, jobs: int) -> None:
    from cardbox_tracker.applications.evaluation.films import SHAPES, films_report
    from cardbox_tracker.applications.evaluation.results import provenance, write_json
    from cardbox_tracker.applications.evaluation.session import load_session
    from cardbox_tracker.common.files import atomic_path
    from cardbox_tracker.common.progress import progress_bar
    from cardbox_tracker.tracking.precompile import compile_all

    report = options.output / "films.md"
    check_outputs((), options.force, inputs=options.films, results=[report])
    for folder in options.films:
        load_session(folder)
    options.output.mkdir(parents=True, exist_ok=True)
    compile_all()
    seeds = range(options.seed, options.seed + options.seeds)
    words = ["--detector", "mediapipe", "--preset", options.preset]
    films: list[dict[str, Any]] = []
    with (
        progress_bar("evaluate") as show,
        ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool,
    ):
        work = [
            pool.submit(_film, folder, shape, words, seeds)
            for folder in options.films
            for shape in SHAPES
        ]
        for done, future in enumerate(work, 1):
            films += future.result()
            show(done / len(work))
    names = " ".join(folder.name for folder in options.films)
    how = f"--preset {options.preset} --seed {options.seed} --seeds {options.seeds}"
    results = {
        "command": f"cardbox evaluate --films {names} {how} --output DIR",
        "films": sorted(films, key=lambda film: (film["given"], film["shape"])),
        "provenance": provenance(),
    }
    write_json(results, report.with_suffix(".json"))
    with atomic_path(report) as temporary:
        temporary.write_text(films_report(results), encoding="utf-8")
    print(f"wrote {report} and {report.with_suffix('.json')}")


def _film(folder: Path, shape: str, words: list[str], seeds: range) -> list[dict[str, Any]]:
    """Return the entries of one session in ``films.json``, one for all that is given."""
    from cardbox_tracker.applications.evaluation.films import film_figures, make_film
    from cardbox_tracker.commands.request import add_tracking, tracking_request
    from cardbox_tracker.commands.tracking import track

    parser, found = argparse.ArgumentParser(), list[dict[str, Any]]()
    add_tracking(parser)
    with TemporaryDirectory() as made:
        film = make_film(folder, shape, Path(made) / f"{folder.name}.mp4")
        known = ["--fov", f"{film.fov_deg:.1f}", "--stature", str(film.session.truth.stature_m)]
        for given, more in {"field of view, stature": known, "nothing": []}.items():
            runs = []
            for seed in seeds:
                typed = parser.parse_args([str(film.path), *words, *more, "--seed", str(seed)])
                estimates: list[Estimate] = []
                summary = track(
                    tracking_request(typed),
                    (partial(_keep, estimates),),
                    lambda _: None,
                )
                runs.append(film_figures(film, estimates, summary.body))
            found.append(
                {
                    "name": f"{folder.name}, {shape}",
                    "group": folder.resolve().parent.name,
                    "shape": shape,
                    "given": given,
                    "mediapipe_aligned": film.session.mediapipe.get("aligned"),
                    "runs": runs,
                }
            )
    return found


def _keep(estimates: list[Estimate], _: RecordedFrame, estimate: Estimate, __: Tracker) -> None:
    estimates.append(estimate)
