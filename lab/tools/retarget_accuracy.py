"""Measure how far a robot's arm points from where the person's arm points.

python -m lab.tools.retarget_accuracy --robot URDF [--robot URDF ...] SESSION...

Each session is a folder with ``bag/`` and ``ground_truth.json``. The robots follow the true
postures without limits of speed and through their trunks, so the figures are those of the transfer,
not of the tracker. With ``--lag``, the right arm follows them in real time, by its limits of
motion, at several speeds. ``--write`` replaces the table of either kind in ``docs/retargeting.md``.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.retargeting.arm import ArmFollower, directions_of
from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.retargeter import Retargeter
from cardbox_tracker.applications.retargeting.robot import Robot, load_robot
from cardbox_tracker.common.files import write_file
from cardbox_tracker.person.model import BodyModel, body_from_proportions
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.tracking.estimate import TRACKING
from lab.evaluation.angles import true_postures
from lab.evaluation.session import load_session
from lab.pages import replaced, row, table

Motion = tuple[NDArray[np.int64], FloatArray]
"""Stamps, ns (n,), and postures (n, 12)."""
ROOT = Path(__file__).resolve().parents[2]
DOCUMENT, ROBOT = ROOT / "docs" / "retargeting.md", ROOT / "config" / "example_arm.urdf"
BEGIN, END = "<!-- retarget-accuracy:begin -->", "<!-- retarget-accuracy:end -->"
LAG_BEGIN, LAG_END = "<!-- retarget-lag:begin -->", "<!-- retarget-lag:end -->"
_LAG_HEAD = ("robot", "max_speed", "shoulder to hand", "lag")
_POSITIONS = 20_000
_SPEEDS, _STEP_NS, _LONGEST_LAG = (1.0, 2.0, 4.0, 8.0), 10_000_000, 60
_HEAD = ("robot", "side", "upper arm", "forearm", "shoulder to hand", "at a limit", "time")


def degrees_between(found: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return the angles (...) between unit vectors (..., 3), degrees."""
    cosines: FloatArray = (found * wanted).sum(axis=-1)
    return np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))


def lag_of(
    robot: Robot, name: str, body: BodyModel, motions: Sequence[Motion], speed: float
) -> str:
    """Return a row of the table of lag at a speed, rad/s, for the stamps and postures of motions.

    The lag is that by which the robot's direction is nearest to the person's.
    """
    config = RetargetConfig(trunk_radius_m=0.0, max_speed=speed, soft_start_s=0.0)
    behind: list[FloatArray] = []
    for stamps_ns, postures in motions:
        follower = ArmFollower(robot, config)
        retargeter, way = Retargeter(robot, follower, config), list[FloatArray]()
        # The robot goes on for the longest lag after the last image.
        ends = [*stamps_ns[1:].tolist(), int(stamps_ns[-1]) + (_LONGEST_LAG + 1) * _STEP_NS]
        for stamp_ns, end_ns, posture in zip(stamps_ns.tolist(), ends, postures, strict=True):
            retargeter.update(stamp_ns, TRACKING, body, posture, np.full(len(posture), 0.1))
            while (at_ns := int(stamps_ns[0]) + len(way) * _STEP_NS) < end_ns:
                positions = retargeter.at(at_ns).positions[: len(follower.arm.joints)]
                way.append(follower.kinematics.directions(positions)[2])
        wanted = np.array([directions_of(body, posture, "right")[2] for posture in postures])
        at = np.rint((stamps_ns - stamps_ns[0]) / _STEP_NS).astype(int)
        shifted = np.array(way)[at[:, None] + np.arange(_LONGEST_LAG)]
        behind.append(degrees_between(shifted, wanted[:, None]))
    found = np.concatenate(behind)
    half, most = np.percentile(found[:, 0], (50, 90))
    lag_s = np.median(found, axis=0).argmin() * _STEP_NS / 1e9
    return row((name, f"{speed:g}", f"{half:.1f} / {most:.1f}°", f"{lag_s:.2f} s"))


def row_of(
    robot: Robot,
    name: str,
    side: str,
    body: BodyModel,
    postures: FloatArray,
    lowest_m: float = -10.0,
) -> str:
    """Return a row of the table: median and nine in ten of the angles, degrees.

    ``postures`` (n, 12) are followed one after the other, as those of a recording.
    """
    follower = ArmFollower(robot, RetargetConfig(side=side, trunk_radius_m=0.0, lowest_m=lowest_m))
    lower, upper, _ = robot.limits_of(follower.arm.joints)
    hidden = np.full((len(postures), 4), np.nan)
    now, angles, limited = np.zeros(len(follower.joints)), [], []
    begun = time.perf_counter()
    for posture in np.hstack([postures, hidden]):
        now = follower.target(body, posture, now)
        arm = now[: len(lower)]
        found = follower.kinematics.directions(arm)
        angles.append(degrees_between(found, directions_of(body, posture, side)))
        limited.append(bool(((arm < lower + 1e-6) | (arm > upper - 1e-6)).any()))
    took_ms = 1000 * (time.perf_counter() - begun) / len(postures)
    shares = (f"{half:.1f} / {most:.1f}°" for half, most in np.percentile(angles, (50, 90), 0).T)
    return row((name, side, *shares, f"{np.mean(limited):.0%}", f"{took_ms:.0f} ms"))


def least_of(
    robot: Robot, side: str, body: BodyModel, postures: FloatArray, lowest_m: float
) -> str:
    """Return the least angles from shoulder to hand above a table, whatever the arm does else.

    They are median and nine in ten, degrees, by random positions of the arm's joints.
    """
    follower = ArmFollower(robot, RetargetConfig(side=side, trunk_radius_m=0.0, lowest_m=lowest_m))
    kinematics, rng = follower.kinematics, np.random.default_rng(0)
    lower, upper, _ = robot.limits_of(follower.arm.joints)
    positions = rng.uniform(lower, upper, (_POSITIONS, len(lower)))
    free = [one for one in positions if not kinematics.too_near(one)[0].size]
    hands = np.array([kinematics.directions(one)[2] for one in free])
    wanted = np.array([directions_of(body, posture, side)[2] for posture in postures])
    half, most = np.percentile(
        np.degrees(np.arccos(np.minimum((wanted @ hands.T).max(axis=1), 1.0))), (50, 90)
    )
    return f"{half:.1f} / {most:.1f}°"


def main(args: list[str] | None = None) -> int:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    parser.add_argument("--robot", action="append", type=Path, metavar="URDF")
    parser.add_argument("--write", action="store_true", help="write the table into the document")
    parser.add_argument("--lag", action="store_true", help="the table of lag instead")
    parser.add_argument("--lowest-m", type=float, default=-10.0, help="of retarget, not in --lag")
    given = parser.parse_args(args)
    body = body_from_proportions(1.75, 2.0)
    motions: list[Motion] = []
    for session in map(load_session, given.sessions):
        postures = true_postures(session)
        known = np.isfinite(postures).all(axis=1)
        motions.append((session.stamps_ns[known], postures[known]))
    together = np.concatenate([postures for _, postures in motions])
    rows = [table(_LAG_HEAD if given.lag else _HEAD, ())]
    for path in given.robot or [ROBOT]:
        robot, name = load_robot(path), path.stem
        for value in _SPEEDS if given.lag else ("left", "right"):
            if isinstance(value, str):
                rows.append(row_of(robot, name, value, body, together, given.lowest_m))
                if given.lowest_m > -10.0:
                    least = least_of(robot, value, body, together, given.lowest_m)
                    print(f"least possible from shoulder to hand: {least}")
            else:
                rows.append(lag_of(robot, name, body, motions, value))
            print(rows[-1], flush=True)
    if given.write:
        text, found = DOCUMENT.read_text(encoding="utf-8"), "\n".join(rows)
        marks = (LAG_BEGIN, LAG_END) if given.lag else (BEGIN, END)
        write_file(DOCUMENT, replaced(text, f"\n{found}\n", *marks))
    return 0


if __name__ == "__main__":
    sys.exit(main())
