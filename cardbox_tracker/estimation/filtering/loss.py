"""Confidence of a whole-body estimate: probability of loss, and calibrated deviations.

An estimate is lost if its keypoints are wrong by more than 30 cm on average. The probability is a
logistic regression on recorded sessions with ground truth, in which lost and other frames have the
same total weight (``learning/loss.py`` of commit 58f0437).
"""

from __future__ import annotations

from collections.abc import Mapping
from math import exp, log
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from cardbox_tracker.body.posture import (
    LEFT_ARM,
    N_STATE,
    PITCH,
    RIGHT_ARM,
    ROLL,
    TORSO_X,
    TURNS,
    YAW,
)
from cardbox_tracker.body.sizes import FloatArray


class Evidence(NamedTuple):
    """Evidence for or against a result; numbers of pixels are divided by the silhouette's.

    Attributes:
        residual: pixels in which model and silhouette differ.
        left_over: pixels of the silhouette that the model does not cover.
        outside: pixels of the model outside of the silhouette.
        area: pixels of the silhouette divided by those of the model in the front posture.
        prior: cost of the best state by the priors.
        arm_m: mean deviation of elbows and hands in the torso's frame, m.
        stddev: standard deviations of the weighted states, (14,).
        mean: mean of the best states, (14,).
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


class Pixels(NamedTuple):
    """Numbers of pixels.

    Attributes:
        silhouette: pixels of the silhouette.
        frontal: pixels of the model in the front posture.
        differing: pixels in which the model in the mean state and the silhouette differ.
        mean: pixels of the model in the mean state.
    """

    silhouette: int
    frontal: int
    differing: float
    mean: float


UNCERTAIN_FROM, LOST_FROM = 0.55, 0.95
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
"""Coefficients of the logistic regression by feature, in the order of :func:`features_of_loss`."""
_COEFFICIENTS = tuple(COEFFICIENTS.values())
_AREA_LIMITS = (0.1, 3.0)
_PRIOR_LIMITS = (-0.2, 0.3)
_FRESH_FRAMES = 15.0
# Weight of the previous probability in the smoothed one.
_MEMORY = 0.5

# Deviations of the states do not include errors of model and silhouette. These factors and floors,
# chosen on motion capture, make two deviations cover about 95 % of the errors.
_PLACE_GAIN, _PLACE_FLOOR_M = 2.0, 0.02
_TORSO_GAIN, _ROLL_FLOOR_RAD, _PITCH_YAW_FLOOR_RAD = 2.0, 0.06, 0.15
_ARM_GAIN, _ARM_FLOOR_RAD = 3.0, 0.20
_GAINS, _FLOORS = np.full(N_STATE, _PLACE_GAIN), np.full(N_STATE, _PLACE_FLOOR_M)
_GAINS[TURNS], _FLOORS[TURNS] = _TORSO_GAIN, _PITCH_YAW_FLOOR_RAD
_FLOORS[ROLL] = _ROLL_FLOOR_RAD
for _arm in (LEFT_ARM, RIGHT_ARM):
    _GAINS[_arm], _FLOORS[_arm] = _ARM_GAIN, _ARM_FLOOR_RAD


def evidence_of(
    pixels: Pixels,
    rating: float,
    arm_m: float,
    stddev: FloatArray,
    mean: FloatArray,
    age: int,
) -> Evidence:
    """Return the evidence from numbers of pixels and the search.

    Args:
        pixels: numbers of pixels.
        rating: rating of the best state.
        arm_m: see :class:`Evidence`.
        stddev: see :class:`Evidence`, (14,).
        mean: see :class:`Evidence`, (14,).
        age: see :class:`Evidence`.
    """
    common = 0.5 * (pixels.silhouette + pixels.mean - pixels.differing)
    # A person at the border may have no pixels above the hips.
    silhouette_px = max(pixels.silhouette, 1)
    residual = pixels.differing / silhouette_px
    return Evidence(
        residual=residual,
        left_over=(silhouette_px - common) / silhouette_px,
        outside=(pixels.mean - common) / silhouette_px,
        area=silhouette_px / pixels.frontal,
        prior=rating - residual,
        arm_m=arm_m,
        stddev=stddev,
        mean=mean,
        age=age,
    )


def log_area(evidence: Evidence) -> float:
    """Return the logarithm of the area after clipping to 0.1..3."""
    return log(min(max(evidence.area, _AREA_LIMITS[0]), _AREA_LIMITS[1]))


def freshness(evidence: Evidence) -> float:
    """Return exp(-age / 15): 1 in the first frame of a search, 1/e after 15 frames."""
    return exp(-evidence.age / _FRESH_FRAMES)


def features_of_loss(evidence: Evidence) -> dict[str, float]:
    """Return the features of the logistic regression by name, in the order of the coefficients."""
    return dict(zip(COEFFICIENTS, _values_of(evidence), strict=True))


def _values_of(evidence: Evidence) -> tuple[float, ...]:
    """Return the features in the order of the coefficients."""
    area = log_area(evidence)
    return (
        evidence.residual,
        evidence.left_over,
        evidence.outside,
        area,
        abs(area),
        min(max(evidence.prior, _PRIOR_LIMITS[0]), _PRIOR_LIMITS[1]),
        evidence.arm_m,
        float(evidence.stddev[TORSO_X]),
        abs(float(evidence.mean[YAW])),
        abs(float(evidence.mean[PITCH])),
        freshness(evidence),
    )


def chance_of_loss(evidence: Evidence) -> float:
    """Return the probability that the keypoints are wrong by more than 30 cm on average."""
    logit = INTERCEPT
    for coefficient, value in zip(_COEFFICIENTS, _values_of(evidence), strict=True):
        logit += coefficient * value
    return 1.0 / (1.0 + exp(-logit))


def remembered(chance: float, before: float | None) -> float:
    """Return the smoothed probability: the mean of ``chance`` and the one ``before``."""
    return chance if before is None else _MEMORY * before + (1.0 - _MEMORY) * chance


def state_stddev(stddev: FloatArray) -> FloatArray:
    """Return calibrated standard deviations (14,) from those of the states (14,)."""
    calibrated: FloatArray = np.hypot(_GAINS * stddev, _FLOORS)
    return calibrated


def calibrated_deviations(deviations: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return differences (n, 14) from a result with the deviations of :func:`state_stddev`.

    Args:
        deviations: differences of states, drawn by their weights, from the mean, (n, 14).
        rng: source of the noise that the floors add.
    """
    calibrated: FloatArray = _GAINS * deviations + _FLOORS * rng.standard_normal(deviations.shape)
    return calibrated
