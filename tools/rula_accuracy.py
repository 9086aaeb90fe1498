"""How far RULA scores are from those of the true joints, as a table for ``docs/ergonomics.md``.

python -m tools.rula_accuracy SESSION...

Each session is a folder with ``bag/`` and ``ground_truth.json``. The table replaces that between
the marks in the document.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import fields
from pathlib import Path

import numpy as np

from cardbox_tracker.ergonomics.config import RulaConfig
from cardbox_tracker.ergonomics.recording import ABOVE
from cardbox_tracker.estimation.config import PRESETS
from cardbox_tracker.evaluation.recorded.rula import WAYS, ScoreError, score_errors
from cardbox_tracker.evaluation.recorded.session import load_session
from tools.readme_figures import replaced

DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "ergonomics.md"
BEGIN, END = "<!-- rula-accuracy:begin -->", "<!-- rula-accuracy:end -->"
TASKS = {
    "no load": RulaConfig(),
    "2 to 10 kg held": RulaConfig(arm_load=2, arm_muscle_use=1, body_load=2, body_muscle_use=1),
}
_HEAD = (
    "session",
    "task",
    "score of",
    "mean difference",
    "equal",
    "within 1",
    "chance of the true score",
    f"time above {ABOVE}, true",
)


def row(name: str, task: str, way: str, error: ScoreError) -> str:
    """Return one row of the table."""
    cells = (
        name,
        task,
        way,
        f"{error.difference:.2f}",
        *(f"{share:.0%}" for share in (error.equal, error.within_one, error.chance_of_truth)),
        f"{error.above:.0%}, {error.true_above:.0%}",
    )
    return f"| {' | '.join(cells)} |"


def mean_of(errors: list[ScoreError]) -> ScoreError:
    """Return the mean over sessions; the frames are added."""
    names = [field.name for field in fields(ScoreError) if field.name != "frames"]
    means = {name: float(np.mean([getattr(one, name) for one in errors])) for name in names}
    return ScoreError(frames=sum(one.frames for one in errors), **means)


def main(args: list[str] | None = None) -> int:
    """Measure and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(args)
    rows = [f"| {' | '.join(_HEAD)} |", "|---" * len(_HEAD) + "|"]
    found = {(task, way): list[ScoreError]() for task in TASKS for way in WAYS}
    for folder in given.sessions:
        session = load_session(folder)
        try:
            errors = score_errors(session, PRESETS["default"](), given.seed, TASKS)
        except ValueError as error:
            print(f"left out: {error}", file=sys.stderr)
            continue
        for task, way in found:
            found[task, way].append(errors[task][way])
        for task in TASKS:
            rows.append(row(session.name, task, "particles", errors[task]["particles"]))
            print(rows[-1], flush=True)
    rows += [row("**mean**", *which, mean_of(errors)) for which, errors in found.items()]
    text = DOCUMENT.read_text(encoding="utf-8")
    table = "\n".join(rows)
    DOCUMENT.write_text(replaced(text, f"\n{table}\n", BEGIN, END), encoding="utf-8")
    print(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
