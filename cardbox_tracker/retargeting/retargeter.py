"""Robot commands from a sequence of postures, with a dead-man's switch."""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import JOINT_NAMES
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.estimate import TRACKING
from cardbox_tracker.retargeting.config import RetargetConfig
from cardbox_tracker.retargeting.motion import Limits, SafeMotion
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
        """Return target positions (n,) of the robot's joints for a posture (12,).

        ``now`` (n,) are the current positions. The target may be beyond the joint limits; it is
        nan if there is no solution.
        """


class Command(NamedTuple):
    """Command for the robot at one image.

    Attributes:
        positions: positions (n,) of ``Retargeter.joints``, rad or m.
        status: ``moving``, or ``frozen:`` with the reason.
        duration_s: time in which the robot reaches the positions.
    """

    positions: FloatArray
    status: str
    duration_s: float

    @property
    def is_moving(self) -> bool:
        """True unless the robot must stand still."""
        return self.status == MOVING


class Retargeter:
    """Makes one robot command an image, always within the limits of position and speed."""

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

    def hold(self, reason: str) -> Command:
        """Return the command to stand still; the next image counts as the first."""
        self._before_ns = None
        return Command(self._motion.positions, f"frozen: {reason.replace('_', ' ')}", 0.0)

    def update(
        self,
        stamp_ns: int,
        state: str,
        body: BodyModel | None = None,
        posture: FloatArray | None = None,
        stddev: FloatArray | None = None,
        waited_s: float = math.inf,
    ) -> Command:
        """Return the command for an image.

        Args:
            stamp_ns: stamp of the image.
            state: tracking state; the robot moves only in the state ``tracking``.
            body: the person.
            posture: d1..d12, (12,), rad and metres.
            stddev: their standard deviations, (12,).
            waited_s: time since the last command by the robot's clock, s. The robot moves for no
                longer, whatever the stamps say.
        """
        before_ns, self._before_ns = self._before_ns, stamp_ns
        elapsed_s = 0.0 if before_ns is None else (stamp_ns - before_ns) / 1e9
        duration_s = max(min(elapsed_s, waited_s, self._config.longest_step_s), 0.0)
        reason = self._reason(state, posture, stddev)
        if reason or body is None or posture is None:
            return Command(self._motion.positions, f"frozen: {reason or 'nobody'}", duration_s)
        target = self._method.target(body, posture, self._motion.positions)
        if not np.isfinite(target).all():
            return Command(self._motion.positions, "frozen: no solution", duration_s)
        return Command(self._motion.move(target, duration_s), MOVING, duration_s)

    def _reason(self, state: str, posture: FloatArray | None, stddev: FloatArray | None) -> str:
        """Return why the robot must not move; empty if it may."""
        if state != TRACKING:
            return state.replace("_", " ") or "no state yet"
        if posture is None or stddev is None:
            return "no posture"
        worst = stddev[self._sources]
        if not (np.isfinite(posture).all() and (worst <= self._config.max_stddev_rad).all()):
            return "too uncertain"
        return ""
