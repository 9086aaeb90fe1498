"""Measure how far a robot's arm points from where the person's arm points.

python -m lab.tools.retarget_accuracy --robot URDF [--robot URDF ...] SESSION...

Each session is a folder with ``bag/`` and ``ground_truth.json``. The robots follow the true
postures without limits of speed and through their trunks, so the figures are those of the transfer,
not of the tracker. The table replaces that between the marks in ``docs/retargeting.md`` with
``--write``.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from cardbox_tracker.applications.retargeting.arm import ArmFollower, directions_of
from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.robot import Robot, load_robot
from cardbox_tracker.common.files import write_file
from cardbox_tracker.person.model import BodyModel, body_from_proportions
from cardbox_tracker.person.sizes import FloatArray
from lab.evaluation.angles import true_postures
from lab.evaluation.session import load_session
from lab.pages import replaced, row, table

ROOT = Path(__file__).resolve().parents[2]
DOCUMENT, ROBOT = ROOT / "docs" / "retargeting.md", ROOT / "config" / "example_arm.urdf"
BEGIN, END = "<!-- retarget-accuracy:begin -->", "<!-- retarget-accuracy:end -->"
_HEAD = ("robot", "side", "upper arm", "forearm", "shoulder to hand", "at a limit", "time")


def row_of(robot: Robot, name: str, side: str, body: BodyModel, postures: FloatArray) -> str:
    """Return a row of the table: median and nine in ten of the angles, degrees.

    ``postures`` (n, 12) are followed one after the other, as those of a recording.
    """
    follower = ArmFollower(robot, RetargetConfig(side=side, trunk_radius_m=0.0))
    lower, upper, _ = robot.limits_of(follower.arm.joints)
    hidden = np.full((len(postures), 4), np.nan)
    now, cosines, limited = np.zeros(len(follower.joints)), [], []
    begun = time.perf_counter()
    for posture in np.hstack([postures, hidden]):
        now = follower.target(body, posture, now)
        arm = now[: len(lower)]
        found = follower.kinematics.directions(arm)
        cosines.append((found * directions_of(body, posture, side)).sum(axis=1))
        limited.append(bool(((arm < lower + 1e-6) | (arm > upper - 1e-6)).any()))
    took_ms = 1000 * (time.perf_counter() - begun) / len(postures)
    angles = np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))
    shares = (f"{half:.1f} / {most:.1f}°" for half, most in np.percentile(angles, (50, 90), 0).T)
    return row((name, side, *shares, f"{np.mean(limited):.0%}", f"{took_ms:.0f} ms"))


def main(args: list[str] | None = None) -> int:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    parser.add_argument("--robot", action="append", type=Path, metavar="URDF")
    parser.add_argument("--write", action="store_true", help="write the table into the document")
    given = parser.parse_args(args)
    body = body_from_proportions(1.75, 2.0)
    postures = np.concatenate([true_postures(load_session(one)) for one in given.sessions])
    postures = postures[np.isfinite(postures).all(axis=1)]
    rows = [table(_HEAD, ())]
    for path in given.robot or [ROBOT]:
        for side in ("left", "right"):
            rows.append(row_of(load_robot(path), path.stem, side, body, postures))
            print(rows[-1], flush=True)
    if given.write:
        text, found = DOCUMENT.read_text(encoding="utf-8"), "\n".join(rows)
        write_file(DOCUMENT, replaced(text, f"\n{found}\n", BEGIN, END))
    return 0


if __name__ == "__main__":
    sys.exit(main())
