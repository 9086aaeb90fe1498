"""How far a robot that follows the tracker is from one that follows the true joints, as a table.

python -m tools.retarget_accuracy SESSION...

Each session is a folder with ``bag/`` and ``ground_truth.json``. The robot is
``config/example_arm.urdf``, once for each arm of the person. The table replaces that between the
marks in ``docs/retargeting.md``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

import numpy as np

from cardbox_tracker.estimation.config import PRESETS
from cardbox_tracker.evaluation.recorded.retarget import HandError, hand_errors
from cardbox_tracker.evaluation.recorded.session import load_session
from cardbox_tracker.retargeting.config import RetargetConfig
from cardbox_tracker.retargeting.robot import load_robot
from tools.readme_figures import replaced

ROOT = Path(__file__).resolve().parents[1]
DOCUMENT, ROBOT = ROOT / "docs" / "retargeting.md", ROOT / "config" / "example_arm.urdf"
BEGIN, END = "<!-- retarget-accuracy:begin -->", "<!-- retarget-accuracy:end -->"
OTHERS_RAD = (0.4, 0.55, 1.0)
"""Further limits of the dead-man, in the last rows."""
_HEAD = (
    *("session", "standing still", "mean, moving", "half below", "nine in ten below"),
    "mean, all images",
)


def row(name: str, error: HandError) -> str:
    """Return one row of the table."""
    distances = (error.mean, error.percentile_50, error.percentile_90, error.with_frozen)
    cells = (name, f"{error.frozen:.0%}", *(f"{distance:.1f} cm" for distance in distances))
    return f"| {' | '.join(cells)} |"


def mean_of(errors: Sequence[HandError]) -> HandError:
    """Return the mean over sessions; the images are added."""
    names = [field.name for field in fields(HandError) if field.name != "images"]
    means = {name: float(np.nanmean([getattr(one, name) for one in errors])) for name in names}
    return HandError(images=sum(one.images for one in errors), **means)


def main(args: list[str] | None = None) -> int:
    """Measure and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(args)
    robot, preset = load_robot(ROBOT), PRESETS["default"]()
    rows = [f"| {' | '.join(_HEAD)} |", "|---" * len(_HEAD) + "|"]
    configs = [RetargetConfig(), *(RetargetConfig(max_stddev_rad=most) for most in OTHERS_RAD)]
    found = []
    for folder in given.sessions:
        session = load_session(folder)
        found.append(hand_errors(session, preset, given.seed, robot, configs))
        rows.append(row(session.name, found[-1][0]))
        print(rows[-1], flush=True)
    for config, errors in zip(configs, zip(*found, strict=True), strict=True):
        name = f"**mean**, `max_stddev_rad` {config.max_stddev_rad:g}"
        rows.append(row(name, mean_of(errors)))
    text, table = DOCUMENT.read_text(encoding="utf-8"), "\n".join(rows)
    DOCUMENT.write_text(replaced(text, f"\n{table}\n", BEGIN, END), encoding="utf-8")
    print(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
