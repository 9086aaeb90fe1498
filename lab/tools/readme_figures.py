"""Write the figures of the README from the committed results of evaluation and benchmarks.

``python -m lab.tools.readme_figures`` replaces the parts between the marks in ``README.md``; with
``--check`` it only compares them.
"""

from __future__ import annotations

import argparse
import sys
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cardbox_tracker.applications.evaluation.marks import replaced
from cardbox_tracker.applications.evaluation.report import mean_of
from cardbox_tracker.applications.evaluation.results import read_json
from cardbox_tracker.common.files import atomic_path
from lab.benchmarks import report as benchmark_report
from lab.experiments.results import motions_in, recorded_results
from lab.tools.people_rows import people_rows

BEGIN, END = "<!-- evaluation:begin -->", "<!-- evaluation:end -->"
SESSIONS_BEGIN, SESSIONS_END = "<!-- sessions:begin -->", "<!-- sessions:end -->"
RESULTS = Path("docs/evaluation")
ACCURACY, SESSIONS_REPORT, PEOPLE = "accuracy.json", "sessions.md", "real-people.json"
BENCHMARKS = Path("docs/benchmarks.json")


def readme_section(results: Mapping[str, Any], recorded: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the text between the marks.

    Args:
        results: ``results.json`` of the synthetic motions.
        recorded: ``results.json`` of each recorded session by name.
    """
    quick = " (a quick run)" if results["quick"] else ""
    lines = [
        *_wrapped(
            f"Means over {results['runs']} runs{quick} with the paper's settings on images of a "
            "synthetic person, whose posture is known exactly. DRS is the paper's resampling, SRS "
            "the one it is compared with:"
        ),
        "",
        "| motion | 3D error DRS | SRS | hands DRS | SRS | cost DRS | SRS |",
        "|---|---|---|---|---|---|---|",
        *(_row(m, results[m]) for m in motions_in(results)),
    ]
    for name, session in recorded.items():
        lines += [_row(f"{m} ({name})", session[m]) for m in motions_in(session)]
    text = (
        "3D error: mean distance of the estimated shoulders, elbows and hands from the true ones. "
    )
    if recorded:
        runs = " and ".join(sorted({str(session["runs"]) for session in recorded.values()}))
        text += (
            f"{_listed(list(recorded))} are images of rendered, realistically shaped bodies, not "
            f"films of people ({runs} runs). "
        )
    text += f"Measured at commit {results['commit'][:8]}."
    lines += ["", *_wrapped(text)]
    return "\n".join(lines)


def sessions_section(results: Mapping[str, Any], others: Sequence[Mapping[str, Any]]) -> str:
    """Return the table of accuracy.

    Args:
        results: ``sessions.json``, the rendered recordings; its means are the last row.
        others: rows of real people and of ``accuracy.json``, errors in cm; a pair is a range, null
            is not measured.
    """
    sessions = results["sessions"]
    means = {
        key: float(np.mean([mean_of(session["runs"], key) for session in sessions]))
        for key in ("aligned", "absolute", "ms")
    }
    peers = [float(session["mediapipe"]["aligned"]) for session in sessions]
    better = sum(
        mean_of(session["runs"], "aligned") < peer
        for session, peer in zip(sessions, peers, strict=True)
    )
    rendered = {
        "people": f"rendered ({len(sessions)} recordings)",
        "cameras": "one",
        "left_out": "recording; used in development",
        "aligned": means["aligned"],
        "mediapipe": float(np.mean(peers)),
        "absolute": means["absolute"],
        "source": f"[each recording](docs/evaluation/{SESSIONS_REPORT})",
    }
    lines = [
        *_wrapped(
            f"Mean 3D error of shoulders, elbows and hands, preset `default`, "
            f"{len(results['seeds'])} seeds. *Aligned* is the error after both skeletons are "
            "shifted to the middle of their shoulders, because MediaPipe Pose (one camera) has no "
            "metric place. *Left out* says what of a row was not among the data that the prior "
            "learned from:"
        ),
        "",
        "| people | cameras | left out | aligned | with detector | MediaPipe | absolute "
        "| with detector | measured on |",
        "|---|---|---|---|---|---|---|---|---|",
        *(_accuracy_row(row) for row in (*others, rendered)),
        "",
        *_wrapped(
            f"The aligned error is below MediaPipe's on {better} of the {len(sessions)} rendered "
            f"recordings of the last row. An image takes {means['ms']:.1f} ms from silhouette "
            "and image to posture, on one core."
        ),
    ]
    return "\n".join(lines)


def current(root: Path) -> str:
    """Return the text of the README in ``root`` with current figures."""
    folder = root / RESULTS
    section = readme_section(read_json(folder / "results.json"), recorded_results(folder))
    text = replaced((root / "README.md").read_text(encoding="utf-8"), section, BEGIN, END)
    more = read_json(folder / ACCURACY)
    rows = [
        *people_rows(read_json(folder / PEOPLE), more["mediapipe"]),
        *more["rows"],
    ]
    sessions = sessions_section(read_json(folder / "sessions.json"), rows)
    text = replaced(text, sessions, SESSIONS_BEGIN, SESSIONS_END)
    speed = benchmark_report.readme_section(read_json(root / BENCHMARKS))
    return replaced(text, speed, benchmark_report.BEGIN, benchmark_report.END)


def main(arguments: Sequence[str] | None = None) -> int:
    """Write or check; return 1 if a check found a difference."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing")
    parser.add_argument("--root", type=Path, default=Path(), help="folder of the repository")
    given = parser.parse_args(arguments)
    path = given.root / "README.md"
    text = current(given.root)
    if text == path.read_text(encoding="utf-8"):
        return 0
    print(f"{'differs' if given.check else 'written'}: {path}")
    if not given.check:
        with atomic_path(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return 1 if given.check else 0


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, 100, break_long_words=False, break_on_hyphens=False)


def _listed(names: Sequence[str]) -> str:
    """Return the names as part of a sentence."""
    return " and ".join(f"`{name}`" for name in names)


def _row(name: str, motion: Mapping[str, Any]) -> str:
    cells = [name]
    cells += [_cm(motion[s]["mpjpe_m"]) for s in ("drs", "srs")]
    for strategy in ("drs", "srs"):
        errors = motion[strategy]["error_m"]
        cells.append(_cm((errors["left_hand"] + errors["right_hand"]) / 2))
    cells += [f"{motion[s]['mean_cost_px']:.0f} px" for s in ("drs", "srs")]
    return "| " + " | ".join(cells) + " |"


def _accuracy_row(row: Mapping[str, Any]) -> str:
    aligned, absolute = _range(row["aligned"]), _range(row["absolute"])
    cells = (
        *(row["people"], row["cameras"], row["left_out"], aligned),
        *(_range(row.get("with_detector")), _range(row["mediapipe"]), absolute),
        *(_range(row.get("absolute_with_detector")), row["source"]),
    )
    return f"| {' | '.join(cells)} |"


def _range(value_cm: float | Sequence[float] | None) -> str:
    if value_cm is None:
        return ""
    if isinstance(value_cm, Sequence):
        return " to ".join(f"{value:.1f}" for value in value_cm) + " cm"
    return f"{value_cm:.1f} cm"


def _cm(value_m: float) -> str:
    return f"{100 * value_m:.1f} cm"


if __name__ == "__main__":
    sys.exit(main())
