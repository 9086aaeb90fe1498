"""How far to believe a whole-body estimate: the chance that it is wrong, and deviations.

The chance is a logistic regression on 37,518 frames of 22 recorded sessions with three seeds; in
1.8 % of them the keypoints are wrong by more than 30 cm on average. Wrong and right frames weigh
alike, so 0.5 is where a frame is as typical of either. With the coefficients fitted to the other 21
sessions, 78 % of the wrong frames of a session and 12 % of all its frames are above 0.6.
"""

from __future__ import annotations

from math import exp, log
from typing import NamedTuple

import numpy as np

from cardbox_tracker.body.posture import PITCH, TORSO_X, YAW
from cardbox_tracker.body.sizes import FloatArray


class Evidence(NamedTuple):
    """What the search of one frame tells about its result; shares are of the silhouette's pixels.

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


_INTERCEPT = -3.936
# What each adds to the logit; between these the area and the prior count.
AREA_LIMITS = (0.1, 3.0)
_PRIOR_LIMITS = (-0.2, 0.3)
FRESH_FRAMES = 15.0
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


def chance_of_loss(evidence: Evidence) -> float:
    """Return the chance, 0 to 1, that the keypoints are wrong by more than 30 cm on average."""
    log_area = log(min(max(evidence.area, AREA_LIMITS[0]), AREA_LIMITS[1]))
    logit = (
        _INTERCEPT
        + 2.574 * evidence.residual
        + 8.733 * evidence.left_over
        - 2.048 * evidence.outside
        - 1.448 * log_area
        + 1.815 * abs(log_area)
        + 10.544 * min(max(evidence.prior, _PRIOR_LIMITS[0]), _PRIOR_LIMITS[1])
        + 25.654 * evidence.arm_m
        + 49.456 * float(evidence.stddev[TORSO_X])
        + 2.136 * abs(float(evidence.mean[YAW]))
        - 0.205 * abs(float(evidence.mean[PITCH]))
        + 0.323 * exp(-evidence.age / FRESH_FRAMES)
    )
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
