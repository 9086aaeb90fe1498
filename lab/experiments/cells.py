"""The settings that each experiment compares, and its results.

A cell is one setting on one motion. Its path, such as ("survival_rate", "fast", "0.2"), is the
place of its figures in ``results.json``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from cardbox_tracker.search.config import TrackerConfig, default_preset, paper_preset
from cardbox_tracker.search.resampling import SCHEMES, STRATEGIES
from lab.experiments.models import MODELS
from lab.experiments.parallel import Call, Done
from lab.experiments.plan import Plan
from lab.experiments.sessions import Session
from lab.experiments.tracking import (
    MotionRuns,
    Setting,
    brief,
    calls_of,
    comparable,
    mean_brief,
    select_motion,
    stacked,
)

COMPARED = ("drs", "srs")
"""The strategies that the paper compares."""

TEMPER = 0.015
"""Factor on Table I's sigma_gamma of the tempered SRS: 120 and 60 px."""


@dataclass(frozen=True)
class Cell:
    """One setting on one motion of a session."""

    path: tuple[str, ...]
    motion: str
    session: Session
    setting: Setting
    runs: int

    @property
    def calls(self) -> list[Call]:
        """The calls that track it."""
        return calls_of(self.session, self.setting, self.runs)

    def load(self, done: Mapping[Call, Done]) -> MotionRuns:
        """Return its runs over the images of its motion."""
        runs = stacked([done[call].result for call in self.calls])
        return select_motion(runs, self.session, self.motion, self.setting.every)


class CellFactory:
    """Makes cells of settings on the sessions of one evaluation."""

    def __init__(self, sessions: Mapping[str, Session], seed: int) -> None:
        """Store the session of each motion, and the seed."""
        self._sessions = sessions
        self._seed = seed

    def cells(
        self,
        path: tuple[str, ...],
        config: TrackerConfig,
        runs: int,
        every: int = 1,
        model: str = "compiled",
        peer: str | None = None,
    ) -> list[Cell]:
        """Return a cell for each motion."""
        setting = Setting(comparable(config), self._seed, every, model, peer)
        return [
            Cell(path, motion, session, setting, runs) for motion, session in self._sessions.items()
        ]


def main_cells(factory: CellFactory, runs: int) -> list[Cell]:
    """Return the cells of experiments 1 to 3: Table I with DRS and with SRS."""
    return [
        cell
        for strategy in COMPARED
        for cell in factory.cells((strategy,), replace(paper_preset(), strategy=strategy), runs)
    ]


def method_cells(factory: CellFactory, plan: Plan) -> list[Cell]:
    """Return the cells of experiment 10: the paper's filter and its peers."""
    paper = paper_preset()
    srs = replace(paper, strategy="srs")
    tempered = _tempered(srs, TEMPER)
    methods: dict[str, tuple[TrackerConfig, str | None, int]] = {
        "DRS, Table I": (paper, None, plan.runs),
        "SRS, Table I": (srs, None, plan.runs),
        "SRS, tempered": (tempered, None, plan.runs),
        "DRS, flat": (paper, "flat", plan.peer_runs),
        "SRS, flat, tempered": (tempered, "flat", plan.peer_runs),
        "annealed particle filter": (paper, "annealed", plan.peer_runs),
        "CMA-ES": (paper, "cma_es", plan.model_runs),
    }
    return [
        cell
        for name, (config, peer, runs) in methods.items()
        for cell in factory.cells(("methods", name), config, runs, peer=peer)
    ]


def side_cells(factory: CellFactory, plan: Plan) -> list[Cell]:
    """Return the cells of experiments 4, 5, 6 and 9, and of the variants beyond the paper."""
    paper = paper_preset()
    cells: list[Cell] = []
    for speed, every in plan.speeds:
        for rate in plan.survival_rates:
            config = _both(paper, survival_rate=rate)
            path = ("survival_rate", speed, f"{rate:g}")
            cells += factory.cells(path, config, plan.side_runs, every)
    for strategy in COMPARED:
        for count in plan.particles:
            config = replace(paper, strategy=strategy).with_particles(count)
            cells += factory.cells(("particles", strategy, str(count)), config, plan.particle_runs)
    for model in MODELS:
        cells += factory.cells(("models", model), paper, plan.model_runs, plan.model_every, model)
    for strategy in STRATEGIES:
        for elite in (True, False):
            config = _both(replace(paper, strategy=strategy), elite=elite)
            path = ("schemes", strategy, "elite" if elite else "no_elite")
            cells += factory.cells(path, config, plan.side_runs)
    for strategy in SCHEMES:
        for factor in plan.tempers:
            config = _tempered(replace(paper, strategy=strategy), factor)
            cells += factory.cells(("tempers", strategy, f"{factor:g}"), config, plan.side_runs)
    for name, config in {
        "paper": paper,
        "torso_rated_alone": replace(paper, torso_beside_arms=False),
        "default": default_preset(),
    }.items():
        cells += factory.cells(("variants", name), config, plan.side_runs)
    return cells


def _tempered(config: TrackerConfig, factor: float) -> TrackerConfig:
    """Return ``config`` with ``factor`` times its sigma_gamma."""
    torso, arm = (
        replace(one, sigma_gamma_px=factor * one.sigma_gamma_px)
        for one in (config.torso, config.arm)
    )
    return replace(config, torso=torso, arm=arm)


def _both(config: TrackerConfig, **changes: Any) -> TrackerConfig:
    """Return ``config`` with the same change in the filters of torso and arms."""
    return replace(
        config, torso=replace(config.torso, **changes), arm=replace(config.arm, **changes)
    )


def side_results(cells: Sequence[Cell], done: Mapping[Call, Done]) -> dict[str, Any]:
    """Return the figures of all ``cells``, nested by path, then by motion and ``mean``."""
    loaded: dict[tuple[str, ...], dict[str, MotionRuns]] = {}
    for cell in cells:
        loaded.setdefault(cell.path, {})[cell.motion] = cell.load(done)
    results: dict[str, Any] = {}
    for path, motions in loaded.items():
        place = results
        for step in path:
            place = place.setdefault(step, {})
        place |= {motion: brief(runs) for motion, runs in motions.items()}
        place["mean"] = mean_brief(list(motions.values()))
    for model in results.get("models", ()):
        results["models"][model]["planes"] = MODELS[model].n_planes
    return results
