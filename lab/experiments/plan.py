"""The size of an evaluation: numbers of runs, and the values of the parameters."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Plan:
    """Sizes of the experiments.

    Attributes:
        runs: of experiments 1 to 3, each motion and strategy, and of tempered SRS.
        side_runs: of each setting of experiments 4 and 9.
        particle_runs: of each setting of experiment 5.
        model_runs: of each model of experiment 6, and of CMA-ES, which takes longest.
        peer_runs: of the other peers of experiment 10 that rate whole postures.
        model_every: stride of experiment 6 through the images.
        bodies: number of random people of experiment 8.
        seeds: number of seeds of experiment 8.
        survival_rates: e of experiment 4.
        particles: N of each filter in experiment 5.
        tempers: factors on sigma_gamma of the schemes with weights, experiment 9.
        speeds: name and stride of experiment 4: each image, each third, each sixth.
        fps: images a second of the synthetic sessions.
        size: their width and height, px.
        timing_rounds: repetitions of the timing of experiment 6.
        quick: whether this is a check that all works; the report says so.
    """

    runs: int
    side_runs: int
    particle_runs: int
    model_runs: int
    peer_runs: int
    bodies: int = 50
    seeds: int = 50
    model_every: int = 1
    survival_rates: tuple[float, ...] = (0.005, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0)
    particles: tuple[int, ...] = (25, 50, 100, 200, 400, 800, 1600)
    tempers: tuple[float, ...] = (0.005, 0.015, 0.05, 0.15, 0.5, 1.0)
    speeds: tuple[tuple[str, int], ...] = (("slow", 1), ("fast", 3), ("very_fast", 6))
    fps: float = 15.0
    size: tuple[int, int] = (320, 240)
    timing_rounds: int = 50
    quick: bool = False


def full_plan(runs: int) -> Plan:
    """Return the plan of the committed report; side experiments take a share of the runs."""
    few, fewer = max(2, runs // 5), max(2, runs // 10)
    return Plan(runs, few, fewer, fewer, few)


def quick_plan(runs: int) -> Plan:
    """Return a plan of under two minutes: the same experiments, fewer runs, bodies and values."""
    return Plan(
        runs=min(runs, 6),
        side_runs=2,
        particle_runs=2,
        model_runs=2,
        peer_runs=2,
        bodies=6,
        seeds=6,
        model_every=6,
        survival_rates=(0.005, 0.2, 0.4, 1.0),
        particles=(25, 100, 400),
        tempers=(0.015, 1.0),
        timing_rounds=10,
        quick=True,
    )
