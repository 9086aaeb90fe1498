"""A person as the 24 joints of SMPL, which OpenXR body tracking, Isaac and SONIC also use.

All is in the person's frame: origin in the pelvis, X ahead, Y left, Z up. The pelvis stays upright
and only turns, so a wrong pitch of the camera makes no robot walk. Legs that are not seen stand.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.legs import LEG_KEYPOINT_NAMES, leg_rotations, legs_m
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.proportions import ANKLE_SHARE, WRIST_SHARE, stature_of
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import (
    HAND_NAMES,
    JOINT_NAMES,
    LEG_NAMES,
    NECK_NAMES,
    POINT_NAMES,
    STATE_NAMES,
    Group,
    KeypointState,
    names_of,
    neck_pivot_m,
    neck_rotation,
    rotation_x,
    rotation_y,
    rotation_z,
    turn_of,
)
from cardbox_tracker.tracking.estimate import TRACKING, UNCERTAIN

if TYPE_CHECKING:
    from cardbox_tracker.recordings.result_reader import Results

NAMES: tuple[str, ...] = (
    *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2"),
    *("left_ankle", "right_ankle", "spine3", "left_foot", "right_foot", "neck", "left_collar"),
    *("right_collar", "head", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow"),
    *("left_wrist", "right_wrist", "left_hand", "right_hand"),
)
"""The joints in their order."""
_SIDES = {"left": 1.0, "right": -1.0}
_TRUNK = JOINT_NAMES[1:4]
# Places in SMPL's mean body: the pelvis above the hips, and the foot ahead of the ankle, as shares
# of the stature; the spine from pelvis to neck, and the collar from neck to shoulder.
_PELVIS, _FOOT, _COLLAR = 0.054, 0.07, 0.46
_SPINE = {"spine1": 0.21, "spine2": 0.48, "spine3": 0.58}
# A leg is seen if no angle has a larger deviation; one that no longer is turns to standing so fast.
_SURE_RAD, _STANDS_UP_RAD_S = 0.5, 1.0
# The plane of a straighter elbow, against which a forearm rolls, is not known: its sine.
_LEAST_BEND = 0.34
_SHANK = "knee", "ankle", "foot"


class FullBody(NamedTuple):
    """A person at one time."""

    stamp_ns: int  #: stamp of the image, or the time between two
    points_m: FloatArray  #: (24, 3), metres in the person's frame, always finite
    #: unit quaternions (24, 4), w first, of each joint in the person's frame; at rest, with hanging
    #: arms, all are (1, 0, 0, 0)
    turns: FloatArray
    yaw_rad: float  #: how far the person's frame is turned to the left of facing the camera
    #: roll, pitch and yaw of both wrists, (2, 3): about the forearm, down and to the left for a
    #: forearm ahead whose thumb is up; 0 where a hand is not measured
    wrists_rad: FloatArray
    valid: NDArray[np.bool_]  #: whether each joint is measured, (24,); others keep what they had

    def invalid(self, stamp_ns: int) -> FullBody:
        """Return the same body of a time of which nothing is known."""
        return self._replace(stamp_ns=stamp_ns, valid=np.zeros(len(NAMES), bool))

    def until(self, later: FullBody, stamp_ns: int) -> FullBody:
        """Return the body at a time between this one and a ``later`` one, or at its ends."""
        span_ns = max(later.stamp_ns - self.stamp_ns, 1)
        share = min(max((stamp_ns - self.stamp_ns) / span_ns, 0.0), 1.0)
        near = np.where((self.turns * later.turns).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
        turns = (1 - share) * self.turns + share * near * later.turns
        valid = self.valid & later.valid
        if share in (0.0, 1.0):
            valid = later.valid if share else self.valid
        yaw_rad = (later.yaw_rad - self.yaw_rad + np.pi) % (2 * np.pi) - np.pi
        return FullBody(
            stamp_ns,
            (1 - share) * self.points_m + share * later.points_m,
            turns / np.linalg.norm(turns, axis=1, keepdims=True),
            self.yaw_rad + share * yaw_rad,
            (1 - share) * self.wrists_rad + share * later.wrists_rad,
            valid,
        )


class FullBodies:
    """Makes the full body of image after image; what is not measured keeps its last angles."""

    def __init__(self) -> None:
        self._angles = dict.fromkeys(STATE_NAMES, 0.0)
        self._before: FullBody | None = None

    def update(
        self,
        stamp_ns: int,
        state: str,
        body: BodyModel | None,
        values: Mapping[str, float],
        stddev: Mapping[str, float],
        keypoints: Mapping[str, tuple[str, float]],
    ) -> FullBody | None:
        """Return the body of an image; None before the first one with a person.

        ``values`` are joints by name, rad and m. A joint without a deviation in ``stddev`` is not
        known. ``keypoints`` are states and chances to be wrong by name; if empty, all are tracked.
        """
        known = {
            name: values[name]
            for name in self._angles
            if np.isfinite((values.get(name, np.nan), stddev.get(name, np.nan))).all()
        }
        before = self._before
        is_seen = state in (TRACKING, UNCERTAIN) and known.keys() >= set(JOINT_NAMES)
        if body is None or not is_seen:
            return before and before.invalid(stamp_ns)

        def tracked(*names: str) -> bool:
            found = (keypoints.get(name, (KeypointState.TRACKED, 0.0))[0] for name in names)
            return all(one == KeypointState.TRACKED for one in found)

        shoulders = bool(keypoints) and tracked("left_shoulder", "right_shoulder")
        trunk = state == TRACKING or shoulders
        if trunk:
            self._take(known, _TRUNK)
        head = trunk and self._take(known, NECK_NAMES)
        sure = dict.fromkeys(NAMES, trunk) | {"head": head}
        passed_s = 0.0 if before is None else max(stamp_ns - before.stamp_ns, 0) / 1e9
        for side in _SIDES:
            arm = names_of(Group.ARM, side=side)
            elbow = trunk and tracked(f"{side}_elbow") and self._take(known, arm[:2])
            hand = elbow and tracked(f"{side}_hand") and self._take(known, arm[2:])
            if hand:
                self._take(known, names_of(Group.HAND, side=side))
            legs = names_of(Group.LEG, side=side)
            # A straight leg hides its rotation, which then matters little.
            is_sure = all(stddev.get(legs[i], np.inf) < _SURE_RAD for i in (0, 1, 3))
            leg = trunk and is_sure and self._take(known, legs)
            if not leg:
                for name in legs:
                    most = _STANDS_UP_RAD_S * passed_s
                    self._angles[name] -= float(np.clip(self._angles[name], -most, most))
            parts = dict.fromkeys(_SHANK, leg) | {"elbow": elbow}
            parts |= {"wrist": hand, "hand": hand}
            sure |= {f"{side}_{part}": one for part, one in parts.items()}
        yaw_rad = known["torso_yaw"] if trunk or before is None else before.yaw_rad
        valid = np.array([sure[name] for name in NAMES])
        points_m, turns, wrists_rad = self._placed(body)
        self._before = FullBody(stamp_ns, points_m, turns, yaw_rad, wrists_rad, valid)
        return self._before

    def _take(self, known: Mapping[str, float], names: tuple[str, ...]) -> bool:
        """Take new angles if all of ``names`` are known."""
        if not known.keys() >= set(names):
            return False
        self._angles |= {name: known[name] for name in names}
        return True

    def _of(self, names: tuple[str, ...]) -> FloatArray:
        return np.array([self._angles[name] for name in names])

    def _placed(self, body: BodyModel) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return points, turns and wrists of the last angles, see :class:`FullBody`."""
        parts = body_parts(body.sizes)
        stature_m = stature_of(parts)
        posture = self._of(JOINT_NAMES)
        posture[[0, 3]] = 0.0
        posed = pose(body, posture)
        points = dict(zip(POINT_NAMES, posed.points_m - posed.hip, strict=True))
        torso, legs = posed.torso_rotation, self._of(LEG_NAMES)
        points["pelvis"] = np.array([0.0, 0.0, _PELVIS * stature_m])
        to_neck = points["neck"] - points["pelvis"]
        points |= {name: points["pelvis"] + share * to_neck for name, share in _SPINE.items()}
        points["head"] = torso @ neck_pivot_m(parts)
        turns = dict.fromkeys(NAMES, torso) | {"pelvis": np.eye(3)}
        turns["head"] = torso @ neck_rotation(self._of(NECK_NAMES))
        legs_at = legs_m(body, np.zeros((1, 3)), np.zeros(1), legs[None])[0]
        points |= zip(LEG_KEYPOINT_NAMES, legs_at, strict=True)
        wrists = np.zeros((2, 3))
        for number, (side, sign) in enumerate(_SIDES.items()):
            arm = posed.left if side == "left" else posed.right
            shoulder, elbow, hand = (points[f"{side}_{at}"] for at in ("shoulder", "elbow", "hand"))
            turn, flexion, deviation = self._of(names_of(Group.HAND, side=side))
            palm = arm.forearm_rotation @ rotation_z(-sign * turn)
            if turn or flexion or deviation:
                limbs = -arm.upper_arm_rotation[:, 2], -arm.forearm_rotation[:, 2]
                roll = _roll(-sign * palm[:, 1], *limbs, sign)
                wrists[number] = roll, deviation, -sign * flexion
            palm = palm @ rotation_x(-sign * flexion) @ rotation_y(deviation)
            wrist = elbow + WRIST_SHARE * (hand - elbow)
            length_m = (1.0 - WRIST_SHARE) * float(np.linalg.norm(hand - elbow))
            thigh, shank = leg_rotations(legs[4 * number : 4 * number + 4], sign)
            down_m = ANKLE_SHARE * stature_m
            foot = points[f"{side}_ankle"] + shank @ (_FOOT * stature_m, 0.0, -down_m)
            new = {"wrist": wrist, "hand": wrist - length_m * palm[:, 2], "foot": foot}
            new["collar"] = points["neck"] + _COLLAR * (shoulder - points["neck"])
            points |= {f"{side}_{name}": point for name, point in new.items()}
            upper = {"shoulder": arm.upper_arm_rotation, "elbow": arm.forearm_rotation}
            rest = {"wrist": palm, "hand": palm, "hip": thigh, **dict.fromkeys(_SHANK, shank)}
            turns |= {f"{side}_{name}": one for name, one in (upper | rest).items()}
        places = np.array([points[name] for name in NAMES]) - points["pelvis"]
        quaternions = Rotation.from_matrix([turns[name] for name in NAMES]).as_quat()
        return places, quaternions[:, [3, 0, 1, 2]], wrists


def _roll(palm: FloatArray, upper: FloatArray, fore: FloatArray, sign: float) -> float:
    """Return how far a palm is turned about the forearm from facing inwards, rad; all (3,)."""
    inwards = sign * np.cross(upper, fore)
    if np.linalg.norm(inwards) < _LEAST_BEND:
        return 0.0
    return float(np.arctan2(np.cross(inwards, palm) @ fore, inwards @ palm))


# Between images farther apart nothing is known; a longer gap is shortened.
_LONGEST_S, _LONGEST_GAP_S = 0.5, 1.0


def bodies_of(results: Results) -> Iterator[FullBody]:
    """Yield the full body of each image, from the first one with a person on."""
    # Without these, nodes start faster.
    from cardbox_tracker.applications.exporting.motion import in_reference
    from cardbox_tracker.recordings.result_table import PALM_COLUMNS

    make = FullBodies()
    values, deviations = results.of(STATE_NAMES), results.deviations_of(STATE_NAMES)
    palms, turns = results.of(PALM_COLUMNS).reshape(-1, 2, 3), [HAND_NAMES[0], HAND_NAMES[3]]
    images = zip(results.state, results.bodies, values, deviations, palms, strict=True)
    rows = zip(results.stamp_ns.tolist(), images, results.keypoints(), strict=True)
    for stamp_ns, (state, body, row, stddev, palm), keypoints in rows:
        found, known = (dict(zip(STATE_NAMES, one.tolist(), strict=True)) for one in (row, stddev))
        posture = row[: len(JOINT_NAMES)]
        if body is not None and np.isfinite(palm).any() and np.isfinite(posture).all():
            # A table has the palms in place of their turns about the forearms.
            posed = pose(body, posture)
            arms = zip(turns, (1.0, -1.0), (posed.left, posed.right), palm, strict=True)
            for name, sign, arm, normal in arms:
                found[name] = turn_of(in_reference(normal, body), arm.forearm_rotation, sign)
                known[name] = 0.0
        one = make.update(stamp_ns, state, body, found, known, keypoints)
        if one is not None:
            yield one


def at_rate(bodies: Iterable[FullBody], rate_hz: float) -> Iterator[FullBody]:
    """Yield the bodies at even times, between those of the images; all is invalid in gaps."""
    before: FullBody | None = None
    first_ns = number = 0
    for after in bodies:
        if before is None:
            first_ns, before = after.stamp_ns, after
        gap_s = (after.stamp_ns - before.stamp_ns) / 1e9
        end_ns = min(after.stamp_ns, before.stamp_ns + round(_LONGEST_GAP_S * 1e9))
        while (time_ns := first_ns + round(number * 1e9 / rate_hz)) < end_ns:
            is_near = gap_s <= _LONGEST_S
            yield before.until(after, time_ns) if is_near else before.invalid(time_ns)
            number += 1
        number = max(number, math.ceil((after.stamp_ns - first_ns) * rate_hz / 1e9))
        before = after
    if before is not None:
        yield before
