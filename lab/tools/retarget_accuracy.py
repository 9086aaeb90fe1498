"""Measure how far a robot that follows the tracker is from one that follows the true joints.

python -m lab.tools.retarget_accuracy SESSION...

Each session is a folder with ``bag/`` and ``ground_truth.json``. The robot is
``config/example_arm.urdf``, once for each arm of the person. The table of the means replaces that
between the marks in ``docs/retargeting.md``; the errors of each session are printed.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.hand import HandFollower
from cardbox_tracker.applications.retargeting.retargeter import Retargeter
from cardbox_tracker.applications.retargeting.robot import Robot, load_robot
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.config import PRESETS, TrackerConfig
from cardbox_tracker.tracking.estimate import TRACKING, Estimate
from cardbox_tracker.tracking.tracker import Tracker
from lab.evaluation.angles import comparable, true_postures
from lab.evaluation.people_report import replaced
from lab.evaluation.session import RecordedSession, load_session
from lab.evaluation.tracking import track_session

ROOT = Path(__file__).resolve().parents[2]
DOCUMENT, ROBOT = ROOT / "docs" / "retargeting.md", ROOT / "config" / "example_arm.urdf"
BEGIN, END = "<!-- retarget-accuracy:begin -->", "<!-- retarget-accuracy:end -->"
OTHERS_RAD = (0.4, 0.55, 1.0)
"""Further values of ``max_stddev_rad``, for the last rows."""
_HEAD = (
    *("session", "standing still", "mean, moving", "half below", "nine in ten below"),
    "mean, all images",
)
BoolArray = NDArray[np.bool_]

SIDES = ("left", "right")


@dataclass(frozen=True)
class HandError:
    """Distances between the two robots' hands, cm, over the images of both arms.

    Attributes:
        images: scored images.
        frozen: share of images in which the robot stood still, per arm.
        mean: distance while it moved.
        percentile_50: half of the distances are below.
        percentile_90: nine in ten are below.
        with_frozen: mean distance over all images; the true arm moves on while the robot stands.
    """

    images: int
    frozen: float
    mean: float
    percentile_50: float
    percentile_90: float
    with_frozen: float


def hand_errors(
    session: RecordedSession,
    tracker: TrackerConfig,
    seed: int,
    robot: Robot,
    configs: Sequence[RetargetConfig],
) -> list[HandError]:
    """Track a session and compare robots that follow the measured and the true arms.

    Args:
        session: the recording.
        tracker: settings of the tracker.
        seed: of initialization and filters.
        robot: the arm.
        configs: settings, one for each returned error; ``side`` is ignored.

    Raises:
        CardboxError: the recording or the robot cannot be used.
        ValueError: the truth lacks the torso's angles, or nobody was tracked.
    """
    found: dict[int, Estimate] = {}
    body: list[BodyModel] = []

    def observe(_: int, stamp_ns: int, estimate: Estimate, of: Tracker) -> None:
        found[stamp_ns] = estimate
        body[:] = [of.body]

    track_session(session, tracker, (seed,), observe=observe)
    known = comparable(session, found)
    stamps = session.stamps_ns[known].tolist()
    truth = true_postures(session)[known]
    estimates = [found[stamp] for stamp in stamps]
    return [
        _error(
            [
                _distances(robot, replace(config, side=side), body[0], stamps, estimates, truth)
                for side in SIDES
            ]
        )
        for config in configs
    ]


def _error(sides: Sequence[tuple[FloatArray, BoolArray]]) -> HandError:
    """Return the error of both arms from their distances and whether the robot moved."""
    distance_cm = np.concatenate([distance for distance, _ in sides])
    moving = np.concatenate([is_moving for _, is_moving in sides])
    while_moving = distance_cm[moving] if moving.any() else np.array([np.nan])
    half, most = np.percentile(while_moving, (50, 90)).tolist()
    return HandError(
        images=len(distance_cm) // len(sides),
        frozen=float(1.0 - moving.mean()),
        mean=float(while_moving.mean()),
        percentile_50=half,
        percentile_90=most,
        with_frozen=float(distance_cm.mean()),
    )


def _distances(
    robot: Robot,
    config: RetargetConfig,
    body: BodyModel,
    stamps_ns: list[int],
    estimates: list[Estimate],
    truth: FloatArray,
) -> tuple[FloatArray, BoolArray]:
    """Return the distance of the hands (n,), cm, and whether the robot moved (n,)."""
    follower = HandFollower(robot, config)
    measured, true = (Retargeter(robot, follower, config) for _ in range(2))
    distances, moved = [], []
    for stamp_ns, one, posture in zip(stamps_ns, estimates, truth, strict=True):
        command = measured.update(stamp_ns, one.state, body, one.posture, one.posture_stddev)
        wanted = true.update(stamp_ns, TRACKING, body, posture, np.zeros(12))
        hands = [follower.hand_m(each.positions) for each in (command, wanted)]
        distances.append(100 * float(np.linalg.norm(hands[0] - hands[1])))
        moved.append(command.is_moving)
    return np.array(distances), np.array(moved)


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
        print(row(session.name, found[-1][0]), flush=True)
    for config, errors in zip(configs, zip(*found, strict=True), strict=True):
        name = f"**mean**, `max_stddev_rad` {config.max_stddev_rad:g}"
        rows.append(row(name, mean_of(errors)))
    text, table = DOCUMENT.read_text(encoding="utf-8"), "\n".join(rows)
    DOCUMENT.write_text(replaced(text, f"\n{table}\n", BEGIN, END), encoding="utf-8")
    print(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
