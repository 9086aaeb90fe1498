"""``cardbox evaluate``: the paper's experiments, from the recordings to the report."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation.precompile import compile_all
from cardbox_tracker.evaluation.paper import experiments
from cardbox_tracker.evaluation.paper.experiments import Cell, CellFactory
from cardbox_tracker.evaluation.paper.measuring import person_tasks, seed_tasks, summarize_measuring
from cardbox_tracker.evaluation.paper.models import microseconds_a_particle
from cardbox_tracker.evaluation.paper.plan import Plan, full_plan, quick_plan
from cardbox_tracker.evaluation.paper.plots import plot_all
from cardbox_tracker.evaluation.paper.report import write_report
from cardbox_tracker.evaluation.paper.results import provenance, write_curves, write_json
from cardbox_tracker.evaluation.paper.runner import Arrays, Parts, Task
from cardbox_tracker.evaluation.paper.sequences import write_sequence
from cardbox_tracker.evaluation.paper.sessions import (
    Session,
    load_session,
    recorded_session,
    synthetic_session,
)
from cardbox_tracker.evaluation.paper.tracking import per_frame, summarize
from cardbox_tracker.progress import progress_bar
from cardbox_tracker.simulation.motions import MOTIONS

Progress = Callable[[str], AbstractContextManager[Callable[[float], None]]]


def evaluate(
    output: Path,
    runs: int,
    seed: int = 0,
    quick: bool = False,
    session: Path | None = None,
    jobs: int = 1,
    plan: Plan | None = None,
    progress: Progress = progress_bar,
) -> dict[str, Any]:
    """Run the experiments and write everything into ``output``; resumes what was interrupted.

    Args:
        output: folder of ``results.json``, ``report.md``, figures, and the ``parts`` done so far.
        runs: of experiments 1 to 3; at least 2, as a standard deviation needs.
        seed: the same seed and runs give the same ``results.json``.
        quick: everything smaller.
        session: a recorded session with ground truth: experiments 1 to 3 on it alone.
        jobs: processes.
        plan: other sizes of the experiments, instead of ``runs`` and ``quick``.
        progress: makes a progress bar.

    Returns:
        What ``results.json`` holds.

    Raises:
        CardboxError: the output cannot be written, or the session cannot be read.
    """
    if runs < 2:
        raise CardboxError(f"runs is {runs}; expected 2 or more, to tell how they differ")
    start = time.perf_counter()
    # Once and here, before several processes would do so at the same time.
    compile_all()
    plan = plan or (quick_plan if quick else full_plan)(runs)
    parts = Parts(output / "parts")
    work = _Evaluation(parts, plan, seed, jobs, progress)
    if session is None:
        results, timing = work.synthetic()
    else:
        results, timing = work.recorded(session)
    results |= {
        "command": _command(output, runs, seed, quick, session),
        "seed": seed,
        "runs": plan.runs,
        "quick": quick,
        **provenance(),
    }
    timing |= {"jobs": jobs, "wall_s": time.perf_counter() - start}
    write_json(results, output / "results.json")
    write_json(timing, output / "timing.json")
    write_curves(work.curves, output / "per_frame.csv")
    plot_all(results, work.curves, work.true_angles(), output)
    for motion in work.sessions:
        write_sequence(*work.shown(motion), output / f"sequence_{motion}.png")
    write_report(results, timing, work.curves, output)
    return results


class _Evaluation:
    """The state of one evaluation."""

    def __init__(self, parts: Parts, plan: Plan, seed: int, jobs: int, progress: Progress) -> None:
        self._parts, self._plan, self._seed, self._jobs = parts, plan, seed, jobs
        self._progress = progress
        self.sessions: dict[str, tuple[str, Session]] = {}
        self.curves: dict[tuple[str, str], Any] = {}
        self._main: list[Cell] = []

    def synthetic(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """All experiments on synthetic sessions."""
        plan = self._plan
        tasks = {
            motion: Task(
                f"session-{motion}",
                synthesize,
                (motion, self._seed, plan.fps, plan.size),
                effort=duration_s,
            )
            for motion, (duration_s, _) in MOTIONS.items()
        }
        self._run("sessions", list(tasks.values()))
        for motion, task in tasks.items():
            path = self._parts.path(task)
            self.sessions[motion] = (path.name, load_session(path))
        factory = CellFactory(self.sessions, self._seed)
        self._main = experiments.main_cells(factory, plan.runs)
        side = experiments.side_cells(factory, plan)
        people = person_tasks(plan.bodies, self._seed)
        seeds = seed_tasks(plan.seeds, self._seed)
        work = [task for cell in (*self._main, *side) for task in cell.tasks]
        self._run("experiments", [*work, *people, *seeds])
        results = self._main_results()
        results["experiments"] = experiments.side_results(side, self._parts, self.sessions)
        measured, measuring_s = summarize_measuring(self._parts, people, seeds)
        results["experiments"]["initialization"] = measured
        results["plan"] = vars(plan) | {"size": list(plan.size)}
        timing = {
            "initialization": measuring_s,
            "particle_us": self._particle_us(),
            "frame_ms": self._frame_ms(),
            "processor_s": {
                name: self._processor_s([c for c in side if c.path[0] == name])
                for name in dict.fromkeys(cell.path[0] for cell in side)
            }
            | {
                "experiments_1_to_3": self._processor_s(self._main),
                "initialization": sum(self._parts.seconds(t) for t in (*people, *seeds)),
            },
        }
        return results, timing

    def recorded(self, folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
        """Experiments 1 to 3 on a recorded session."""
        truth = folder / "ground_truth.json"
        if truth.is_file():
            digest = hashlib.sha256(truth.read_bytes()).hexdigest()
        else:
            digest = ""
        task = Task("session", read_session, (str(folder.resolve()), digest, self._seed))
        self._run("session", [task])
        path = self._parts.path(task)
        session = load_session(path)
        self.sessions = dict.fromkeys(session.motions, (path.name, session))
        self._main = experiments.main_cells(CellFactory(self.sessions, self._seed), self._plan.runs)
        self._run("experiments", [task for cell in self._main for task in cell.tasks])
        results = self._main_results()
        results["session"] = {
            "name": folder.resolve().name,
            "initialization_iou": dict(session.initialization_iou),
            "images": len(session.silhouettes),
        }
        return results, {"processor_s": {"experiments_1_to_3": self._processor_s(self._main)}}

    def true_angles(self) -> dict[str, Any]:
        """True postures (n, 12) of the images of each motion, NaN where not known."""
        return {
            cell.motion: cell.load(self._parts, self.sessions[cell.motion][1]).postures
            for cell in self._main
            if cell.path == ("drs",)
        }

    def shown(self, motion: str) -> tuple[Session, Any, Any]:
        """Session, and indices and postures of the images of an image sequence: DRS, run 0."""
        session = self.sessions[motion][1]
        cell = next(c for c in self._main if c.path == ("drs",) and c.motion == motion)
        postures = self._parts.load(cell.tasks[0])["postures"][0]
        indices = [i for i in session.shown if session.segments[i] == motion]
        return session, indices, postures[indices]

    def _main_results(self) -> dict[str, Any]:
        results: dict[str, Any] = {motion: {} for motion in self.sessions}
        for cell in self._main:
            runs = cell.load(self._parts, self.sessions[cell.motion][1])
            (strategy,) = cell.path
            results[cell.motion][strategy] = summarize(runs)
            self.curves[cell.motion, strategy] = per_frame(runs)
        return results

    def _run(self, text: str, tasks: list[Task]) -> None:
        with self._progress(text) as show:
            self._parts.run(tasks, self._jobs, show)

    def _processor_s(self, cells: list[Cell]) -> float:
        tasks = {self._parts.path(task): task for cell in cells for task in cell.tasks}
        return sum(self._parts.seconds(task) for task in tasks.values())

    def _particle_us(self) -> dict[str, float]:
        session = next(iter(self.sessions.values()))[1]
        middle = session.silhouettes[len(session.silhouettes) // 2]
        return microseconds_a_particle(
            session.body, session.camera, middle, 200, self._plan.timing_rounds
        )

    def _frame_ms(self) -> float:
        """Mean time of an image in experiments 1 to 3, while all cores are busy."""
        frames = sum(
            self._plan.runs * len(self.sessions[c.motion][1].silhouettes) for c in self._main
        )
        return 1e3 * self._processor_s(self._main) / frames


def synthesize(folder: Path, motion: str, seed: int, fps: float, size: tuple[int, int]) -> Arrays:
    """Task: a synthetic session."""
    return synthetic_session(motion, seed, fps, size).to_arrays()


def read_session(folder: Path, session: str, digest: str, seed: int) -> Arrays:
    """Task: the recorded session in the folder ``session``, whose truth has that ``digest``."""
    return recorded_session(Path(session), seed).to_arrays()


def _command(output: Path, runs: int, seed: int, quick: bool, session: Path | None) -> str:
    words = [f"cardbox evaluate --runs {runs}"]
    if session is not None:
        words.append(f"--session {session}")
    words.append(f"--output {output}")
    if quick:
        words.append("--quick")
    words.append(f"--seed {seed}")
    return " ".join(words)
