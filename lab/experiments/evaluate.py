"""The paper's experiments, from the recordings to the report: ``cardbox evaluate --runs N``."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cardbox_tracker.applications.simulation.motions import MOTIONS
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.progress import progress_bar
from cardbox_tracker.tracking.precompile import compile_all
from lab.evaluation.results import provenance, write_json
from lab.experiments.cells import (
    Cell,
    CellFactory,
    main_cells,
    method_cells,
    side_cells,
    side_results,
)
from lab.experiments.digest import paper_digest
from lab.experiments.measuring import person_calls, seed_calls, summarize_measuring
from lab.experiments.models import microseconds_a_particle
from lab.experiments.parallel import Call, Done, Progress, Runner
from lab.experiments.plan import Plan
from lab.experiments.plots import plot_all
from lab.experiments.report import write_report
from lab.experiments.results import Curves, write_curves
from lab.experiments.sequences import write_sequence
from lab.experiments.sessions import Session, recorded_session, synthetic_session
from lab.experiments.tracking import per_frame, summarize

Results = dict[str, Any]


def evaluate(
    output: Path,
    plan: Plan,
    seed: int = 0,
    session: Path | None = None,
    jobs: int = 1,
    progress: Progress = progress_bar,
) -> Results:
    """Run the experiments and write everything into ``output``; resume an interrupted run.

    Args:
        output: folder of ``results.json``, ``report.md``, figures, and the cache ``parts``.
        plan: sizes of the experiments; a standard deviation needs two runs or more.
        seed: the same seed and plan give the same ``results.json``.
        session: a recorded session with ground truth, for experiments 1 to 3 on it alone.
        jobs: number of processes.
        progress: makes a progress bar.

    Returns:
        The contents of ``results.json``.

    Raises:
        CardboxError: the output cannot be written, or the session cannot be read.
    """
    if plan.runs < 2:
        raise CardboxError(f"runs is {plan.runs}; expected 2 or more for a standard deviation")
    start = time.perf_counter()
    # Who commits or edits during the hours of a measurement changes neither.
    measured = {**provenance(), "digest": paper_digest()}
    # Compile before the processes start, which would all compile the same code.
    compile_all()
    runner = Runner(output / "parts", jobs, progress)
    if session is None:
        sessions = _synthetic_sessions(runner, plan, seed)
    else:
        read = recorded_session(session, seed)
        sessions = dict.fromkeys(read.motions, read)
    factory = CellFactory(sessions, seed)
    main = main_cells(factory, plan.runs)
    methods = method_cells(factory, plan)
    side = side_cells(factory, plan) if session is None else []
    people = person_calls(plan.bodies, seed) if session is None else []
    seeds = seed_calls(plan.seeds, seed) if session is None else []
    tracked = [call for cell in (*main, *methods, *side) for call in cell.calls]
    done = runner.run("experiments", [*tracked, *people, *seeds])

    results, curves = _main_results(main, done)
    results |= side_results(methods, done)
    timing: Results = {"processor_s": {"experiments_1_to_3": _processor_s(main, done)}}
    if session is None:
        sizes, timing["initialization"] = summarize_measuring(
            *([done[call].result for call in calls] for calls in (people, seeds))
        )
        results["experiments"] = side_results(side, done) | {"initialization": sizes}
        results["plan"] = vars(plan) | {"size": list(plan.size)}
        timing |= _side_timing(main, [*methods, *side], [*people, *seeds], done, plan)
    else:
        results["session"] = {
            "name": session.resolve().name,
            "initialization_iou": dict(read.initialization_iou),
            "images": len(read.silhouettes),
        }
    results |= {
        "command": _command(output, plan, seed, session),
        "seed": seed,
        "runs": plan.runs,
        "quick": plan.quick,
        **measured,
    }
    timing |= {"jobs": jobs, "wall_s": time.perf_counter() - start}
    write_json(results, output / "results.json")
    write_json(timing, output / "timing.json")
    write_curves(curves, output / "per_frame.csv")
    drs = [cell for cell in main if cell.path == ("drs",)]
    truth = {cell.motion: cell.load(done).postures for cell in drs}
    plot_all(results, curves, truth, output)
    for cell in drs:
        _write_first_run(cell, done, output / f"sequence_{cell.motion}.png")
    write_report(results, timing, output)
    return results


def _synthetic_sessions(runner: Runner, plan: Plan, seed: int) -> dict[str, Session]:
    calls = {
        motion: Call(synthetic_session, (motion, seed, plan.fps, plan.size)) for motion in MOTIONS
    }
    done = runner.run("sessions", calls.values())
    return {motion: done[call].result for motion, call in calls.items()}


def _main_results(cells: list[Cell], done: Mapping[Call, Done]) -> tuple[Results, Curves]:
    results: Results = {}
    curves = {}
    for cell in cells:
        (strategy,) = cell.path
        runs = cell.load(done)
        results.setdefault(cell.motion, {})[strategy] = summarize(runs)
        curves[cell.motion, strategy] = per_frame(runs)
    return results, curves


def _write_first_run(cell: Cell, done: Mapping[Call, Done], path: Path) -> None:
    """Write the image sequence of the cell's motion, as its first run estimates it."""
    session = cell.session
    postures = done[cell.calls[0]].result.postures[0]
    indices = [i for i in session.shown if session.segments[i] == cell.motion]
    write_sequence(session, indices, postures[indices], path)


def _side_timing(
    main: list[Cell],
    side: list[Cell],
    measuring: list[Call],
    done: Mapping[Call, Done],
    plan: Plan,
) -> Results:
    """Return the times of a posture and of each experiment."""
    session = main[0].session
    middle = session.silhouettes[len(session.silhouettes) // 2]
    by_name: dict[str, list[Cell]] = {}
    for cell in side:
        by_name.setdefault(cell.path[0], []).append(cell)
    return {
        "particle_us": microseconds_a_particle(
            session.body, session.camera, middle, 200, plan.timing_rounds
        ),
        "processor_s": {name: _processor_s(cells, done) for name, cells in by_name.items()}
        | {
            "experiments_1_to_3": _processor_s(main, done),
            "initialization": sum(done[call].seconds for call in measuring),
        },
    }


def _processor_s(cells: list[Cell], done: Mapping[Call, Done]) -> float:
    return sum(done[call].seconds for call in {call for cell in cells for call in cell.calls})


def _command(output: Path, plan: Plan, seed: int, session: Path | None) -> str:
    words = [f"cardbox evaluate --runs {plan.runs}"]
    if session is not None:
        words.append(f"--session {session}")
    words.append(f"--output {output}")
    if plan.quick:
        words.append("--quick")
    words.append(f"--seed {seed}")
    return " ".join(words)
