"""Write ``report.md`` with the results in tables and figures."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cardbox_tracker.common.files import write_file
from cardbox_tracker.person.skeleton import JOINT_NAMES, KEYPOINT_NAMES
from cardbox_tracker.search.config import paper_preset
from lab.experiments.results import motions_in, recorded_results
from lab.experiments.tracking import AXES
from lab.pages import table

Results = Mapping[str, Any]


def write_report(results: Results, timing: Results, folder: Path) -> None:
    """Write ``report.md`` into ``folder``, beside the figures it shows."""
    lines = [*_head(results), *_main(results)]
    sides = results.get("experiments")
    if sides is not None:
        lines += _survival(sides["survival_rate"])
        lines += _particles(sides["particles"])
        lines += _models(sides["models"], timing)
    lines += _sequences(results)
    if sides is not None:
        lines += _initialization(sides["initialization"])
        lines += _schemes(sides["schemes"], sides["variants"])
        lines += _tempers(sides["tempers"])
    lines += _methods(results)
    if sides is not None:
        lines += _recorded(recorded_results(folder))
    lines += _origin(results, timing)
    write_file(folder / "report.md", "\n".join(lines) + "\n")


def _head(results: Results) -> Iterator[str]:
    session = results.get("session")
    if session is not None:
        fits = ", ".join(f"{n} {v:.2f}" for n, v in session["initialization_iou"].items())
        yield from _section(
            f"# Evaluation on the recorded session {session['name']}",
            f"Each strategy tracked its {session['images']} images {results['runs']} times with "
            "the parameters of the paper's Table I (IoU of the references: "
            f"{fits}). The true joints are those of a realistic body, not the model's points.",
        )
        return
    plan = results["plan"]
    quick = " **This is a quick run**, a check that all works." if results["quick"] else ""
    yield from _section(
        "# Evaluation: the paper's experiments on synthetic sessions",
        f"{results['runs']} runs of each strategy on each motion (experiments 1 to 3) with the "
        "parameters of the paper's Table I, preset `paper`, on a synthetic person with rounded "
        f"parts. Fewer runs: {plan['side_runs']} (survival rate, schemes), "
        f"{plan['particle_runs']} (particles), {plan['model_runs']} (volumetric model), "
        f"{plan['peer_runs']} (peers).{quick} The "
        "state `lost` is switched off. Errors are means over runs and images; ± is one standard "
        "error over the runs.",
    )


def _main(results: Results) -> Iterator[str]:
    motions = motions_in(results)
    cells = [(m, s, results[m][s]) for m in motions for s in ("drs", "srs")]
    yield from _section("## 1. Ground truth", "Mean 3D error of each joint, cm:")
    yield from _table(
        ["motion", "", *map(_words, KEYPOINT_NAMES)],
        ([m, s.upper(), *(_cm(c["error_m"][n]) for n in KEYPOINT_NAMES)] for m, s, c in cells),
    )
    yield from _section(
        "MPJPE is the mean of the six, PA-MPJPE the error after the best translation, rotation "
        "and scale, cm:"
    )
    yield from _table(
        ["motion", "", "MPJPE", "PA-MPJPE", *AXES],
        (
            [m, s.upper(), _pair(c)[0], _cm(c["pa_mpjpe_m"])]
            + [_cm(c["axis_error_m"][axis]) for axis in AXES]
            for m, s, c in cells
        ),
    )
    yield from _section(*(f"![3D error of each joint, {m}](error_{m}.png)" for m in motions))
    yield from _section("## 2. 2D error", "Mean cost of the system's output, pixels:")
    yield from _table(
        ["motion", "DRS", "SRS"],
        (
            [m]
            + [f"{c['mean_cost_px']:.0f} ± {c['stderr_cost_px']:.0f}" for c in results[m].values()]
            for m in motions
        ),
    )
    yield from _section(
        "![cost of each image](cost.png)",
        "## 3. Reproducibility",
        "One elbow angle, mean (solid) and one standard deviation to each side (dashed):",
        "![an elbow angle and its standard deviation](reproducibility.png)",
        "DRS is below SRS in so many of the joints and motions:",
    )
    yield from _table(
        ["figure", "DRS below SRS", "mean DRS", "mean SRS"],
        (_below(results, *row) for row in _COMPARED),
    )


_ELBOWS_AND_HANDS = tuple(name for name in KEYPOINT_NAMES if "shoulder" not in name)
_COMPARED = (
    ("cost, px", "mean_cost_px", (), 1.0, 0),
    ("3D error of elbows and hands, cm", "error_m", _ELBOWS_AND_HANDS, 100.0, 1),
    ("standard deviation over the runs, rad or m", "std_dof", JOINT_NAMES, 1.0, 3),
)
"""Figures in which DRS is below SRS in the paper: text, key, names, factor, digits."""


def _below(
    results: Results, text: str, figure: str, names: Sequence[str], scale: float, digits: int
) -> list[str]:
    drs, srs = (
        np.array([scale * (c[n] if n else c) for c in cells for n in names or ("",)])
        for cells in ([results[m][s][figure] for m in motions_in(results)] for s in ("drs", "srs"))
    )
    count = f"{np.count_nonzero(drs < srs)} of {len(drs)}"
    return [text, count, *(f"{values.mean():.{digits}f}" for values in (drs, srs))]


def _survival(results: Results) -> Iterator[str]:
    yield from _section(
        "## 4. Survival rate",
        "The same e in all three filters. Slow: every image; fast: each third one; very fast: each "
        "sixth. MPJPE in cm and cost in px, means over the motions:",
    )
    speeds = list(results)
    yield from _table(
        ["e", *(f"{_words(speed)} {figure}" for speed in speeds for figure in ("MPJPE", "cost"))],
        (
            [rate, *(cell for speed in speeds for cell in _pair(results[speed][rate]["mean"]))]
            for rate in results[speeds[0]]
        ),
    )
    yield from _section("![survival rate](survival.png)")


def _particles(results: Results) -> Iterator[str]:
    yield from _section(
        "## 5. Particles",
        "N particles in each of the three filters (Table I: 200). MPJPE in cm and cost in px, "
        "means over the motions:",
    )
    yield from _table(
        ["N", "DRS MPJPE", "DRS cost", "SRS MPJPE", "SRS cost"],
        (
            [count, *(cell for s in ("drs", "srs") for cell in _pair(results[s][count]["mean"]))]
            for count in results["drs"]
        ),
    )
    yield from _section("![particles](particles.png)")


def _models(results: Results, timing: Results) -> Iterator[str]:
    yield from _section(
        "## 6. Cardbox against the volumetric model",
        "OpenCV draws both from the same sizes, DRS, Table I; a part of the volumetric model is a "
        "box that spans the patches. Sizes were found with the cardbox model, which favours it.",
    )
    yield from _table(
        ["model", "planes", "us a particle", "MPJPE", "cost"],
        (
            [n, r["planes"], f"{timing['particle_us'][n]:.1f}", *_pair(r["mean"])]
            for n, r in results.items()
        ),
    )
    yield from _section(
        f"The compiled cost takes {timing['particle_us']['compiled']:.1f} us for the same posture; "
        "[benchmarks](../benchmarks.md) have the time of an image."
    )


def _sequences(results: Results) -> Iterator[str]:
    number = "7. " if "experiments" in results else ""
    yield from _section(
        f"## {number}Image sequences",
        "DRS, the first run. Rows: best estimate; matching result, in white the pixels that the "
        "cost counts (below the hips, grey, nothing counts); raw image.",
        *(f"**{m}**\n\n![sequence of {m}](sequence_{m}.png)" for m in motions_in(results)),
    )


def _initialization(results: Results) -> Iterator[str]:
    rounds = ", ".join(f"{n} {v:.0f}" for n, v in results["mean_rounds"].items())
    fits = ", ".join(f"{n} {v:.2f}" for n, v in results["mean_iou"].items())
    yield from _section(
        "## 8. Initialization",
        f"{results['bodies']} random people (1.55 to 1.9 m), measured once, and one person "
        f"measured with {results['seeds']} seeds. The held postures miss by "
        f"{results['posture_miss_deg']:g} degrees. Rounds: {rounds}; IoU: {fits}. All in "
        "cm:",
    )
    yield from _table(
        ["size", "mean abs. error", "bias", "spread of people", "std. dev. over seeds"],
        (
            [
                f"`{name}`",
                _cm(results["mean_abs_error_m"][name]),
                f"{100 * results['bias_m'][name]:+.1f}",
                _cm(results["spread_of_people_m"][name]),
                _cm(results["std_over_seeds_m"][name]),
            ]
            for name in results["mean_abs_error_m"]
        ),
    )
    yield from _section(
        "The straight edges of the patches have no exact counterpart in images of a rounded "
        "person, which is part of the bias.",
        "![initialization](initialization.png)",
    )


def _schemes(results: Results, variants: Results) -> Iterator[str]:
    yield from _section(
        "## 9. Standard resampling schemes, and the presets",
        "Everything else as in Table I; the elite is the best particle, kept unchanged. MPJPE in "
        "cm, cost in px, standard deviation over the runs in rad. All but DRS draw from weights "
        "exp(-W^2 / (2 sigma_gamma^2)), which Table I's sigma_gamma makes nearly equal.",
    )
    yield from _table(
        ["scheme", "elite", "MPJPE", "cost", "std. dev."],
        (
            [name, "yes" if kind == "elite" else "no", *_triple(scheme[kind]["mean"])]
            for name, scheme in results.items()
            for kind in ("elite", "no_elite")
        ),
    )
    yield from _section(
        "![schemes](schemes.png)",
        "Beyond the paper: `torso_rated_alone` is Table I without drawing the arms of the last "
        "estimate together with the torso; `default` is the default preset of `cardbox track`.",
    )
    yield from _table(
        ["variant", "MPJPE", "cost", "std. dev."],
        ([name, *_triple(variant["mean"])] for name, variant in variants.items()),
    )


def _tempers(results: Results) -> Iterator[str]:
    paper = paper_preset()
    yield from _section(
        "### Sigma_gamma",
        "The schemes with weights and an elite, with other values of sigma_gamma; the last row is "
        "Table I. MPJPE in cm, and in brackets the effective sample size 1 / sum w^2 of a filter's "
        f"{paper.torso.particles} particles, mean over filters and images:",
    )
    yield from _table(
        ["sigma_gamma, px (torso, arms)", *results],
        (
            [
                f"{float(factor) * paper.torso.sigma_gamma_px:g}, "
                f"{float(factor) * paper.arm.sigma_gamma_px:g}"
            ]
            + [
                f"{_pair(by_factor[factor]['mean'])[0]} "
                f"({by_factor[factor]['mean']['effective_particles']:.0f})"
                for by_factor in results.values()
            ]
            for factor in next(iter(results.values()))
        ),
    )


def _methods(results: Results) -> Iterator[str]:
    number = "10. " if "experiments" in results else ""
    methods = results["methods"]
    yield from _section(
        f"## {number}Peers at equal numbers of ratings",
        "The three filters of the paper in a hierarchy; one flat filter of all 12 joints; the "
        "annealed particle filter of the paper's reference [4], with five layers; and CMA-ES "
        "(package `cma`), which starts anew from each image's predecessor. All move by Table I's "
        "noise; all but the first three rate whole postures. MPJPE in cm, cost in px:",
    )
    motions = motions_in(results)
    yield from _table(
        ["method", "runs", "ratings an image", *motions, "mean", "cost", "std. dev."],
        (
            [name, f"{by['mean']['runs']:.0f}", f"{by['mean']['ratings']:.0f}"]
            + [_pair(by[motion])[0] for motion in motions]
            + _triple(by["mean"])
            for name, by in methods.items()
        ),
    )
    if "experiments" in results:
        yield from _section(MEANING)


MEANING = (
    "Table I's sigma_gamma makes the weights of SRS nearly equal. With 0.015 times that, 120 and "
    "60 px, one or two particles have nearly all the weight, and SRS is about as good as DRS: what "
    "DRS gives is that it needs no sigma_gamma."
)
"""What the comparison of DRS with SRS means."""


def _recorded(found: Mapping[str, Results]) -> Iterator[str]:
    if not found:
        return
    yield from _section(
        "## Recorded sessions",
        "A realistic skinned body, compressed images; MPJPE in cm and cost in px.",
    )
    yield from _table(
        ["session", "motion", "runs", "DRS MPJPE", "DRS cost", "SRS MPJPE", "SRS cost"],
        (
            [f"[{name}]({name}/report.md)", m, results["runs"]]
            + [cell for s in ("drs", "srs") for cell in _pair(results[m][s])]
            for name, results in found.items()
            for m in motions_in(results)
        ),
    )


def _origin(results: Results, timing: Results) -> Iterator[str]:
    versions = ", ".join(f"{name} {version}" for name, version in results["versions"].items())
    yield from (
        "## Where these numbers come from",
        "",
        f"- command: `{results['command']}`",
        f"- seeds: sessions and initialization {results['seed']}; run i of a tracker "
        f"`default_rng([{results['seed']}, i])`",
        f"- versions: {versions}",
        f"- commit: {results['commit'] or 'not known'}; digest of filter, simulation and "
        f"initialization: {results['digest']}",
        f"- processor: {results['cpu']}, {timing['jobs']} processes",
        f"- time: the last call of the command took {timing['wall_s'] / 60:.1f} minutes",
        "- all numbers: `results.json`; by image: `per_frame.csv`; times: `timing.json`",
    )


def _pair(figures: Mapping[str, float]) -> list[str]:
    error = f"{_cm(figures['mpjpe_m'])} ± {_cm(figures['stderr_mpjpe_m'])}"
    return [error, f"{figures['mean_cost_px']:.0f}"]


def _triple(figures: Mapping[str, float]) -> list[str]:
    return [*_pair(figures), f"{figures['mean_std_angles_rad']:.2f}"]


def _cm(value_m: float) -> str:
    return f"{100 * value_m:.1f}"


def _words(name: str) -> str:
    return name.replace("_", " ")


def _section(*paragraphs: str) -> Iterator[str]:
    for paragraph in paragraphs:
        yield from (paragraph, "")


def _table(header: Sequence[object], rows: Iterable[Sequence[object]]) -> Iterator[str]:
    yield from (table(header, rows), "")
