"""Robot commands from a sequence of postures, with a dead-man's switch."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import N_JOINTS
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.body.skeleton import JOINT_NAMES
from cardbox_tracker.estimation.estimate import TRACKING
from cardbox_tracker.retargeting.config import RetargetConfig
from cardbox_tracker.retargeting.followed import with_neck
from cardbox_tracker.retargeting.motion import Limits, Moment, SafeMotion
from cardbox_tracker.retargeting.robot import Robot

MOVING = "moving"


class Method(Protocol):
    """A mapping from postures to joint positions of a robot."""

    @property
    def sources(self) -> tuple[str, ...]:
        """Names of the person's joints on which the target depends."""

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the robot's joints that are moved."""

    def target(self, body: BodyModel, posture: FloatArray, now: FloatArray) -> FloatArray:
        """Return target positions (n,) of the robot's joints for a posture with the head, (14,).

        ``now`` (n,) are the current positions. The angles of the head are nan while unknown. The
        target may be beyond the joint limits; it is nan if there is no solution.
        """


class Command(NamedTuple):
    """Command for the robot at one image.

    Attributes:
        positions: positions (n,) of ``Retargeter.joints``, rad or m.
        status: ``moving``, or ``frozen:`` with the reason.
        duration_s: time in which the robot reaches the positions, s.
    """

    positions: FloatArray
    status: str
    duration_s: float

    @property
    def is_moving(self) -> bool:
        """True unless the robot must stand still."""
        return self.status == MOVING


class Retargeter:
    """Makes one robot command an image, always within the limits of position and speed.

    Between two images :meth:`at` has positions and velocities for any time of the robot's clock.
    """

    def __init__(self, robot: Robot, method: Method, config: RetargetConfig) -> None:
        """Begin at 0, or at the limit nearest to 0, for each joint.

        Raises:
            CardboxError: the robot lacks a joint of ``method``.
        """
        self.joints = method.joints
        lower, upper, speed = robot.limits_of(method.joints)
        self._motion = SafeMotion(Limits(lower, upper, np.minimum(speed, config.max_speed)))
        self._method, self._config = method, config
        self._sources = [JOINT_NAMES.index(name) for name in method.sources]
        self._before_ns: int | None = None
        self._commanded_ns: int | None = None

    def at(self, now_ns: int) -> Moment:
        """Return positions and velocities of ``joints`` at a time of the robot's clock, ns."""
        return self._motion.at(now_ns)

    def hold(self, reason: str, now_ns: int) -> Command:
        """Return the command to stand still from now on; the next image counts as the first."""
        self._before_ns = None
        return self._stop(reason, now_ns)

    def update(
        self,
        stamp_ns: int,
        state: str,
        body: BodyModel | None = None,
        posture: FloatArray | None = None,
        stddev: FloatArray | None = None,
        now_ns: int | None = None,
    ) -> Command:
        """Return the command for an image.

        Args:
            stamp_ns: stamp of the image.
            state: tracking state; the robot moves only in the state ``tracking``.
            body: the person.
            posture: d1..d12, rad and metres, and the angles of the neck if known; (12,) or (14,).
            stddev: their standard deviations, (12,) or (14,).
            now_ns: time of the robot's clock; None if that is the stamp. The robot moves for no
                longer than since the command before, whatever the stamps say.
        """
        now_ns = stamp_ns if now_ns is None else now_ns
        before_ns, self._before_ns = self._before_ns, stamp_ns
        commanded_ns, self._commanded_ns = self._commanded_ns, now_ns
        reason = self._reason(state, posture, stddev)
        if reason or body is None or posture is None or stddev is None:
            return self._stop(reason or "no body model", now_ns)
        whole = with_neck(posture, stddev, self._config.max_stddev_rad)
        target = self._method.target(body, whole, self.at(now_ns).positions)
        if not np.isfinite(target).all():
            return self._stop("no solution", now_ns)
        elapsed_ns = 0 if before_ns is None else stamp_ns - before_ns
        waited_ns = elapsed_ns if commanded_ns is None else now_ns - commanded_ns
        longest_ns = round(self._config.longest_step_s * 1e9)
        duration_ns = max(min(elapsed_ns, waited_ns, longest_ns), 0)
        return Command(self._motion.move(target, now_ns, duration_ns), MOVING, duration_ns / 1e9)

    def _stop(self, reason: str, now_ns: int) -> Command:
        return Command(self._motion.stop(now_ns), f"frozen: {reason.replace('_', ' ')}", 0.0)

    def _reason(self, state: str, posture: FloatArray | None, stddev: FloatArray | None) -> str:
        """Return why the robot must not move; empty if it may."""
        if state != TRACKING:
            return state.replace("_", " ") or "no state yet"
        if posture is None or stddev is None:
            return "no posture"
        worst = stddev[self._sources]
        if not (
            np.isfinite(posture[:N_JOINTS]).all() and (worst <= self._config.max_stddev_rad).all()
        ):
            return "too uncertain"
        return ""
