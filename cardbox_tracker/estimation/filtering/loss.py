"""How far to believe a whole-body estimate: the chance that it is wrong, and deviations.

The chance is a logistic regression on 37,518 frames of 22 recorded sessions with three seeds; in
1.8 % of them the keypoints are wrong by more than 30 cm on average. Wrong and right frames weigh
alike: above 0.5 a frame looks more like the wrong ones. With the coefficients fitted to the other
21 sessions, 78 % of the wrong frames of a session and 12 % of all its frames are above 0.6.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import exp, log
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from cardbox_tracker.body.posture import PITCH, TORSO_X, YAW
from cardbox_tracker.body.sizes import FloatArray


class Evidence(NamedTuple):
    """Evidence that a result is right or wrong; shares are of the silhouette's pixels.

    Attributes:
        residual: share in which model and silhouette differ.
        left_over: silhouette beside the model, as a share.
        outside: model beside the silhouette, as a share.
        area: pixels of the silhouette over those of the model in the front posture.
        prior: what the priors cost the best state.
        arm_m: mean deviation of elbows and hands in the torso's frame, m.
        stddev: deviations of the states, weighted by fit, (14,).
        mean: their mean, (14,).
        age: frames since the search began.
    """

    residual: float
    left_over: float
    outside: float
    area: float
    prior: float
    arm_m: float
    stddev: FloatArray
    mean: FloatArray
    age: int


INTERCEPT = -3.936
COEFFICIENTS: Mapping[str, float] = MappingProxyType(
    {
        "residual": 2.574,
        "left_over": 8.733,
        "outside": -2.048,
        "log_area": -1.448,
        "log_area_size": 1.815,
        "prior": 10.544,
        "arm_m": 25.654,
        "torso_x_stddev": 49.456,
        "yaw_size": 2.136,
        "pitch_size": -0.205,
        "freshness": 0.323,
    }
)
"""Of the logistic regression, by the names that :func:`features_of_loss` returns in this order."""
_AREA_LIMITS = (0.1, 3.0)
_PRIOR_LIMITS = (-0.2, 0.3)
_FRESH_FRAMES = 15.0
# Share of the chance before in the one that is judged.
_MEMORY = 0.5

# Deviations of the states tell how far a joint can move before the fit becomes worse, not how wrong
# model and silhouette are: they are too small by these factors, and have a floor. Of the angles'
# errors on five recorded sessions with motion capture 92 % (arms) to 95 % (torso) are below two
# deviations.
_PLACE_GAIN, _PLACE_FLOOR_M = 2.0, 0.02
_TORSO_GAIN, _ROLL_FLOOR_RAD, _PITCH_YAW_FLOOR_RAD = 2.0, 0.06, 0.15
_ARM_GAIN, _ARM_FLOOR_RAD = 3.0, 0.20
_GAINS = np.array([_PLACE_GAIN, *[_TORSO_GAIN] * 3, *[_ARM_GAIN] * 8, *[_PLACE_GAIN] * 2])
_FLOORS = np.array(
    [
        *(_PLACE_FLOOR_M, _ROLL_FLOOR_RAD, _PITCH_YAW_FLOOR_RAD, _PITCH_YAW_FLOOR_RAD),
        *[_ARM_FLOOR_RAD] * 8,
        *(_PLACE_FLOOR_M, _PLACE_FLOOR_M),
    ]
)


def evidence_of(
    silhouette_px: int,
    frontal_px: int,
    cost_px: float,
    area_px: float,
    rating: float,
    arm_m: float,
    stddev: FloatArray,
    mean: FloatArray,
    age: int,
) -> Evidence:
    """Return the evidence that the pixels of silhouette and mean give, and the best ``rating``.

    Args:
        silhouette_px: pixels of the silhouette.
        frontal_px: those of the model in the front posture.
        cost_px: those in which the mean and the silhouette differ.
        area_px: those of the mean.
        rating: of the best state.
        arm_m: see :class:`Evidence`, as for the rest.
        stddev: deviations, (14,).
        mean: mean state, (14,).
        age: frames.
    """
    common = 0.5 * (silhouette_px + area_px - cost_px)
    # Of somebody at the border nothing may be left above the hips.
    silhouette_px = max(silhouette_px, 1)
    residual = cost_px / silhouette_px
    return Evidence(
        residual=residual,
        left_over=(silhouette_px - common) / silhouette_px,
        outside=(area_px - common) / silhouette_px,
        area=silhouette_px / frontal_px,
        prior=rating - residual,
        arm_m=arm_m,
        stddev=stddev,
        mean=mean,
        age=age,
    )


def log_area(evidence: Evidence) -> float:
    """Return the logarithm of the area, which counts between a tenth and three."""
    return log(min(max(evidence.area, _AREA_LIMITS[0]), _AREA_LIMITS[1]))


def freshness(evidence: Evidence) -> float:
    """Return how fresh a search is: 1 in its first frame, 1/e after 15 frames."""
    return exp(-evidence.age / _FRESH_FRAMES)


def features_of_loss(evidence: Evidence) -> dict[str, float]:
    """Return the features of the logistic regression by name, in the order of the coefficients."""
    area = log_area(evidence)
    return {
        "residual": evidence.residual,
        "left_over": evidence.left_over,
        "outside": evidence.outside,
        "log_area": area,
        "log_area_size": abs(area),
        "prior": min(max(evidence.prior, _PRIOR_LIMITS[0]), _PRIOR_LIMITS[1]),
        "arm_m": evidence.arm_m,
        "torso_x_stddev": float(evidence.stddev[TORSO_X]),
        "yaw_size": abs(float(evidence.mean[YAW])),
        "pitch_size": abs(float(evidence.mean[PITCH])),
        "freshness": freshness(evidence),
    }


def chance_of_loss(evidence: Evidence) -> float:
    """Return the chance, 0 to 1, that the keypoints are wrong by more than 30 cm on average."""
    logit = INTERCEPT
    for name, value in features_of_loss(evidence).items():
        logit += COEFFICIENTS[name] * value
    return 1.0 / (1.0 + exp(-logit))


def remembered(chance: float, before: float | None) -> float:
    """Return the chance that is judged: half of it is that of the frame before."""
    return chance if before is None else _MEMORY * before + (1.0 - _MEMORY) * chance


def state_stddev(stddev: FloatArray) -> FloatArray:
    """Return calibrated deviations (14,) from those of the states (14,)."""
    calibrated: FloatArray = np.hypot(_GAINS * stddev, _FLOORS)
    return calibrated


def calibrated_deviations(deviations: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return deviations (n, 14) from a result, as far apart as :func:`state_stddev` says.

    Args:
        deviations: of states drawn by their weights from the mean, (n, 14).
        rng: source of what the floors add.
    """
    calibrated: FloatArray = _GAINS * deviations + _FLOORS * rng.standard_normal(deviations.shape)
    return calibrated
