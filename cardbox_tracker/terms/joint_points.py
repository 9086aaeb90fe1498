"""Cost of the distance between the person's joints and the points of a detector.

A silhouette does not show a hand in front of the body; a detector does. The term rates the
projected joints against the points of ``Frame.points``, and, if the detector estimates points in
space, the directions of the bones along the line of sight. Detectors of single images take the
camera for level, so these directions are compared along the horizontal line of sight.

The directions of arms are used only for people who were not measured, that of the line of the
shoulders for all, and that of the trunk if the legs are in the image.

Without new points, the last ones count for up to a second, less and less, because joints may have
moved. Points that fit the last posture only with left and right exchanged are exchanged; if this
lasts, the person has turned the back to the camera. Points far from the last posture belong to
somebody else and are not used, unless this lasts.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.least_squares import Residuals
from cardbox_tracker.common.settings import Settings, setting
from cardbox_tracker.detectors.image_points import CERTAIN, POINT_INDEX, ImagePoints
from cardbox_tracker.person.model import MEASURED, BodyModel
from cardbox_tracker.person.posture import N_STATE
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.terms import joint_points_kernels as kernels
from cardbox_tracker.terms.joint_points_kernels import (
    EARS,
    ELBOW,
    HIPS,
    KNUCKLES,
    N_BONES,
    N_POINTS,
    POINTS_OF_ARM,
    SHOULDER,
    SHOULDERS,
    TRUNK,
    WRIST,
    EvidenceTuple,
)
from cardbox_tracker.terms.term import ARMS, Frame, Posed, Term, TermObservation

# Deviation of a point, m and px; speed of a joint, m/s, which makes older points uncertain.
_JOINT_M = {SHOULDER: 0.025, ELBOW: 0.02, WRIST: 0.02, KNUCKLES: 0.04}
_TRUNK_M = 0.05
_M_PER_S = 0.5
POINT_PX = 1.5
# Bones (upper arm, forearm, shoulders, trunk): deviation of the component along the line of sight,
# and mean difference of the detector's from the true one (docs/research.md). That of the shoulders
# also covers the errors of their curve, see _turned.
_BONE_DEVIATIONS = np.array([0.22, 0.32, 0.22, 0.32, 0.2, 0.12])
_BONE_OFFSETS = np.array([0.06, -0.13, 0.06, -0.13, 0.05, -0.15])
_OLDEST_S = 1.0
# Points belong to somebody else if the median of their distances from the last posture is larger;
# after this number of such frames the last posture is taken to be wrong.
_ELSEWHERE_M, _ELSEWHERE_FRAMES = 0.4, 10
# Left and right are exchanged if this makes the squared distances this much smaller, and they were
# larger than this in the mean.
_EXCHANGED, _EXCHANGED_M = 0.3, 0.1
# A detector that mistakes left for right soon corrects itself; after this time it is right.
_BACK_S = 0.5
# Distance of the shoulders in the image, in lengths of the trunk, that tells front from back.
_BROAD = 0.25

_SIDES = tuple(ARMS)
# Two of the detector's points for each of the ten, which is their middle.
_ENDS = np.array(
    [
        [POINT_INDEX[f"{side}_{name}"] for name in ends]
        for side in _SIDES
        for ends in (
            *((name, name) for name in ("shoulder", "elbow", "wrist")),
            ("index", "little_finger"),
        )
    ]
    + [[POINT_INDEX[f"{side}_{name}"] for side in _SIDES] for name in ("hip", "ear")]
)


@dataclass(frozen=True)
class JointPoints(Settings):
    """Settings of the term; its joints are those of the filter ``whole_body``."""

    weight: float = setting(
        0.012,
        "weight of a squared distance in units of its deviation, as a share of the foreground",
        limits=(0.0, 1.0),
    )

    def build(self, person: BodyModel, camera: Camera) -> Term:
        """Return the term for a person before a working camera."""
        return JointPointsTerm(self, person, camera)


class JointPointsTerm:
    """The term for one person before one camera, which includes the pitch."""

    def __init__(self, config: JointPoints, person: BodyModel, camera: Camera) -> None:
        """Prepare for one person and one camera."""
        self.config, self._camera = config, camera
        self._uses_arms = person.source != MEASURED
        self._elsewhere = 0
        # Time since left and right were first exchanged, s; None if they are not.
        self._exchanged_s: float | None = None
        self._newest_points: ImagePoints | None = None
        self._age_s = 0.0

    def observe(self, frame: Frame) -> TermObservation | None:
        """Return the term's observation; None without points that can be used."""
        points = self._newest(frame)
        if points is None:
            return None
        weight = self.config.weight * max(frame.foreground_px, 1)
        evidence = self._evidence(points, self._age_s)
        is_back = self._exchanged_s is not None and self._exchanged_s >= _BACK_S
        if frame.before is None:
            is_back = _from_behind(evidence[0])
        shows_legs = points.legs is not None and points.legs.are_certain
        return JointPointsObservation(evidence, weight, is_back, shows_legs)

    def _newest(self, frame: Frame) -> ImagePoints | None:
        """Return the newest points of this person, which may be of an earlier frame, if any."""
        self._age_s += frame.interval_s
        if self._exchanged_s is not None:
            self._exchanged_s += frame.interval_s
        before, points = frame.before, frame.points
        if before is None:
            self._newest_points, self._elsewhere, self._exchanged_s = None, 0, None
        if points is not None and not points.is_empty:
            age_s = 0.0
            if points.stamp_ns is not None and frame.stamp_ns is not None:
                age_s = abs(frame.stamp_ns - points.stamp_ns) / 1e9
            if age_s <= _OLDEST_S and before is not None:
                points = self._checked(points, before)
            if age_s <= _OLDEST_S and points is not None:
                self._newest_points, self._age_s = points, age_s
        return self._newest_points if self._age_s <= _OLDEST_S else None

    def _checked(self, points: ImagePoints, before: Posed) -> ImagePoints | None:
        """Return the points, left and right exchanged if necessary; None if not this person's."""
        pixels = projected(before)
        found = points_of(points)
        away_m, other_m = (self._distances(one, pixels) for one in (found, found[_OTHER_SIDE]))
        if not len(away_m):
            return points
        square, other = np.mean(away_m**2), np.mean(other_m**2)
        if square > _EXCHANGED_M**2 and other < _EXCHANGED * square:
            points, away_m = points.exchanged(), other_m
            self._exchanged_s = self._exchanged_s or 0.0
        else:
            self._exchanged_s = None
        self._elsewhere = self._elsewhere + 1 if np.median(away_m) > _ELSEWHERE_M else 0
        return None if 0 < self._elsewhere <= _ELSEWHERE_FRAMES else points

    def _distances(self, found: FloatArray, pixels: FloatArray) -> FloatArray:
        """Return the distances of the known points of (10, 3) from the projected joints, m."""
        known = found[:, 2] > 0.0
        away_px = found[known, :2] - pixels[known, :2]
        depths_m = np.maximum(pixels[known, 2], 0.1)
        distances: FloatArray = np.hypot(*away_px.T) * depths_m / self._camera.fx
        return distances

    def _evidence(self, points: ImagePoints, age_s: float) -> EvidenceTuple:
        found = points_of(points)
        deviations = np.empty((N_POINTS, 2))
        for arm in range(2):
            for joint, metres in _JOINT_M.items():
                deviations[POINTS_OF_ARM * arm + joint] = hypot(metres, age_s * _M_PER_S), POINT_PX
        deviations[[HIPS, EARS]] = hypot(_TRUNK_M, age_s * _M_PER_S), POINT_PX
        bones = np.zeros((N_BONES, 3))
        bones[:, 2] = _BONE_DEVIATIONS * (1.0 + age_s / 0.1)
        away = np.tile([0.0, 0.0, 1.0], (N_BONES, 1))
        shoulders = found[[SHOULDER, POINTS_OF_ARM + SHOULDER]]
        if points.spatial_m is not None and shoulders[:, 2].min() > 0.0:
            bones[:, :2] = bones_of(points.spatial_m, found)
            bones[:, 0] -= _BONE_OFFSETS
            bones[SHOULDERS, 0] = _turned(bones[SHOULDERS, 0])
            if not self._uses_arms:
                bones[:SHOULDERS, :2] = 0.0
            if points.legs is None or not points.legs.are_certain:
                bones[TRUNK, :2] = 0.0
            away[:] = level_sight(self._camera, float(shoulders[:, 0].mean()))
        return found, deviations, bones, away


@dataclass(frozen=True, eq=False)
class JointPointsObservation(TermObservation):
    """The points of one frame."""

    seen: EvidenceTuple  #: fields of :class:`~.joint_points_kernels.Evidence`
    weight_px: float  #: cost of a squared residual of 1, px
    #: whether left and right have been exchanged for long, so that the person faces the other way;
    #: at the start of tracking, whether the points are those of a back.
    shows_back: bool = False
    shows_legs: bool = False  #: whether points of the legs are certain
    locates = True

    def rate(self, posed: Posed) -> FloatArray:
        """Rate hips, ears and shoulders of trunks, and all joints of arms."""
        costs = np.empty(len(posed))
        kernels.rate(posed.states, posed.arms_of, posed.parts, posed.body, self.seen, costs)
        return self.weight_px * costs

    def residuals(self, posed: Posed) -> Residuals:
        """Return the residuals of points and bones in units of their deviations."""
        count = len(posed)
        shape = count, kernels.N_RESIDUALS
        found = np.empty(shape), np.empty((*shape, N_STATE)), np.empty(count)
        kernels.residuals(posed.states, posed.body, self.seen, found)
        return Residuals(*found)

    def evidence(self, posed: Posed) -> dict[str, FloatArray]:
        """Return how the joints of one state differ from the points, see :data:`EVIDENCE`."""
        pixels, points, bones, away = projected(posed), *self.seen[:1], *self.seen[2:]
        focal_px, keypoints_m = posed.body[4][0], posed.keypoints_m[0]
        known = points[:, 2] >= CERTAIN
        away_m = np.linalg.norm(points[:, :2] - pixels[:, :2], axis=1) * pixels[:, 2] / focal_px
        away_m = np.where(known, away_m, 0.0)
        found = {name: np.zeros(6) for name in EVIDENCE}
        found["distance"][:] = float(np.linalg.norm(keypoints_m[[0, 3]].mean(axis=0)))
        for arm in (0, 1):
            first = POINTS_OF_ARM * arm
            hand = [first + WRIST, first + KNUCKLES]
            joints = [first + SHOULDER], [first + ELBOW], hand
            off_m = 0.0
            for k, joint in enumerate(joints):
                at = 3 * arm + k
                found["point distance"][at] = away_m[joint].max()
                found["point missing"][at] = not known[joint].all()
                if k == 0:
                    continue
                bone = keypoints_m[at] - keypoints_m[at - 1]
                length, number = float(np.linalg.norm(bone)), 2 * arm + k - 1
                found["foreshortened"][at] = abs(float(bone[2])) / max(length, 1e-6)
                if bones[number, 1] > 0.0:
                    off_m += float(bone @ away[number]) - length * float(bones[number, 0])
                found["depth difference"][at] = abs(off_m)
            # A hand also has the error of the upper arm.
            found["elbow foreshortened"][3 * arm + 2] = found["foreshortened"][3 * arm + 1]
        return found


EVIDENCE = (
    "point distance",
    "point missing",
    "depth difference",
    "foreshortened",
    "elbow foreshortened",
    "distance",
)
"""Distance of a joint from its point at its depth, m; whether the point is not certain; difference
of its depth from that of the detector, m; component of the bone that ends there, and of the upper
arm, along the line of sight, as a fraction; distance of the person, m."""
# Left and right arms of the points that are compared, exchanged.
_OTHER_SIDE = [*range(POINTS_OF_ARM, 2 * POINTS_OF_ARM), *range(POINTS_OF_ARM), HIPS, EARS]


def projected(posed: Posed) -> FloatArray:
    """Return column, row (px) and depth (m) of the ten joints of the first state, (10, 3)."""
    pixels = np.empty((N_POINTS, 3))
    kernels.project(posed.states[0], posed.body, pixels)
    return pixels


def _turned(away: float) -> float:
    """Return the true component of the line of the shoulders for that of the detector.

    The detector makes it too small: it finds a turn of 35 degrees as one of 22, but one of 80
    degrees as it is.
    """
    away = min(max(away, -1.0), 1.0)
    return away * (3.0 - away**2) / 2.0


def _from_behind(found: FloatArray) -> bool:
    """Return whether :func:`points_of` are those of a back: the left shoulder is on the left."""
    left, right, hips = found[[SHOULDER, POINTS_OF_ARM + SHOULDER, HIPS]]
    trunk_px = float(np.linalg.norm((left + right - 2 * hips)[:2])) / 2
    is_known = min(left[2], right[2], hips[2]) > 0.0
    return bool(is_known and right[0] - left[0] > _BROAD * trunk_px)


def level_sight(camera: Camera, column_px: float) -> FloatArray:
    """Return the horizontal direction to a column of the image, (3,), in the optical frame."""
    bearing = np.arctan2(column_px - camera.cx, camera.fx)
    down, ahead = -np.sin(camera.pitch_rad), np.cos(camera.pitch_rad)
    return np.array([np.sin(bearing), *(np.cos(bearing) * np.array([down, ahead]))])


def points_of(points: ImagePoints) -> FloatArray:
    """Return column, row and score of the ten points that are compared, (10, 3).

    Each arm has four, the left one first: shoulder, elbow, wrist and knuckles. The middle of the
    hips and that of the ears follow. Unknown points have the score 0.
    """
    scores = points.scores[_ENDS].min(axis=1)
    found = np.column_stack([points.px[_ENDS].mean(axis=1), scores])
    found[scores <= 0.0] = 0.0
    return found


def bones_of(spatial_m: FloatArray, found: FloatArray) -> FloatArray:
    """Return component along z as a fraction of the length, and score, of each bone, (6, 2).

    The bones are upper arm and forearm of each arm, the left one first, the line from the right to
    the left shoulder, and that from the middle of the hips to that of the shoulders. ``spatial_m``
    (17, 3) is that of ``ImagePoints``, ``found`` that of :func:`points_of`.
    """

    def at(*names: str) -> FloatArray:
        middle: FloatArray = spatial_m[[POINT_INDEX[name] for name in names]].mean(axis=0)
        return middle

    bones = np.zeros((N_BONES, 2))
    for arm, side in enumerate(_SIDES):
        shoulder, elbow = at(f"{side}_shoulder"), at(f"{side}_elbow")
        hand = at(f"{side}_index", f"{side}_little_finger")
        scores = found[POINTS_OF_ARM * arm : POINTS_OF_ARM * (arm + 1), 2]
        upper_arm, forearm = elbow - shoulder, hand - elbow
        bones[2 * arm] = _depth(upper_arm), min(scores[SHOULDER], scores[ELBOW])
        bones[2 * arm + 1] = _depth(forearm), min(scores[ELBOW], scores[WRIST])
    shoulders = found[SHOULDER, 2], found[POINTS_OF_ARM + SHOULDER, 2]
    bones[SHOULDERS] = _depth(at("left_shoulder") - at("right_shoulder")), min(shoulders)
    trunk = at("left_shoulder", "right_shoulder") - at("left_hip", "right_hip")
    bones[TRUNK] = _depth(trunk), min(*shoulders, found[HIPS, 2])
    bones[~np.isfinite(bones).all(axis=1)] = 0.0
    return bones


def _depth(bone: FloatArray) -> float:
    """Return the component of a vector (3,) along z as a fraction of its length."""
    length = float(np.linalg.norm(bone))
    return float(bone[2]) / length if length > 0.0 else float("nan")
