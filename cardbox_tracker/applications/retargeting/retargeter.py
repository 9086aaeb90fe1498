"""Robot commands from a sequence of postures, within limits and with a dead-man's switch."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.retargeting.arm import ArmFollower
from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.joint_map import (
    head_map,
    load_joint_map,
    with_head_and_hands,
)
from cardbox_tracker.applications.retargeting.robot import Robot, load_robot
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import (
    ELBOW_ABDUCTION,
    ELBOW_FLEXION,
    FIRST_ANGLES,
    N_JOINTS,
    SHOULDER_ABDUCTION,
    SHOULDER_FLEXION,
)
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import HAND_OPEN_NAMES, JOINT_NAMES, KEYPOINT_NAMES
from cardbox_tracker.tracking.estimate import TRACKING, UNCERTAIN

FOLLOWING = "following"
# Abduction and flexion of each limb in a posture.
_ABDUCTIONS = np.add.outer(FIRST_ANGLES, [SHOULDER_ABDUCTION, ELBOW_ABDUCTION]).ravel()
_FLEXIONS = np.add.outer(FIRST_ANGLES, [SHOULDER_FLEXION, ELBOW_FLEXION]).ravel()
# The keypoint that tells of each joint of the person: the angles at the shoulder are those of the
# elbow's place, these of the hand's.
_ENDS = [
    f"{name.partition('_')[0]}_{'hand' if '_elbow_' in name else 'elbow'}" for name in JOINT_NAMES
]
# Settings that a joint map does not need.
_OF_AN_ARM = (
    *("base", "hand", "gripper", "gripper_open", "trunk_radius_m", "arms_apart_m", "lowest_m"),
    *("mount_roll_deg", "mount_pitch_deg", "mount_yaw_deg", "follow", "hand_scale", "rest"),
)
# The first of the speeds with which a robot begins to follow, of its highest.
_SLOWEST = 0.1
# Acceleration by speed, and jerk by acceleration, 1/s: at any speed the robot is late by the sum of
# both inverses, 0.1 s.
_PER_SECOND = 20.0


class Method(Protocol):
    """A mapping from postures to joint positions of a robot."""

    @property
    def sources(self) -> tuple[tuple[str, ...], ...]:
        """For each joint of the robot, what its target depends on: joints or keypoints, hands."""

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the robot's joints that are moved."""

    def target(
        self, body: BodyModel, posture: FloatArray, now: FloatArray, begins: bool = False
    ) -> FloatArray:
        """Return target positions (n,) of the joints for a posture with head and hands, (16,).

        ``now`` (n,) are the current positions. What is not known of head and hands is nan. The
        target may be beyond the joint limits; it is nan if there is no solution. With ``begins``,
        movements are followed from this posture and these positions on, if with a clutch.
        """

    def clear(self, positions: FloatArray, now: FloatArray) -> FloatArray:
        """Return the positions (n,) near to these at which the hand is not in the way.

        Where there are none, they are the current ones, ``now`` (n,).
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


class _Segment(NamedTuple):
    """The set-point from a time on, s: position (n,) then, and velocity (n,)."""

    begun_s: float
    position: FloatArray
    velocity: FloatArray


def _still(position: FloatArray) -> _Segment:
    return _Segment(-math.inf, position, np.zeros(len(position)))


class SafeMotion:
    """A motion within limits of position, speed, acceleration and jerk, whatever is asked for.

    A set-point moves within the limits of position and speed. Its mean over two times, one after
    the other, is where the robot is: so it keeps these limits; its acceleration is at most twice
    the speed over the first time, and its jerk twice the acceleration over the second one. The
    robot is late by half of both times.

    Attributes:
        settles_ns: after this time a stopped robot stands still, ns.
    """

    def __init__(self, limits: Limits, start: FloatArray, acceleration: float, jerk: float) -> None:
        """Stand still at ``start`` (n,), or the limits nearest to it."""
        self._limits = limits
        fastest = float(limits.speed.max())
        self._times_s = max(2 * fastest / acceleration, 1e-3), max(2 * acceleration / jerk, 1e-3)
        self.settles_ns = math.ceil(sum(self._times_s) * 1e9) + 1
        self.begin(start)

    def begin(self, position: FloatArray) -> None:
        """Stand still at ``position`` (n,), or the limits nearest to it, at all times."""
        position = np.clip(position, self._limits.lower, self._limits.upper)
        self._segments = [_still(position)]

    def set_point(self, now_ns: int) -> FloatArray:
        """Return where the set-point is (n,); the robot follows it a little later."""
        now_s = now_ns / 1e9
        begun = (one for one in reversed(self._segments) if one.begun_s <= now_s)
        last = next(begun, self._segments[0])
        if not last.velocity.any():
            return last.position
        return np.clip(
            last.position + (now_s - last.begun_s) * last.velocity,
            self._limits.lower,
            self._limits.upper,
        )

    def at(self, now_ns: int) -> Moment:
        """Return positions and velocities at a time of the robot's clock, ns."""
        now_s = now_ns / 1e9
        first = self._segments[0]
        position, velocity = first.position.copy(), first.velocity.copy()
        if velocity.any():
            position += (now_s - first.begun_s - 0.5 * sum(self._times_s)) * velocity
        for before, after in zip(self._segments, self._segments[1:], strict=False):
            way, speed = self._ramp(now_s - after.begun_s)
            change = after.velocity - before.velocity
            position += way * change
            velocity += speed * change
        return Moment(np.clip(position, self._limits.lower, self._limits.upper), velocity)

    def _ramp(self, passed_s: float) -> tuple[float, float]:
        """Return position and velocity after a set-point has moved at 1 for a time."""
        first_s, second_s = self._times_s
        if passed_s >= first_s + second_s:
            return passed_s - 0.5 * (first_s + second_s), 1.0
        corners = ((0.0, 1), (first_s, -1), (second_s, -1))
        since = [(max(passed_s - corner, 0.0), sign) for corner, sign in corners]
        area = first_s * second_s
        return (
            sum(sign * time**3 for time, sign in since) / (6 * area),
            sum(sign * time**2 for time, sign in since) / (2 * area),
        )

    def stop(self, now_ns: int) -> None:
        """Stop the set-point at ``now_ns``; the robot decelerates."""
        point, now_s = self.set_point(now_ns), now_ns / 1e9
        kept = [one for one in self._segments if one.begun_s < now_s]
        settled = [i for i, one in enumerate(kept) if one.begun_s <= now_s - sum(self._times_s)]
        self._segments = kept[settled[-1] if settled else 0 :] or [_still(point)]
        if self._segments[-1].velocity.any():
            self._segments.append(_Segment(now_s, point, np.zeros(len(point))))

    def move(self, target: FloatArray, now_ns: int, duration_ns: int, share: float = 1.0) -> None:
        """Move the set-point towards ``target`` (n,) for a time from now on, then stop it.

        It stands still unless the target is finite and the time is positive; ``share`` is of the
        highest speed.
        """
        self.stop(now_ns)
        if not np.isfinite(target).all() or duration_ns <= 0:
            return
        start = self.set_point(now_ns)
        self._segments.append(_Segment(now_ns / 1e9, start, np.zeros(len(start))))
        self.go_on(target, duration_ns, share)

    def go_on(self, target: FloatArray, duration_ns: int, share: float = 1.0) -> None:
        """Move the set-point towards a finite ``target`` (n,) for a time from its stop on."""
        begun_s, start, _ = self._segments[-1]
        duration_s = duration_ns / 1e9
        lower, upper, speed = self._limits
        most = share * speed * duration_s
        goal = start + np.clip(np.clip(target, lower, upper) - start, -most, most)
        if (goal != start).any():
            self._segments[-1] = _Segment(begun_s, start, (goal - start) / duration_s)
            self._segments.append(_Segment(begun_s + duration_s, goal, np.zeros(len(goal))))


class Command(NamedTuple):
    """Command for the robot at one image."""

    positions: FloatArray  #: positions (n,) of ``Retargeter.joints``, rad or m
    status: str  #: ``following``, or ``holding:`` with the reason
    duration_s: float  #: time in which the robot reaches the positions, s

    @property
    def is_moving(self) -> bool:
        """True unless the robot must stand still."""
        return self.status == FOLLOWING

    @property
    def reason(self) -> str:
        """Why the robot stands still; empty if it does not."""
        return self.status.partition(": ")[2]


class Retargeter:
    """Makes one robot command an image, always within the limits of its motion.

    Between two images :meth:`at` has positions and velocities for any time of the robot's clock.

    Attributes:
        joints: names of the robot's joints.
        limits: those of the joints' motion.
        tolerance: the largest following errors (n,), rad or m; inf for a gripper, which what it
            holds may stop.
        settles_ns: time in which the robot stops, ns.
    """

    def __init__(self, robot: Robot, method: Method, config: RetargetConfig) -> None:
        """Begin at ``config.start``, at 0, or at the limit nearest to 0, for each joint.

        Raises CardboxError if the robot lacks a joint of ``method``, or the start does not fit.
        """
        self.joints = method.joints
        limits = Limits(*robot.limits_of(method.joints))
        self.limits = limits = limits._replace(speed=np.minimum(limits.speed, config.max_speed))
        acceleration = config.max_acceleration or _PER_SECOND * config.max_speed
        self._motion = SafeMotion(
            limits,
            robot.positions_of("start", config.start, method.joints, 0.0),
            acceleration,
            config.max_jerk or _PER_SECOND * acceleration,
        )
        self.settles_ns = self._motion.settles_ns
        self._method, self._config = method, config
        # (n, 12): whether a joint of the robot follows one of the person.
        sources = method.sources
        self._sources = np.array([[one in names for one in JOINT_NAMES] for names in sources])
        # (n, 6): the same for keypoints, of which the place is followed.
        self._places = np.array([[one in names for one in KEYPOINT_NAMES] for names in sources])
        self._follows = self._sources.any(axis=1) | self._places.any(axis=1)
        grips = [not set(HAND_OPEN_NAMES).isdisjoint(names) for names in sources]
        most = np.minimum(config.max_following_error, (limits.upper - limits.lower) / 4)
        self.tolerance = np.where(grips, np.inf, most)
        self._before_ns: int | None = None
        self._commanded_ns: int | None = None
        self._followed_ns: int | None = None
        self._offset = np.zeros(len(method.joints))
        self._target, self._sure_ns = self._offset, np.full(len(method.joints), -np.inf)

    def begin(self, positions: FloatArray) -> None:
        """Stand still at the robot's ``positions`` (n,); the next image counts as the first."""
        self._motion.begin(positions)
        self._before_ns = self._followed_ns = None

    def at(self, now_ns: int) -> Moment:
        """Return positions and velocities of ``joints`` at a time of the robot's clock, ns."""
        return self._motion.at(now_ns)

    def hold(self, reason: str, now_ns: int) -> Command:
        """Return the command to stop from now on; the next image counts as the first."""
        self._before_ns = self._followed_ns = None
        return self._stop(reason, now_ns)

    def hold_near(self, positions: FloatArray, reason: str, now_ns: int) -> Command:
        """Return the command to stop within a third of the ``tolerance`` of the robot, (n,).

        So one that presses on something is released, and can be led away from it.
        """
        held = self.hold(reason, now_ns)
        point, near = self._motion.set_point(now_ns), self.tolerance / 3
        goal = np.clip(point, positions - near, positions + near)
        duration_ns = math.ceil(float((np.abs(goal - point) / self.limits.speed).max()) * 1e9)
        self._motion.move(goal, now_ns, duration_ns)
        return held._replace(positions=goal, duration_s=held.duration_s + duration_ns / 1e9)

    def update(
        self,
        stamp_ns: int,
        state: str,
        body: BodyModel | None = None,
        posture: FloatArray | None = None,
        stddev: FloatArray | None = None,
        now_ns: int | None = None,
        hands: FloatArray | None = None,
        keypoints: Mapping[str, tuple[str, float]] | None = None,
    ) -> Command:
        """Return the command for an image of a stamp, ns.

        The robot moves in the state ``tracking``, and those of its joints whose keypoints are
        ``tracked`` also in the state ``uncertain``; ``keypoints`` are states and chances to be
        wrong by name. Posture and deviations are (12,), or (14,) with the neck, rad and metres.
        ``now_ns`` is the robot's clock, None if that is the stamp: the robot moves for no longer
        than since the command before, whatever the stamps say. ``hands`` are how open both are,
        (2,), 0 to 1, nan if not known.
        """
        now_ns = stamp_ns if now_ns is None else now_ns
        now_ns = max(now_ns, self._commanded_ns or now_ns)
        before_ns, self._before_ns = self._before_ns, stamp_ns
        commanded_ns, self._commanded_ns = self._commanded_ns, now_ns
        if state != TRACKING and not (state == UNCERTAIN and keypoints):
            if state != UNCERTAIN:
                self._followed_ns = None
            return self._stop(state.replace("_", " ") or "no state yet", now_ns)
        if posture is None or stddev is None:
            return self._stop("no posture", now_ns)
        if body is None:
            return self._stop("no body model", now_ns)
        held = self._held(posture, stddev, keypoints or {})
        begins, longest_ns = self._followed_ns is None, round(self._config.longest_step_s * 1e9)
        # An unsure image soon after a sure one is as one that is missing.
        self._sure_ns = np.where(held, self._sure_ns, now_ns)
        waits = held & (now_ns - self._sure_ns <= longest_ns) & (not begins)
        held &= ~waits
        is_blind = self._follows.any() and held[self._follows].all()
        if is_blind or not np.isfinite(posture[:N_JOINTS]).all():
            return self._stop("too uncertain", now_ns)
        whole = with_head_and_hands(posture, stddev, self._config.max_stddev_rad, hands)
        point = self._motion.set_point(now_ns)
        target = np.where(held, point, self._method.target(body, whole, point, begins))
        target = self._target = np.where(waits, self._target, target)
        if not np.isfinite(target).all():
            return self._stop("no solution", now_ns)
        if self._followed_ns is None:
            self._followed_ns = now_ns
            # A gripper opens or closes, and a hand that is followed alone began where it is.
            is_moved = np.isinf(self.tolerance) | self._places.any(axis=1)
            is_moved |= not self._config.clutch
            self._offset = np.where(is_moved, 0.0, point - target)
        elapsed_ns = 0 if before_ns is None else stamp_ns - before_ns
        waited_ns = elapsed_ns if commanded_ns is None else now_ns - commanded_ns
        duration_ns = max(min(elapsed_ns, waited_ns, longest_ns), 0)
        followed_s, soft_s = (now_ns - self._followed_ns) / 1e9, self._config.soft_start_s
        share = min(max(followed_s / soft_s, _SLOWEST), 1.0) if soft_s else 1.0
        wanted, way = np.where(held, point, target + self._offset), [point]
        # The next image may be late: what is not yet there goes on for the longest step.
        parts_ns = duration_ns, longest_ns - duration_ns if duration_ns else 0
        for part_ns in parts_ns:
            # On the way, too, the hand is not in the trunk.
            most = share * self.limits.speed * part_ns / 1e9
            goal = way[-1] + np.clip(wanted - way[-1], -most, most)
            way.append(np.where(held, point, self._method.clear(goal, way[-1])))
        self._motion.move(way[1], now_ns, duration_ns, share)
        self._motion.go_on(way[2], parts_ns[1], share)
        return Command(self.at(now_ns + duration_ns).positions, FOLLOWING, duration_ns / 1e9)

    def _stop(self, reason: str, now_ns: int) -> Command:
        self._motion.stop(now_ns)
        end = self.at(now_ns + self.settles_ns).positions
        return Command(end, f"holding: {reason.replace('_', ' ')}", self.settles_ns / 1e9)

    def _held(
        self, posture: FloatArray, stddev: FloatArray, keypoints: Mapping[str, tuple[str, float]]
    ) -> NDArray[np.bool_]:
        """Return which joints (n,) of the robot stay because theirs are not sure.

        A limb that points along the axis of its abduction has a sure direction, but no sure
        abduction: what follows both angles of a limb needs the direction alone.
        """
        given = np.stack([posture[:N_JOINTS], stddev[:N_JOINTS]])
        sure = np.isfinite(given).all(axis=0) & self._tracked(_ENDS, keypoints)
        angles, spread = np.where(sure, given, 0.0)
        bent, shaking = angles[_FLEXIONS], spread[_FLEXIONS]
        # The root of the mean square of the cosine, in which the abduction turns the limb, and that
        # of the chord of the turn: an angle that is not known at all leaves the limb on a cone.
        turned = np.minimum(np.hypot(np.cos(bent), shaking * np.sin(bent)), 1.0)
        turned *= np.sqrt(-2.0 * np.expm1(-0.5 * np.clip(spread[_ABDUCTIONS], -9, 9) ** 2))
        spreads = np.tile(spread, (len(self._sources), 1))
        both = self._sources[:, _FLEXIONS]
        spreads[:, _ABDUCTIONS] = np.where(both, turned, spread[_ABDUCTIONS])
        is_held = self._sources & ~(sure & (spreads <= self._config.max_stddev_rad))
        is_lost = self._places & ~self._tracked(KEYPOINT_NAMES, keypoints)
        return np.asarray(is_held.any(axis=1) | is_lost.any(axis=1))

    def _tracked(
        self, names: Sequence[str], keypoints: Mapping[str, tuple[str, float]]
    ) -> NDArray[np.bool_]:
        """Return which keypoints (n,) of these names are tracked, or not known."""
        known = [keypoints.get(name, ("tracked", 0.0)) for name in names]
        most = self._config.max_chance
        return np.array([state == "tracked" and chance <= most for state, chance in known])


class _Together:
    """A :class:`Method` of several parts of one robot."""

    def __init__(self, parts: Sequence[Method], apart_m: float) -> None:
        self._parts, self._apart_m = parts, apart_m
        self.joints = tuple(name for one in parts for name in one.joints)
        self.sources = tuple(names for one in parts for names in one.sources)
        if len(set(self.joints)) < len(self.joints):
            raise CardboxError(
                "the robot has one arm, or one hand was given; expected two arms for the "
                "side 'both'"
            )
        self._ends = np.cumsum([len(one.joints) for one in parts])[:-1]

    def target(
        self, body: BodyModel, posture: FloatArray, now: FloatArray, begins: bool = False
    ) -> FloatArray:
        parts = zip(self._parts, np.split(now, self._ends), strict=True)
        return np.concatenate([one.target(body, posture, part, begins) for one, part in parts])

    def clear(self, positions: FloatArray, now: FloatArray) -> FloatArray:
        split = (np.split(one, self._ends) for one in (positions, now))
        parts = zip(self._parts, *split, strict=True)
        found = np.concatenate([one.clear(part, before) for one, part, before in parts])
        # Arms that are too near may part.
        least_m = min(self._apart_m, self._between_m(now))
        return found if self._between_m(found) >= least_m else now

    def _between_m(self, positions: FloatArray) -> float:
        """Return the distance of the axes of both arms, m; infinite for a single one."""
        parts = zip(self._parts, np.split(positions, self._ends), strict=True)
        arms = [one.axes(part) for one, part in parts if isinstance(one, ArmFollower)]
        if len(arms) < 2:
            return math.inf
        return float(np.linalg.norm(arms[0][:, None] - arms[1][None], axis=-1).min())


def make_retargeter(
    robot_file: str | os.PathLike[str],
    joint_map: str | os.PathLike[str] | None,
    config: RetargetConfig,
) -> tuple[Robot, Retargeter, str]:
    """Return a robot, its retargeter, and a table of the joints that were found.

    Without a joint map, the robot's arm is found and follows, or both and the head. Raises
    CardboxError if a file cannot be read, the robot lacks a joint or link, its arm is not clear, or
    a setting is given that a joint map does not need.
    """
    robot = load_robot(robot_file)
    if joint_map:
        usual = RetargetConfig()
        given = [name for name in _OF_AN_ARM if getattr(config, name) != getattr(usual, name)]
        if given or config.side == "both":
            raise CardboxError(
                f"expected either a joint map or {', '.join(given) or 'both sides'}, not both"
            )
        method: Method = load_joint_map(joint_map)
        return robot, Retargeter(robot, method, config), ""
    sides = ("left", "right") if config.side == "both" else (config.side,)
    arms = [ArmFollower(robot, config, side) for side in sides]
    head = head_map(robot, arms[0].mount) if config.side == "both" else None
    tables = [
        f"{side} arm\n{one.arm.table(robot, config.max_speed)}"
        for side, one in zip(sides, arms, strict=True)
    ]
    if arms[0].turned_deg:
        tables.append(
            f"the shoulders tell how the root is turned: mount_yaw_deg is {arms[0].turned_deg:g}"
        )
    if head is not None:
        tables.append(f"head\n{robot.table(head.roles, config.max_speed)}")
    method = _Together([*arms, head] if head is not None else arms, config.arms_apart_m)
    return robot, Retargeter(robot, method, config), "\n".join(tables)
