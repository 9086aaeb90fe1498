"""Retargeting of an arm: the directions of upper arm, forearm and hand of the robot and the person.

The three directions, in the frame of the torso, are the same for the robot as for the person, as
far as its joints allow. Or only the hand is followed: its place from the shoulder, in lengths of
the stretched arm, while it stays as upright as it is at rest. Damped least squares find the joint
positions, from those before and, where these fit badly, from others.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from cardbox_tracker.applications.retargeting.chain import Arm, find_arm
from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.joint_map import WITH_HEAD_AND_HANDS
from cardbox_tracker.applications.retargeting.robot import Robot
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.least_squares import Residuals, minimize, rules_of
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.posture import LEFT_ARM, RIGHT_ARM
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import arm_directions, rotation_x, rotation_y, rotation_z
from cardbox_tracker.tracking.estimate import CLOSED, OPEN

ARM_JOINTS = ("shoulder_abduction", "shoulder_flexion", "elbow_abduction", "elbow_flexion")
_STEPS, _LARGEST_STEP, _CLOSE = 12, 0.8, 3e-2
# The joints are pulled to the middle of their range, so that redundant ones do not drift.
_REST = 0.03
_DAMPING = 1e-3
# Where the directions are off by more than about 15 degrees, another start is tried in each image,
# and taken if it fits much better: a robot must not swing to another solution for a small gain.
_BAD, _MUCH_BETTER = 0.07, 0.5
_STARTS = 8
# Where a robot cannot have all three directions, its hand is where the person's is.
_WEIGHTS = (1.0, 1.0, 2.0)
# A hand that is followed alone rather tilts than is elsewhere.
_PLACE, _TILT = 2.0, 0.5
# A point that is too near counts so much for each metre that it comes nearer by millimetres only.
_KEEPS_OUT = 100.0
_IDENTITY = np.eye(3)
# Points along a part of an arm, whose distances are those of its axis to some millimetres.
_POINTS = 9
_SHORTEST_M, _LONGEST_M = 0.01, 100.0
_LEAST_PART, _LEAST_SINE = 0.2, 0.5


def directions_of(body: BodyModel, posture: FloatArray, side: str) -> FloatArray:
    """Return unit vectors (3, 3) in the torso frame: upper arm, forearm, shoulder to hand."""
    return _units(*_limbs(body, posture, side))


def hand_of(body: BodyModel, posture: FloatArray, side: str) -> FloatArray:
    """Return the hand (3,) from its shoulder, torso frame, in lengths of the stretched arm."""
    upper, fore = _limbs(body, posture, side)
    reach_m = float(np.linalg.norm(upper) + np.linalg.norm(fore))
    return np.asarray((upper + fore) / reach_m)


def _limbs(body: BodyModel, posture: FloatArray, side: str) -> tuple[FloatArray, FloatArray]:
    """Return shoulder to elbow and elbow to hand, each (3,), m in the torso frame."""
    sign = 1.0 if side == "left" else -1.0
    upper, fore = arm_directions(posture[LEFT_ARM if side == "left" else RIGHT_ARM], sign)
    parts = body_parts(body.sizes)
    return parts.upper_arm.height_m * upper, parts.forearm.height_m * fore


def _units(upper: FloatArray, fore: FloatArray) -> FloatArray:
    vectors = np.stack([upper, fore, upper + fore])
    found: FloatArray = vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9)
    return found


class _Places(NamedTuple):
    """Origins (n, 3), m, and axes (n, 3) of the moving joints, tip (3,), m, and turn (3, 3)."""

    origins_m: FloatArray
    axes: FloatArray
    tip_m: FloatArray
    turn: FloatArray  # from the last moving link to the root


class _Step(NamedTuple):
    """A moving joint: its place after the one before, and how it moves."""

    origin_m: FloatArray
    turn: FloatArray
    axis: FloatArray
    cross: FloatArray
    cross_twice: FloatArray
    slides: bool
    number: int
    is_own: bool
    multiplier: float
    offset: float


class Kinematics:
    """Where the joints of an arm are.

    Attributes:
        shoulder: number of the joint at the shoulder, the second one.
        elbow: number of the joint at the elbow.
        reach_m: length of the stretched arm from the shoulder to the tip.
    """

    def __init__(self, arm: Arm, trunk_radius_m: float = 0.0, lowest_m: float = -math.inf) -> None:
        """Prepare; raise CardboxError if a length is impossible, or there is no elbow and hand."""
        self._lowest_m = lowest_m
        self._steps, self._tip_m = _steps(arm)
        self._slides = np.array([step.slides for step in self._steps if step.is_own])
        first = next(i for i, one in enumerate(arm.path) if one.name == arm.joints[0])
        offsets = [float(np.linalg.norm(one.origin_m)) for one in arm.path[first:]]
        moving = [i for i, one in enumerate(arm.path[first:]) if one.name in arm.joints]
        self.shoulder = 1
        lengths = [sum(offsets[moving[1] + 1 : number + 1]) for number in moving]
        self.reach_m = sum(offsets[moving[1] + 1 :])
        if not _SHORTEST_M <= self.reach_m <= _LONGEST_M:
            raise CardboxError(
                f"the robot's arm is {self.reach_m:g} m long from its second joint to {arm.tip}; "
                f"expected {_SHORTEST_M:g} to {_LONGEST_M:g} m: a URDF has metres, and a hand that "
                "is not its last joint"
            )
        places = self.at(np.zeros(len(lengths)))
        self.elbow = self._find_elbow(lengths, places)
        aside_m = float(np.linalg.norm(places.origins_m[self.shoulder][:2]))
        self._trunk_radius_m = min(trunk_radius_m, aside_m)

    def _find_elbow(self, lengths: list[float], places: _Places) -> int:
        """Return the first joint after the shoulder that bends the arm, not one that twists it."""
        for number in range(2, len(lengths)):
            share = lengths[number] / self.reach_m
            upper = places.origins_m[number] - places.origins_m[self.shoulder]
            sine = np.linalg.norm(np.cross(places.axes[number], upper))
            if share > _LEAST_PART and sine > _LEAST_SINE * np.linalg.norm(upper):
                if share < 1.0 - _LEAST_PART:
                    return number
                break
        # Without an elbow the arm is one straight part.
        return len(lengths)

    def at(self, positions: FloatArray) -> _Places:
        """Return the places, in the frame of the robot's root, at joint positions (n,)."""
        turn, place = np.eye(3), np.zeros(3)
        origins, turns = [], []
        for step in self._steps:
            place = place + turn @ step.origin_m
            turn = turn @ step.turn
            if step.is_own:
                origins.append(place)
                turns.append(turn @ step.axis)
            value = step.multiplier * float(positions[step.number]) + step.offset
            if step.slides:
                place = place + turn @ (value * step.axis)
            else:
                sine, cosine = math.sin(value), 1.0 - math.cos(value)
                turn = turn @ (_IDENTITY + sine * step.cross + cosine * step.cross_twice)
        tip = place + turn @ self._tip_m
        return _Places(np.array(origins), np.array(turns), tip, turn)

    def directions(self, positions: FloatArray) -> FloatArray:
        """Return unit vectors (3, 3) as :func:`directions_of`, in the frame of the root."""
        return self._directions(self.at(positions))[0]

    def _directions(self, places: _Places) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the directions, their lengths (3,), and derivatives of the parts (2, 3, n)."""
        ends = np.vstack([places.origins_m, places.tip_m])
        shoulder, elbow = ends[self.shoulder], ends[self.elbow]
        at_shoulder = self._moved(places, shoulder, self.shoulder)
        at_tip = self._moved(places, places.tip_m, len(places.axes))
        if self.elbow == len(places.axes):
            elbow, at_elbow = 0.5 * (shoulder + places.tip_m), 0.5 * (at_shoulder + at_tip)
        else:
            at_elbow = self._moved(places, elbow, self.elbow)
        upper, fore = elbow - shoulder, places.tip_m - elbow
        lengths = np.linalg.norm(np.stack([upper, fore, upper + fore]), axis=1)
        return (
            _units(upper, fore),
            np.maximum(lengths, 1e-6),
            np.stack([at_elbow - at_shoulder, at_tip - at_elbow]),
        )

    def _moved(self, places: _Places, point: FloatArray, before: int) -> FloatArray:
        """Return the derivatives (3, n) of a point that the joints ``before`` a number move."""
        turned = _cross(places.axes, point - places.origins_m)
        found = np.where(self._slides[:, None], places.axes, turned)
        return np.where((np.arange(len(found)) < before)[:, None], found, 0.0).T

    def too_near(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how far points of forearm and hand are in the trunk or too low, and derivatives.

        The trunk is a capsule about the Z axis of the root. Shapes (k,), m, and (k, n).
        """
        return self._too_near(self.at(positions))

    def _too_near(self, places: _Places) -> tuple[FloatArray, FloatArray]:
        ends, count = np.vstack([places.origins_m, places.tip_m]), len(places.axes)
        start = self.elbow if self.elbow < count else self.shoulder
        # The middle of the forearm, the joints after the elbow, and the tip.
        pairs = [(start, count), *((one, one) for one in (*range(self.elbow + 1, count), count))]
        gaps, slopes = [], []
        for pair in pairs:
            x, y, z = (0.5 * (ends[pair[0]] + ends[pair[1]])).tolist()
            above = max(z - float(places.origins_m[self.shoulder, 2]), 0.0)
            far_m = max(math.hypot(x, y, above), 1e-6)
            for gap_m, normal in (
                (far_m - self._trunk_radius_m, (x / far_m, y / far_m, above / far_m)),
                (z - self._lowest_m, (0.0, 0.0, 1.0)),
            ):
                if gap_m < 0.0:
                    gaps.append(gap_m)
                    moved = sum(self._moved(places, ends[one], one) for one in pair)
                    slopes.append(0.5 * np.array(normal) @ moved)
        return np.array(gaps), np.array(slopes).reshape(-1, count)

    def hand(self, places: _Places) -> FloatArray:
        """Return the hand (3,) from the shoulder, as :func:`hand_of`."""
        return np.asarray((places.tip_m - places.origins_m[self.shoulder]) / self.reach_m)

    def hand_residual(
        self, positions: FloatArray, wanted: FloatArray, tilt: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return how far the hand is off, and what is too near, (6 + k,), and derivatives.

        ``wanted`` (3,) is its place as :func:`hand_of`, and ``tilt`` (3,) the vertical in its axes.
        """
        places = self.at(positions)
        shoulder = places.origins_m[self.shoulder]
        moved = self._moved(places, places.tip_m, len(places.axes))
        moved = moved - self._moved(places, shoulder, self.shoulder)
        x, y, _ = np.where(self._slides[:, None], 0.0, places.axes).T
        tilted = np.outer(places.turn[1], x) - np.outer(places.turn[0], y)
        gaps, slopes = self._too_near(places)
        place = self.hand(places) - wanted
        off = (_PLACE * place, _TILT * (places.turn[2] - tilt), _KEEPS_OUT * gaps)
        changes = (_PLACE / self.reach_m * moved, _TILT * tilted, _KEEPS_OUT * slopes)
        return np.concatenate(off), np.concatenate(changes)

    def residual(self, positions: FloatArray, wanted: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how far the directions are off, and what is too near, (9 + k,); derivatives."""
        places = self.at(positions)
        found, lengths, parts = self._directions(places)
        changes = [parts[0], parts[1], parts[0] + parts[1]]
        rows = [
            weight / length * (change - np.outer(unit, unit @ change))
            for weight, change, unit, length in zip(_WEIGHTS, changes, found, lengths, strict=True)
        ]
        weights = np.array(_WEIGHTS)[:, None]
        gaps, slopes = self._too_near(places)
        off = np.concatenate([(weights * (found - wanted)).ravel(), _KEEPS_OUT * gaps])
        return off, np.concatenate([*rows, _KEEPS_OUT * slopes])


def _cross(left: FloatArray, right: FloatArray) -> FloatArray:
    """Return the cross products of two (n, 3); numpy's takes several times as long."""
    return left[:, [1, 2, 0]] * right[:, [2, 0, 1]] - left[:, [2, 0, 1]] * right[:, [1, 2, 0]]


def _steps(arm: Arm) -> tuple[list[_Step], FloatArray]:
    """Return the moving joints to the tip, and the tip (3,) after the last one, m."""
    found: list[_Step] = []
    turn, place = np.eye(3), np.zeros(3)
    for one in arm.path:
        place, turn = place + turn @ one.origin_m, turn @ one.turn
        leader = one.mimics or one.name
        if leader not in arm.joints or one.upper <= one.lower:
            continue
        x, y, z = one.axis.tolist()
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        found.append(
            _Step(
                *(place, turn, one.axis, cross, cross @ cross, one.kind == "prismatic"),
                *(arm.joints.index(leader), not one.mimics, one.multiplier, one.offset),
            )
        )
        turn, place = np.eye(3), np.zeros(3)
    return found, place


def _turned_deg(robot: Robot) -> float:
    """Return how a root is turned about its Z axis if the left shoulder is not at its left."""
    try:
        left, right = (find_arm(robot, side) for side in ("left", "right"))
        places = [Kinematics(one).at(np.zeros(len(one.joints))) for one in (left, right)]
    except CardboxError:
        return 0.0
    x, y, _ = places[0].origins_m[1] - places[1].origins_m[1]
    return 90.0 * round(math.atan2(x, y) / (np.pi / 2))


class ArmFollower:
    """A :class:`~.retargeter.Method` by which the robot's arm points as the person's arm.

    Attributes:
        arm: what was found in the robot.
        kinematics: where its joints are.
        joints: the arm's joints and the gripper, if there is one.
        mount: rotation matrix (3, 3) from the robot's root to the person's torso.
        turned_deg: the part of its yaw that no setting has, as the robot's shoulders tell it.
        sources: for each joint, the joints of the person's arm, or the keypoint of the hand that
            is followed alone; how open the hand is for the gripper.
    """

    def __init__(self, robot: Robot, config: RetargetConfig, side: str = "") -> None:
        """Prepare for one ``side``, or that of the settings; raise CardboxError without an arm."""
        self._side = side or config.side
        self.arm = find_arm(robot, self._side, config.base, config.hand, config.gripper)
        self.kinematics = Kinematics(self.arm, config.trunk_radius_m, config.lowest_m)
        gripper = (self.arm.gripper,) if self.arm.gripper else ()
        self.joints = (*self.arm.joints, *gripper)
        self._is_hand, self._scale = config.follow == "hand", config.hand_scale
        self._has_clutch, self._offset = config.clutch, np.zeros(3)
        followed = ("hand",) if self._is_hand else ARM_JOINTS
        behind = tuple(f"{self._side}_{name}" for name in followed)
        hand = (f"{self._side}_hand_open",)
        self.sources = (*(behind for _ in self.arm.joints), *(hand for _ in gripper))
        self._lower, self._upper, _ = robot.limits_of(self.joints)
        if config.gripper_open == "lower":
            self._closed, self._open = self._upper[-1], self._lower[-1]
        else:
            self._closed, self._open = self._lower[-1], self._upper[-1]
        self._hand = WITH_HEAD_AND_HANDS.index(*hand)
        mount_deg = np.array([config.mount_roll_deg, config.mount_pitch_deg, config.mount_yaw_deg])
        self.turned_deg = 0.0 if mount_deg.any() else _turned_deg(robot)
        angles = np.radians(mount_deg + np.array([0.0, 0.0, self.turned_deg]))
        self.mount = rotation_z(angles[2]) @ rotation_y(angles[1]) @ rotation_x(angles[0])
        self._solution: FloatArray | None = None
        self._grip: float | None = None
        self._turn = 0
        random = np.random.default_rng(0)
        count = len(self.arm.joints)
        self._low, self._high = self._lower[:count], self._upper[:count]
        # A slide or an arm of several turns has a wide range, of which a turn suffices.
        # With both sides, the other arm's joints may be named, too.
        named = tuple(robot.joints) if config.side == "both" else self.arm.joints
        middle = np.clip(np.mean(robot.limits_of(named)[:2], axis=0), -np.pi, np.pi)
        at_rest = robot.positions_of("rest", config.rest, named, middle)
        rest = at_rest[[named.index(name) for name in self.arm.joints]]
        self._tilt = self.kinematics.at(rest).turn[2]
        limits = {"low": self._low, "high": self._high}
        self._rules = rules_of(
            count, mean=rest, inverse=_REST**2, damping=_DAMPING, largest=_LARGEST_STEP, **limits
        )
        width = np.minimum(self._high - self._low, 2 * np.pi)
        self._starts = np.vstack([rest, rest + width * (random.random((_STARTS, count)) - 0.5)])
        # The first solution loads compiled code, which takes longer than a robot waits.
        wanted = self.kinematics.directions(rest)
        self._solved(rest, wanted[2] if self._is_hand else wanted)

    def target(
        self, body: BodyModel, posture: FloatArray, now: FloatArray, begins: bool = False
    ) -> FloatArray:
        """See :class:`~.retargeter.Method`."""
        if self._is_hand:
            wanted = self._scale * hand_of(body, posture, self._side) @ self.mount
            if begins and self._has_clutch:
                arm = now[: len(self.arm.joints)]
                places, self._solution = self.kinematics.at(arm), arm
                self._tilt, self._offset = places.turn[2], self.kinematics.hand(places) - wanted
            wanted = wanted + self._offset
        else:
            wanted = directions_of(body, posture, self._side) @ self.mount
        before = now[: len(self.arm.joints)] if self._solution is None else self._solution
        best, error = self._solved(before, wanted)
        if error > _BAD:
            self._turn = (self._turn + 1) % len(self._starts)
            other, least = self._solved(self._starts[self._turn], wanted)
            if least < _MUCH_BETTER * error:
                best = other
        self._solution = best
        found = np.array([*best, *now[len(best) :]])
        if self.arm.gripper and np.isfinite(hand := float(posture[self._hand])):
            # A hand that is neither open nor closed does not drop what it holds.
            if hand > OPEN or hand < CLOSED:
                self._grip = self._open if hand > OPEN else self._closed
            if self._grip is not None:
                found[-1] = self._grip
        return found

    def axes(self, positions: FloatArray) -> FloatArray:
        """Return points (m, 3) along forearm and hand, m in the frame of the root."""
        places = self.kinematics.at(positions[: len(self.arm.joints)])
        corners = np.vstack([places.origins_m[self.kinematics.elbow :], places.tip_m])
        if len(corners) == 1:
            corners = np.vstack([places.origins_m[self.kinematics.shoulder], places.tip_m])
        shares = np.linspace(0.0, 1.0, _POINTS)[:, None, None]
        return np.reshape(corners[:-1] + shares * (corners[1:] - corners[:-1]), (-1, 3))

    def clear(self, positions: FloatArray, _: FloatArray) -> FloatArray:
        """See :class:`~.retargeter.Method`."""
        found = positions.copy()
        arm = found[None, : len(self.arm.joints)]

        def gaps(arm: FloatArray) -> Residuals:
            gaps, slopes = self.kinematics.too_near(arm[0])
            return Residuals(gaps[None], slopes[None])

        rules = rules_of(arm.size, damping=1e-4, low=self._low, high=self._high)
        arm[:] = minimize({"gaps": gaps}, arm, rules, steps=3).values
        return found

    def _solved(self, start: FloatArray, wanted: FloatArray) -> tuple[FloatArray, float]:
        """Return joint positions (n,) within the limits and the squared error of what is wanted."""

        def off(positions: FloatArray) -> Residuals:
            if self._is_hand:
                off, slopes = self.kinematics.hand_residual(positions[0], wanted, self._tilt)
            else:
                off, slopes = self.kinematics.residual(positions[0], wanted)
            return Residuals(off[None], slopes[None])

        start = np.clip(start, self._low, self._high)[None]
        found = minimize({"off": off}, start, self._rules, _STEPS, _CLOSE)
        return found.values[0], float(found.costs["off"][0])
