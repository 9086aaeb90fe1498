"""Robot commands from a sequence of postures, within limits and with a dead-man's switch."""

from __future__ import annotations

import os
from typing import NamedTuple, Protocol

import numpy as np

from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.hand import HandFollower
from cardbox_tracker.applications.retargeting.joint_map import load_joint_map, with_head_and_hands
from cardbox_tracker.applications.retargeting.robot import Robot, load_robot
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_JOINTS
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import JOINT_NAMES
from cardbox_tracker.tracking.estimate import TRACKING

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
        """Return target positions (n,) of the joints for a posture with head and hands, (16,).

        ``now`` (n,) are the current positions. What is not known of head and hands is nan. The
        target may be beyond the joint limits; it is nan if there is no solution.
        """


class Limits(NamedTuple):
    """Lowest and highest positions (n,), rad or m, and highest speeds (n,), rad/s or m/s."""

    lower: FloatArray
    upper: FloatArray
    speed: FloatArray


class Moment(NamedTuple):
    """Positions (n,), rad or m, and velocities (n,), rad/s or m/s, at one time."""

    positions: FloatArray
    velocities: FloatArray


class SafeMotion:
    """A motion with constant velocities that ends at the goal and stands still from there.

    Attributes:
        goal: joint positions (n,) at the end, rad or m.
    """

    def __init__(self, limits: Limits) -> None:
        """Stand still at 0 or the limit nearest to 0."""
        self._limits = limits
        zero = np.zeros(len(limits.lower))
        self.goal: FloatArray = np.clip(zero, limits.lower, limits.upper)
        self._start, self._begun_ns, self._duration_ns = self.goal, 0, 0

    def at(self, now_ns: int) -> Moment:
        """Return positions and velocities at a time of the robot's clock, ns."""
        passed_ns, whole_ns = now_ns - self._begun_ns, self._duration_ns
        if not 0 <= passed_ns < whole_ns:
            return Moment(self.goal, np.zeros(len(self.goal)))
        way = self.goal - self._start
        return Moment(self._start + passed_ns / whole_ns * way, way / (whole_ns / 1e9))

    def stop(self, now_ns: int) -> FloatArray:
        """Stand still from ``now_ns`` on and return the positions (n,)."""
        self.goal = self.at(now_ns).positions
        self._duration_ns = 0
        return self.goal

    def move(self, target: FloatArray, now_ns: int, duration_ns: int) -> FloatArray:
        """Move towards ``target`` (n,) for a time from now on and return the goal (n,).

        The robot stands still unless the target is finite and the time is positive.
        """
        self.stop(now_ns)
        if np.isfinite(target).all() and duration_ns > 0:
            lower, upper, speed = self._limits
            most = np.minimum(speed * (duration_ns / 1e9), upper - lower)
            step = np.clip(np.clip(target, lower, upper) - self.goal, -most, most)
            self._start, self._begun_ns, self._duration_ns = self.goal, now_ns, duration_ns
            self.goal = np.clip(self._start + step, lower, upper)
        return self.goal


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
        hands: FloatArray | None = None,
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
            hands: how open both hands are, (2,), 0 to 1, nan for one that is not known.
        """
        now_ns = stamp_ns if now_ns is None else now_ns
        before_ns, self._before_ns = self._before_ns, stamp_ns
        commanded_ns, self._commanded_ns = self._commanded_ns, now_ns
        reason = self._reason(state, posture, stddev)
        if reason or body is None or posture is None or stddev is None:
            return self._stop(reason or "no body model", now_ns)
        whole = with_head_and_hands(posture, stddev, self._config.max_stddev_rad, hands)
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


def make_retargeter(
    robot_file: str | os.PathLike[str],
    joint_map: str | os.PathLike[str] | None,
    hand_link: str,
    config: RetargetConfig,
) -> tuple[Robot, Retargeter]:
    """Return a robot and its retargeter.

    Args:
        robot_file: URDF of the robot.
        joint_map: file of a joint map; if None, the hand is followed by inverse kinematics.
        hand_link: link of the robot's hand; if empty, the link with the longest joint chain.
        config: settings.

    Raises:
        CardboxError: a file cannot be read, the robot lacks a joint or link, or the libraries for
            inverse kinematics are not installed.
    """
    robot = load_robot(robot_file)
    method: Method
    if joint_map:
        if hand_link:
            raise CardboxError("expected either a joint map or a hand, not both")
        method = load_joint_map(joint_map)
    else:
        method = HandFollower(robot, config, hand_link)
    return robot, Retargeter(robot, method, config)
