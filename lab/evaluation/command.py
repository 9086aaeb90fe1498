"""The arguments of ``cardbox evaluate``: recorded sessions, or the paper's experiments."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from cardbox_tracker.commands.arguments import add_options, at_least, check_outputs
from cardbox_tracker.commands.request import Request
from cardbox_tracker.commands.tracking_request import points_named


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
        "--moving",
        action="store_true",
        help="with --films: by a camera that stands still, shakes and pans, across",
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
    add_options(parser, Request, "preset", "seed", "force")
    parser.add_argument(
        "--jobs", type=at_least(1), metavar="N", help="number of processes; one per core by default"
    )


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
    from lab.experiments import evaluate as experiments
    from lab.experiments import plan as plans

    plan = (plans.quick_plan if options.quick else plans.full_plan)(options.runs)
    experiments.evaluate(options.output, plan, options.seed, options.session, jobs)
    print(f"wrote {options.output}/report.md, and all numbers to {options.output}/results.json")


def _sessions(options: argparse.Namespace, jobs: int) -> None:
    from cardbox_tracker.common.progress import progress_bar
    from lab.evaluation import evaluate as sessions
    from lab.evaluation import plan as plans

    names = dict.fromkeys(sessions.result_name(folder) for folder in options.sessions)
    results = [options.output / f"{name}.md" for name in names]
    check_outputs((), options.force, inputs=options.sessions, results=results)
    plan = plans.Plan(
        options.preset,
        tuple(range(options.seed, options.seed + options.seeds)),
        options.recovery,
        tuple(options.silhouettes or (None,)),
        {
            name: None if name == plans.NO_POINTS else points_named(name)
            for name in options.detector
        },
    )
    with progress_bar("evaluate") as show:
        sessions.evaluate_sessions(options.sessions, options.output, plan, jobs, show)
    for path in results:
        print(f"wrote {path} and {path.with_suffix('.json')}")


def _films(options: argparse.Namespace, jobs: int) -> None:
    from lab.evaluation import films

    report = options.output / ("moving.md" if options.moving else "films.md")
    check_outputs((), options.force, inputs=options.films, results=[report])
    seeds = range(options.seed, options.seed + options.seeds)
    films.evaluate_films(options.films, report, options.preset, seeds, jobs, options.moving)
    print(f"wrote {report} and {report.with_suffix('.json')}")
