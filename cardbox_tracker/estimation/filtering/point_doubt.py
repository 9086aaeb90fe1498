"""Doubt about a result from the points of a detector.

A hand or elbow far from its point is wrong, with any number of cameras. In one camera, the depth of
a person who was not measured is estimated from the lengths of the bones. Whether a hand is wrong by
more than 30 cm is then a logistic regression of four features, fitted to simulated people of whom
stature and distance were stated (``learning/simulated_doubt.py`` of commit 58f0437). Wrong and
right images weighed alike, so the chance is that among as many of both. ``docs/research/points.md``
has figures.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp
from typing import Any

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.detection.image_points import ImagePoints
from cardbox_tracker.estimation.cost.joint_points import JointPointsObservation, projected
from cardbox_tracker.estimation.cost.joint_points_kernels import (
    ELBOW,
    KNUCKLES,
    POINTS_OF_ARM,
    WRIST,
)
from cardbox_tracker.estimation.cost.multi_view import MultiViewCost
from cardbox_tracker.estimation.cost.terms import Posed

FEATURES = ("hand_depth_m", "upper_arm_depth", "distance_to_point_m", "distance_m")
"""Largest difference of a hand's depth from the detector's; largest component of an upper arm along
the line of sight, as a fraction; largest distance of an elbow, wrist or hand from its point at the
person's depth; distance of the person."""
INTERCEPT = -1.19
COEFFICIENTS = (15.24, 2.71, -5.77, -0.78)
UNCERTAIN_FROM = 0.2
"""Chance above which a result of one camera is uncertain."""
FAR_M = 0.15
"""Distance of a point from its joint that makes any result uncertain."""

_LIMBS = [POINTS_OF_ARM * arm + joint for arm in (0, 1) for joint in (ELBOW, WRIST, KNUCKLES)]
_LEAST_SCORE, _SHARE = 0.5, 0.5
_MISSING_FRAMES = 30


def shows_person(points: ImagePoints | None) -> bool:
    """Return whether there are points, most of which are certain."""
    return points is not None and are_certain(points.scores)


def are_certain(scores: FloatArray) -> bool:
    """Return whether at least half of the scores (N,) are those of certain points."""
    return float(np.mean(scores >= _LEAST_SCORE)) >= _SHARE


class PointDoubt:
    """Doubt about results of one person from the points of all cameras."""

    def __init__(self, cost: MultiViewCost) -> None:
        """Prepare for the cameras of ``cost``."""
        self._cost, self._missing = cost, _MISSING_FRAMES

    def confirms(self, state: FloatArray, cues: Sequence[tuple[int, Any]]) -> bool:
        """Return whether a result, state (14,), agrees with certain points in this frame."""
        is_certain = any(are_certain(cue.seen[0][:, 2]) for _, cue in cues)
        return is_certain and self._farthest_m(state, cues) <= FAR_M

    def is_doubtful(self, state: FloatArray, cues: Sequence[tuple[int, Any]]) -> bool:
        """Return whether a result, state (14,), is uncertain."""
        cost = self._cost
        self._missing = 0 if cues else self._missing + 1
        is_measured = cost.costs[0].is_measured
        if not cues:
            leading = self._missing < _MISSING_FRAMES and not is_measured
            return leading and len(cost.seeing) == 1
        farthest_m = self._farthest_m(state, cues)
        if farthest_m > FAR_M or any(cue.shows_back for _, cue in cues):
            return True
        if is_measured or len(cost.seeing) > 1 or [number for number, _ in cues] != [0]:
            return False
        features = features_of(cost.keypoints(state), cues[0][1], farthest_m)
        return chance_of_error(features) > UNCERTAIN_FROM

    def _farthest_m(self, state: FloatArray, cues: Sequence[tuple[int, Any]]) -> float:
        """Return the largest distance of a limb's joint from its point, m, at its depth."""
        farthest_m = 0.0
        for number, cue in cues:
            there = self._cost.to_views[number](state)
            body = self._cost.costs[number].body
            pixels, points = projected(Posed(body, there[None])), cue.seen[0]
            for joint in _LIMBS:
                if points[joint, 2] >= _LEAST_SCORE:
                    away_px = float(np.hypot(*(points[joint, :2] - pixels[joint, :2])))
                    farthest_m = max(farthest_m, away_px * float(pixels[joint, 2]) / body[4][0])
        return farthest_m


def features_of(
    keypoints_m: FloatArray, observation: JointPointsObservation, farthest_m: float
) -> FloatArray:
    """Return ``FEATURES`` of a result, (4,).

    Args:
        keypoints_m: keypoints (6, 3) of the result, metres in the optical frame.
        observation: points of the first camera.
        farthest_m: see :func:`distance_to_points`.
    """
    _, _, bones, away = observation.seen
    hand_m, upper_arm = 0.0, 0.0
    for arm in (0, 1):
        shoulder, elbow, hand = keypoints_m[3 * arm : 3 * arm + 3]
        off_m = 0.0
        for number, bone in enumerate((elbow - shoulder, hand - elbow)):
            length, depth = float(np.linalg.norm(bone)), float(bone @ away)
            if number == 0:
                upper_arm = max(upper_arm, abs(float(bone[2])) / max(length, 1e-6))
            if bones[2 * arm + number, 1] > 0.0:
                off_m += depth - length * float(bones[2 * arm + number, 0])
                hand_m = max(hand_m, abs(off_m))
    distance_m = float(np.linalg.norm(keypoints_m[[0, 3]].mean(axis=0)))
    return np.array([hand_m, upper_arm, farthest_m, distance_m])


def chance_of_error(features: FloatArray) -> float:
    """Return the chance that a hand is wrong by more than 30 cm, among as many right ones."""
    logit = INTERCEPT + float(np.dot(COEFFICIENTS, features))
    return 1.0 / (1.0 + exp(-min(max(logit, -50.0), 50.0)))
