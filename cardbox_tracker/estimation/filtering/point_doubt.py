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

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.detection.image_points import ImagePoints
from cardbox_tracker.estimation.cost.joint_points import JointPointsObservation
from cardbox_tracker.estimation.cost.joint_points_kernels import (
    ELBOW,
    KNUCKLES,
    N_POINTS,
    POINTS_OF_ARM,
    WRIST,
    project,
)

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


def shows_person(points: ImagePoints | None) -> bool:
    """Return whether there are points, most of which are certain."""
    return points is not None and are_certain(points.scores)


def are_certain(scores: FloatArray) -> bool:
    """Return whether at least half of the scores (N,) are those of certain points."""
    return float(np.mean(scores >= _LEAST_SCORE)) >= _SHARE


def distance_to_points(
    states: Sequence[FloatArray], observations: Sequence[JointPointsObservation]
) -> float:
    """Return the largest distance of a limb's joint from its point, m, at the person's depth.

    Args:
        states: the state (14,) in the frame of each camera that has points.
        observations: points of these cameras.
    """
    farthest_m = 0.0
    for state, observation in zip(states, observations, strict=True):
        pixels = np.empty((N_POINTS, 3))
        project(np.ascontiguousarray(state), observation.body, pixels)
        points, focal_px = observation.evidence[0], observation.body[4][0]
        certain = [joint for joint in _LIMBS if points[joint, 2] >= _LEAST_SCORE]
        for joint in certain:
            away_px = float(np.hypot(*(points[joint, :2] - pixels[joint, :2])))
            farthest_m = max(farthest_m, away_px * float(pixels[joint, 2]) / focal_px)
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
    _, _, bones, away = observation.evidence
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
