"""``report.md``: the results in tables, figures and plain words."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from cardbox_tracker.body.kinematics import KEYPOINT_NAMES
from cardbox_tracker.body.posture import JOINT_NAMES
from cardbox_tracker.evaluation.paper.claims import claims
from cardbox_tracker.evaluation.paper.results import Curves, motions_in, read_json
from cardbox_tracker.files import atomic_path

Row = Sequence[object]


def write_report(
    results: Mapping[str, Any], timing: Mapping[str, Any], curves: Curves, folder: Path
) -> None:
    """Write ``report.md`` into ``folder``, beside the figures it shows."""
    lines = [*_head(results), *_verdicts(results, curves, timing), *_main(results)]
    sides = results.get("experiments")
    if sides is not None:
        lines += _survival(sides["survival_rate"])
        lines += _particles(sides["particles"])
        lines += _models(sides["models"], timing)
        lines += _sequences(results)
        lines += _initialization(sides["initialization"], timing)
        lines += _schemes(sides["schemes"], sides["variants"])
        lines += _recorded(folder)
    else:
        lines += _sequences(results)
    lines += _origin(results, timing)
    with atomic_path(folder / "report.md") as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def recorded_results(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the results of recorded sessions in the folders inside ``folder``, by session."""
    found = {}
    for path in sorted(folder.glob("*/results.json")):
        results = read_json(path)
        if "session" in results:
            found[path.parent.name] = results
    return found


def _head(results: Mapping[str, Any]) -> list[str]:
    session = results.get("session")
    if session is not None:
        fits = ", ".join(f"{n} {v:.2f}" for n, v in session["initialization_iou"].items())
        return [
            f"# Evaluation on the recorded session {session['name']}",
            "",
            f"Each strategy tracked its {session['images']} images {results['runs']} times "
            "with the parameters of the paper's Table I, with background and body learned from "
            f"the session's own first seconds (IoU of the references: {fits}). The true joints are "
            "those of a realistically shaped body and not of our model, so shoulders and hands are "
            "not exactly the same points.",
            "",
        ]
    plan = results["plan"]
    quick = ""
    if results["quick"]:
        quick = (
            " **This is a quick run**: few runs, bodies and values, so read it as a check that "
            "all works."
        )
    return [
        "# Evaluation: the paper's experiments on synthetic sessions",
        "",
        f"{results['runs']} runs of each strategy on each motion (experiments 1 to 3) with the "
        "parameters of the paper's Table I, preset `paper`. The person is synthetic, with rounded "
        "parts instead of patches, so the model never fits perfectly, and its true posture is "
        "known exactly. Images have noise; as in real use, the silhouettes come from the "
        "background model and the sizes from the initialization. The side experiments have fewer "
        "runs: "
        f"{plan['side_runs']} (survival rate, schemes), {plan['particle_runs']} (particles), "
        f"{plan['model_runs']} (volumetric model).{quick}",
        "",
        "The state `lost` is switched off here, since it would leave out the "
        "images in which a strategy does worst. All errors are means over runs and images; "
        "± is one standard error over the runs.",
        "",
    ]


def _verdicts(
    results: Mapping[str, Any], curves: Curves, timing: Mapping[str, Any]
) -> Iterator[str]:
    yield from ("## Which claims of the paper hold here", "")
    told: set[str] = set()
    for claim in claims(results, curves, timing):
        yield f"- **{'Holds' if claim.holds else 'Does not hold'}**: {claim.text}"
        yield f"  {_sentence(claim.evidence)}"
        if not claim.holds and claim.why:
            yield f"  *Why:* {'as said above.' if claim.why in told else claim.why}"
            told.add(claim.why)
    yield ""


def _main(results: Mapping[str, Any]) -> Iterator[str]:
    motions = motions_in(results)
    cells = [(m, s, results[m][s]) for m in motions for s in ("drs", "srs")]
    yield from ("## 1. Ground truth", "", "Mean 3D error of each joint, cm:", "")
    yield from _table(
        ["motion", "", *(_words(name) for name in KEYPOINT_NAMES)],
        ([m, s.upper(), *(_cm(c["error_m"][n]) for n in KEYPOINT_NAMES)] for m, s, c in cells),
    )
    yield from (
        "MPJPE is the mean of the six; PA-MPJPE is the error left after the best translation, "
        "rotation and scale; then the error along each axis of the camera, cm:",
        "",
    )
    yield from _table(
        ["motion", "", "MPJPE", "PA-MPJPE", "lateral", "vertical", "depth"],
        (
            [
                m,
                s.upper(),
                f"{_cm(c['mpjpe_m'])} ± {_cm(c['stderr_mpjpe_m'])}",
                _cm(c["pa_mpjpe_m"]),
                *(_cm(c["axis_error_m"][axis]) for axis in ("lateral", "vertical", "depth")),
            ]
            for m, s, c in cells
        ),
    )
    angles = list(cells[0][2]["joint_angle_error_deg"])
    if angles:
        yield from ("Mean joint-angle error, degrees:", "")
        yield from _table(
            ["angle", *(f"{m} {s.upper()}" for m, s, _ in cells)],
            (
                [f"`{angle}`", *(f"{c['joint_angle_error_deg'][angle]:.1f}" for *_, c in cells)]
                for angle in angles
            ),
        )
    for m in motions:
        yield from (f"![3D error of each joint, {m}](error_{m}.png)", "")
    yield from ("## 2. 2D error", "", "Mean cost of the system's output, pixels:", "")
    yield from _table(
        ["motion", "DRS", "SRS"],
        (
            [
                m,
                *(
                    f"{results[m][s]['mean_cost_px']:.0f} ± {results[m][s]['stderr_cost_px']:.0f}"
                    for s in ("drs", "srs")
                ),
            ]
            for m in motions
        ),
    )
    yield from ("![cost of each image](cost.png)", "")
    yield from (
        "## 3. Reproducibility",
        "",
        "Standard deviation over the runs, averaged over the images, rad (m for `torso_y`); "
        "bold where DRS is not below SRS:",
        "",
    )
    yield from _table(
        ["joint", *(f"{m} {s.upper()}" for m, s, _ in cells)],
        ([f"`{name}`", *_deviations(results, motions, name)] for name in JOINT_NAMES),
    )
    yield from (
        "One elbow angle, mean (solid) and one standard deviation to each side (dashed):",
        "",
        "![an elbow angle and its standard deviation](reproducibility.png)",
        "",
    )


def _deviations(results: Mapping[str, Any], motions: list[str], name: str) -> Iterator[str]:
    for m in motions:
        drs, srs = (results[m][s]["std_dof"][name] for s in ("drs", "srs"))
        yield f"{drs:.3f}" if drs < srs else f"**{drs:.3f}**"
        yield f"{srs:.3f}"


def _survival(results: Mapping[str, Any]) -> Iterator[str]:
    yield from (
        "## 4. Survival rate",
        "",
        "The same e in all three filters. Slow: every image; fast: each third one, which is the "
        "same motion three times as fast; very fast: each sixth. MPJPE in cm and cost in px, "
        "means over the motions:",
        "",
    )
    speeds = list(results)
    yield from _table(
        ["e", *(f"{_words(speed)} {what}" for speed in speeds for what in ("MPJPE", "cost"))],
        (
            [rate, *(cell for speed in speeds for cell in _pair(results[speed][rate]["mean"]))]
            for rate in results[speeds[0]]
        ),
    )
    yield from ("![survival rate](survival.png)", "")


def _particles(results: Mapping[str, Any]) -> Iterator[str]:
    yield from (
        "## 5. Particles",
        "",
        "N particles in each of the three filters (Table I: 200). MPJPE in cm and cost in px, "
        "means over the motions:",
        "",
    )
    yield from _table(
        ["N", "DRS MPJPE", "DRS cost", "SRS MPJPE", "SRS cost"],
        (
            [count, *(cell for s in ("drs", "srs") for cell in _pair(results[s][count]["mean"]))]
            for count in results["drs"]
        ),
    )
    yield from ("![particles](particles.png)", "")


def _models(results: Mapping[str, Any], timing: Mapping[str, Any]) -> Iterator[str]:
    yield from (
        "## 6. Cardbox against the volumetric model",
        "",
        "Both are drawn by the same code (OpenCV) from the same sizes, DRS, Table I; each part of "
        "the volumetric model is a box that spans the patches of the cardbox. Every face of a box "
        "is drawn: leaving out those turned away would halve their number. The sizes were found "
        "with the cardbox model, which favours it in the errors.",
        "",
    )
    yield from _table(
        ["model", "planes", "us a particle", "MPJPE", "cost"],
        (
            [n, r["planes"], f"{timing['particle_us'][n]:.1f}", *_pair(r["mean"])]
            for n, r in results.items()
        ),
    )
    yield from (
        f"The tracker's own compiled cost takes {timing['particle_us']['compiled']:.1f} us for "
        "the same full posture.",
        "",
    )


def _sequences(results: Mapping[str, Any]) -> Iterator[str]:
    number = "7. " if "experiments" in results else ""
    yield from (
        f"## {number}Image sequences",
        "",
        "DRS, the first run. Rows: best estimate; matching result, in white the pixels that the "
        "cost counts (below the hips, grey, nothing counts); raw image.",
        "",
    )
    for m in motions_in(results):
        yield from (f"**{m}**", "", f"![sequence of {m}](sequence_{m}.png)", "")


def _initialization(results: Mapping[str, Any], timing: Mapping[str, Any]) -> Iterator[str]:
    search = timing["initialization"]
    rounds = ", ".join(f"{n} {v:.0f}" for n, v in results["mean_rounds"].items())
    fits = ", ".join(f"{n} {v:.2f}" for n, v in results["mean_iou"].items())
    yield from (
        "## 8. Initialization",
        "",
        f"{results['bodies']} random people (1.55 to 1.9 m), each measured once with a seed of "
        f"its own, and one person measured with {results['seeds']} seeds. The angles of the held "
        f"postures miss by {results['posture_miss_deg']:g} degrees (standard deviation). Rounds "
        f"in both passes together: {rounds}; IoU: {fits}. One search takes "
        f"{search['median_s']:.2f} s (median; 95 % within {search['p95_s']:.2f} s). All in cm:",
        "",
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
    yield from (
        "The synthetic person is rounded, so the straight edges of our patches, such as the depth "
        "of the head, have no exact counterpart in the image. This is part of the bias.",
        "",
        "![initialization](initialization.png)",
        "",
    )


def _schemes(results: Mapping[str, Any], variants: Mapping[str, Any]) -> Iterator[str]:
    yield from (
        "## 9. Standard resampling schemes, and the presets",
        "",
        "Everything else as in Table I. The elite is the best particle, kept unchanged. MPJPE in "
        "cm, cost in px, standard deviation over the runs in rad (mean of the 11 angles); means "
        "over the motions:",
        "",
    )
    yield from _table(
        ["scheme", "elite", "MPJPE", "cost", "std. dev."],
        (
            [name, "yes" if kind == "elite" else "no", *_triple(scheme[kind]["mean"])]
            for name, scheme in results.items()
            for kind in ("elite", "no_elite")
        ),
    )
    yield from (
        "All but DRS draw from weights exp(-W^2 / (2 sigma_gamma^2)), with Table I's sigma_gamma "
        "of 8000 and 4000 pixels. That is several times the cost itself, so the weights are "
        "nearly equal: resampling hardly selects, whatever the scheme, and without the elite "
        "particle little keeps the estimate close to the image. DRS selects by rank, so the width "
        "of the weights does not matter.",
        "",
        "![schemes](schemes.png)",
        "",
        "Beyond the paper: `torso_rated_alone` is Table I without drawing the arms of the last "
        "estimate together with the torso; `default` is the default preset of `cardbox track`.",
        "",
    )
    yield from _table(
        ["variant", "MPJPE", "cost", "std. dev."],
        ([name, *_triple(variant["mean"])] for name, variant in variants.items()),
    )


def _recorded(folder: Path) -> Iterator[str]:
    found = recorded_results(folder)
    if not found:
        return
    yield from (
        "## Recorded sessions",
        "",
        "A realistic skinned body, compressed images; MPJPE in cm and cost in px. Each has a "
        "report of its own.",
        "",
    )
    yield from _table(
        ["session", "motion", "runs", "DRS MPJPE", "DRS cost", "SRS MPJPE", "SRS cost"],
        (
            [
                f"[{name}]({name}/report.md)",
                m,
                results["runs"],
                *(cell for s in ("drs", "srs") for cell in _pair(results[m][s])),
            ]
            for name, results in found.items()
            for m in motions_in(results)
        ),
    )


def _origin(results: Mapping[str, Any], timing: Mapping[str, Any]) -> Iterator[str]:
    versions = ", ".join(f"{name} {version}" for name, version in results["versions"].items())
    yield from (
        "## Where these numbers come from",
        "",
        f"- command: `{results['command']}`",
        f"- seeds: sessions and initialization {results['seed']}; run i of a tracker "
        f"`default_rng([{results['seed']}, i])`",
        f"- versions: {versions}",
        f"- commit: {results['commit'] or 'not known'}",
        f"- processor: {results['cpu']}, {timing['jobs']} processes",
        f"- time: {sum(timing['processor_s'].values()) / 60:.1f} minutes of processor time; the "
        f"last call of the command took {timing['wall_s'] / 60:.1f} minutes",
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


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:] + "."


def _table(header: Row, rows: Iterable[Row]) -> Iterator[str]:
    yield "| " + " | ".join(str(cell) for cell in header) + " |"
    yield "|" + "---|" * len(header)
    for row in rows:
        yield "| " + " | ".join(str(cell) for cell in row) + " |"
    yield ""
