"""The figures of an evaluation, as PNG files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from cardbox_tracker.person.skeleton import JOINT_NAMES, KEYPOINT_NAMES
from cardbox_tracker.search.config import paper_preset
from lab.experiments.results import Curves, motions_in
from lab.experiments.tracking import FloatArray
from lab.pages import plot

COLOURS = {"drs": "tab:blue", "srs": "tab:orange"}
ELBOW = "left_elbow_abduction"
"""The angle of the reproducibility plot, which changes most in the waving motion."""
_FIGURES = (("mpjpe_m", 100.0, "3D error [cm]"), ("mean_cost_px", 1.0, "mean cost [px]"))


def plot_all(
    results: Mapping[str, Any],
    curves: Curves,
    true_postures: Mapping[str, FloatArray],
    folder: Path,
) -> None:
    """Write every figure that ``results`` has data for."""
    motions = motions_in(results)
    for motion in motions:
        plot_errors(motion, curves, folder / f"error_{motion}.png")
    plot_costs(motions, curves, folder / "cost.png")
    plot_elbow(motions, curves, true_postures, folder / "reproducibility.png")
    sides = results.get("experiments")
    if sides is not None:
        plot_survival(sides["survival_rate"], folder / "survival.png")
        plot_particles(sides["particles"], folder / "particles.png")
        plot_schemes(sides["schemes"], folder / "schemes.png")
        plot_initialization(sides["initialization"], folder / "initialization.png")


def plot_errors(motion: str, curves: Curves, path: Path) -> None:
    """Plot the error of each of the six joints, per image (the paper's figures GT1 and GT2)."""
    with _figure(path, 2, 3, (12, 5.2), sharex=True, sharey=True) as axes:
        for axis, name in zip(axes.ravel(), KEYPOINT_NAMES, strict=True):
            _curves(axis, motion, curves, f"error_{name}_m", 100.0)
            axis.set_title(name.replace("_", " "), fontsize=10)
        for axis in axes[:, 0]:
            axis.set_ylabel("3D error [cm]")
        for axis in axes[0]:
            axis.set_xlabel("")
        axes[0, 0].legend()


def plot_costs(motions: Sequence[str], curves: Curves, path: Path) -> None:
    """Plot the cost of the system's output, per image."""
    with _figure(path, 1, len(motions), (4.2 * len(motions), 3.2), sharey=True) as axes:
        for axis, motion in zip(axes[0], motions, strict=True):
            _curves(axis, motion, curves, "cost_px")
            axis.set_title(motion)
        axes[0, 0].set_ylabel("mean cost [px]")
        axes[0, 0].legend()


def _curves(axis: Any, motion: str, curves: Curves, column: str, scale: float = 1.0) -> None:
    for strategy, colour in COLOURS.items():
        columns = curves[motion, strategy]
        axis.plot(columns["time_s"], scale * columns[column], colour, label=strategy.upper())
    axis.set_xlabel("time [s]")


def plot_elbow(
    motions: Sequence[str], curves: Curves, true_postures: Mapping[str, FloatArray], path: Path
) -> None:
    """Plot the mean of one elbow angle and one standard deviation to each side."""
    with _figure(path, 1, len(motions), (4.8 * len(motions), 3.6), sharey=True) as axes:
        for axis, motion in zip(axes[0], motions, strict=True):
            for strategy, colour in COLOURS.items():
                columns = curves[motion, strategy]
                mean, stddev = columns[f"mean_{ELBOW}"], columns[f"std_{ELBOW}"]
                time_s = columns["time_s"]
                axis.plot(time_s, mean, colour, label=f"{strategy.upper()} mean")
                for line in (mean - stddev, mean + stddev):
                    axis.plot(time_s, line, colour, ls="--", lw=0.8)
            truth = true_postures[motion][:, JOINT_NAMES.index(ELBOW)]
            if not np.any(np.isnan(truth)):
                axis.plot(time_s, truth, "k", lw=1, label="truth")
            axis.set_title(motion)
            axis.set_xlabel("time [s]")
        axes[0, 0].set_ylabel(f"{ELBOW} [rad]")
        axes[0, 0].legend(fontsize=8)


def plot_survival(results: Mapping[str, Any], path: Path) -> None:
    """Plot error and cost against the survival rate, for each speed."""
    paper = paper_preset()
    with _error_and_cost(path) as axes:
        for axis, name, scale in axes:
            for speed, by_rate in results.items():
                rates = [float(rate) for rate in by_rate]
                values = [scale * v["mean"][name] for v in by_rate.values()]
                axis.plot(rates, values, "o-", label=f"{speed.replace('_', ' ')} motion")
            for rate in (paper.torso.survival_rate, paper.arm.survival_rate):
                axis.axvline(rate, color="grey", lw=0.8, ls=":")
            axis.set_xlabel("survival rate e of all filters (dotted: Table I)")


def plot_particles(results: Mapping[str, Any], path: Path) -> None:
    """Plot error and cost against the number of particles."""
    with _error_and_cost(path) as axes:
        for axis, name, scale in axes:
            for strategy, by_count in results.items():
                counts = [int(count) for count in by_count]
                values = [scale * v["mean"][name] for v in by_count.values()]
                axis.plot(counts, values, "o-", color=COLOURS[strategy], label=strategy.upper())
            axis.set_xscale("log")
            axis.set_xticks(counts, [str(count) for count in counts])
            axis.minorticks_off()
            axis.set_xlabel("particles a filter")


def plot_schemes(results: Mapping[str, Any], path: Path) -> None:
    """Plot error and cost of each resampling scheme, with and without the elite particle."""
    places = np.arange(len(results))
    with _error_and_cost(path) as axes:
        for axis, name, scale in axes:
            for shift, kind, colour in ((-0.2, "elite", "tab:blue"), (0.2, "no_elite", "silver")):
                values = [scale * scheme[kind]["mean"][name] for scheme in results.values()]
                axis.bar(places + shift, values, 0.4, color=colour, label=kind.replace("_", " "))
            axis.set_xticks(places, list(results))


@contextmanager
def _error_and_cost(path: Path) -> Iterator[list[tuple[Any, str, float]]]:
    """Yield an axis, the key of its figure and a factor for both ``_FIGURES``."""
    with _figure(path, 1, 2, (10, 3.6)) as axes:
        both = list(zip(axes[0], _FIGURES, strict=True))
        yield [(axis, name, scale) for axis, (name, scale, _) in both]
        for axis, (_, _, label) in both:
            axis.set_ylabel(label)
        axes[0, 0].legend()


def plot_initialization(results: Mapping[str, Any], path: Path) -> None:
    """Plot the cost against rounds, and the error of each size."""
    with _figure(path, 1, 2, (12, 4.6)) as axes:
        curve, bars = axes[0]
        labels = {"O1": "O1: front", "O2": "O2: side", "O3": "O3: arms"}
        for subset, by_percentile in results["relative_cost_by_round"].items():
            rounds = np.arange(len(by_percentile["percentile_50"]))
            (line,) = curve.plot(rounds, by_percentile["percentile_50"], label=labels[subset])
            curve.fill_between(
                rounds,
                by_percentile["percentile_10"],
                by_percentile["percentile_90"],
                color=line.get_color(),
                alpha=0.2,
            )
        curve.set_xlabel("round of the first pass")
        curve.set_ylabel("cost, relative to the first guess")
        curve.set_ylim(bottom=0)
        curve.legend()
        errors = results["mean_abs_error_m"]
        places = np.arange(len(errors))
        bars.barh(places, [100 * v for v in errors.values()], color="tab:blue")
        seeds = [100 * v for v in results["std_over_seeds_m"].values()]
        bars.plot(seeds, places, "k|", ms=10, label="standard deviation over seeds")
        bars.set_yticks(places, [name.replace("_", " ") for name in errors], fontsize=8)
        bars.invert_yaxis()
        bars.set_xlabel("mean absolute error over people [cm]")
        bars.legend(fontsize=8)


@contextmanager
def _figure(
    path: Path, rows: int, columns: int, size: tuple[float, float], **options: Any
) -> Iterator[Any]:
    """Yield axes (rows, columns), and save the figure in the end."""
    with plot(path, (rows, columns), size, layout="tight", **options) as axes:
        yield axes
        for axis in axes.ravel():
            axis.grid(alpha=0.3)
