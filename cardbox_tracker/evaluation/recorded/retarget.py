"""How far a robot's hand that follows the tracker is from one that follows the true joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import N_JOINTS
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.config import TrackerConfig
from cardbox_tracker.estimation.estimate import TRACKING, Estimate
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.evaluation.recorded.angles import comparable, true_postures
from cardbox_tracker.evaluation.recorded.session import RecordedSession
from cardbox_tracker.evaluation.recorded.tracking import track_session
from cardbox_tracker.retargeting.config import RetargetConfig
from cardbox_tracker.retargeting.hand import HandFollower
from cardbox_tracker.retargeting.retargeter import Retargeter
from cardbox_tracker.retargeting.robot import Robot

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
        with_frozen: mean distance over all images: the true arm moves on while the robot stands.
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
    """Track a session and let a robot follow either arm, as measured and as it truly was.

    Args:
        session: the recording.
        tracker: settings of the tracker.
        seed: of initialization and filters.
        robot: the arm.
        configs: settings, each for an error of its own; ``side`` does not count.

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
    """Return the error of both arms, each with distances and whether the robot moved."""
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
        wanted = true.update(stamp_ns, TRACKING, body, posture, np.zeros(N_JOINTS))
        hands = [follower.hand_m(each.positions) for each in (command, wanted)]
        distances.append(100 * float(np.linalg.norm(hands[0] - hands[1])))
        moved.append(command.is_moving)
    return np.array(distances), np.array(moved)
