"""Computes RULA scores of postures: angles give scores of the parts, tables combine these.

The parts are scored as in the figures of the paper (:mod:`.tables` names it):

- upper arm: angle from hanging along the trunk, in any direction: 1 to 20
degrees, 2 to 45 and for more than 20 backwards, 3 to 90, 4 beyond; abducted adds 1;
- lower arm: 1 for 60 to 100 degrees between it and the line of the upper arm, else 2; a hand beyond
  the middle of the body, or a forearm that points outside, adds 1;
- neck: 1 to 10 degrees of flexion against the trunk, 2 to 20, 3 beyond, 4 in extension; twisted
  adds 1;
- trunk: 1 upright, 2 to 20 degrees, 3 to 60, 4 beyond, forwards or backwards; bent aside adds 1.

Wrists, legs, twist of the trunk, load and muscle use come from the settings, and the neck where its
angles are not known. A neck that bends aside is not measured.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.parts import body_parts
from cardbox_tracker.body.posture import LEFT_ARM, PITCH, RIGHT_ARM, ROLL
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.body.skeleton import arm_directions
from cardbox_tracker.ergonomics.config import RulaConfig
from cardbox_tracker.ergonomics.tables import TABLE_A, TABLE_B, TABLE_C, ScoreArray

BoolArray = NDArray[np.bool_]


class ArmScores(NamedTuple):
    """Scores (...) of one arm: its parts, ``TABLE_A``, and the grand score with this arm."""

    upper_arm: ScoreArray
    lower_arm: ScoreArray
    table_a: ScoreArray
    grand: ScoreArray


class RulaScores(NamedTuple):
    """Scores (...) of both arms and the trunk; ``grand`` is that of the worse arm, 1 to 7.

    ``neck`` is that of the settings if the angles of the neck are not known. ``table_b`` is the
    score of neck, trunk and legs without load and muscle use.
    """

    left: ArmScores
    right: ArmScores
    trunk: ScoreArray
    grand: ScoreArray
    neck: ScoreArray
    table_b: ScoreArray


def rula_scores(
    body: BodyModel, postures: FloatArray, config: RulaConfig, necks: FloatArray | None = None
) -> RulaScores:
    """Return the scores of postures of ``body``.

    Args:
        body: the person.
        postures: shape (..., 12), rad and metres.
        config: settings.
        necks: ``neck_yaw`` and ``neck_pitch`` of each posture, (..., 2), rad; None if unknown.
    """
    d = np.asarray(postures, dtype=np.float64)
    trunk = trunk_score(d[..., PITCH], d[..., ROLL], config)
    neck = np.full(trunk.shape, config.neck)
    if necks is not None:
        neck = neck_score(necks[..., 0], necks[..., 1], config)
    table_b = TABLE_B[neck - 1, trunk - 1, config.legs - 1]
    rest = table_b + config.body_muscle_use + config.body_load
    left, right = (
        _arm(body, d[..., joints], side, rest, config)
        for joints, side in ((LEFT_ARM, 1.0), (RIGHT_ARM, -1.0))
    )
    return RulaScores(left, right, trunk, np.maximum(left.grand, right.grand), neck, table_b)


def grand_score(arm: ScoreArray, rest: ScoreArray) -> ScoreArray:
    """Look up table C with the scores of arm and wrist, and of neck, trunk and legs."""
    found: ScoreArray = TABLE_C[np.minimum(arm, 8) - 1, np.minimum(rest, 7) - 1]
    return found


def neck_score(yaw_rad: FloatArray, pitch_rad: FloatArray, config: RulaConfig) -> ScoreArray:
    """Return the score of necks turned by ``yaw_rad`` and bent forwards by ``pitch_rad``."""
    pitch_deg = np.degrees(pitch_rad)
    score = 1 + (pitch_deg > 10.0).astype(np.int64) + (pitch_deg > 20.0)
    score = np.where(pitch_deg < -config.neck_extended_deg, 4, score)
    twisted: ScoreArray = score + (np.abs(np.degrees(yaw_rad)) > config.neck_twisted_deg)
    return twisted


def trunk_score(flexion_rad: FloatArray, bend_rad: FloatArray, config: RulaConfig) -> ScoreArray:
    """Return the score of trunks bowed by ``flexion_rad`` and bent aside by ``bend_rad``."""
    score = _step(np.abs(np.degrees(flexion_rad)), config.upright_deg, 20.0, 60.0)
    is_bent = np.abs(np.degrees(bend_rad)) > config.side_bent_deg
    return score + is_bent + config.trunk_twisted


def upper_arm_score(direction: FloatArray, side: float, config: RulaConfig) -> ScoreArray:
    """Return the score of upper arms along the unit vectors (..., 3) in the trunk's frame.

    Args:
        direction: X forwards, Y to the left, Z up along the trunk.
        side: +1 for the left arm, -1 for the right.
        config: settings.
    """
    x, outwards = direction[..., 0], side * direction[..., 1]
    raised_deg = np.degrees(np.arccos(np.clip(-direction[..., 2], -1.0, 1.0)))
    score = _step(raised_deg, 20.0, 45.0, 90.0)
    is_backwards = (-x > np.abs(outwards)) & (raised_deg > 20.0)
    score = np.where(is_backwards, 2, score)
    score = score + (_aside_deg(outwards) > config.abducted_deg)
    score = score + config.shoulders_raised - config.arms_supported
    return np.clip(score, 1, 6)


def lower_arm_score(
    bend_rad: FloatArray, outwards: FloatArray, is_across: BoolArray, config: RulaConfig
) -> ScoreArray:
    """Return the score of lower arms (...).

    Args:
        bend_rad: angle of the elbow, 0 for a straight arm.
        outwards: component of its unit vector away from the body's middle, -1 to 1.
        is_across: whether the hand is beyond that middle.
        config: settings.
    """
    bend_deg = np.degrees(bend_rad)
    score = np.where((bend_deg >= 60.0) & (bend_deg <= 100.0), 1, 2)
    is_away = is_across | (_aside_deg(outwards) > config.outwards_deg)
    return score + is_away.astype(np.int64)


def _arm(
    body: BodyModel, angles: FloatArray, side: float, rest: ScoreArray, config: RulaConfig
) -> ArmScores:
    upper, fore = arm_directions(angles, side)
    parts = body_parts(body.sizes)
    hand_m = side * parts.shoulder_aside_m + (
        parts.upper_arm.height_m * upper[..., 1] + parts.forearm.height_m * fore[..., 1]
    )
    bend = np.arccos(np.clip((upper * fore).sum(axis=-1), -1.0, 1.0))
    upper_arm = upper_arm_score(upper, side, config)
    lower_arm = lower_arm_score(bend, side * fore[..., 1], side * hand_m < 0.0, config)
    table_a = TABLE_A[upper_arm - 1, lower_arm - 1, config.wrist - 1, config.wrist_twist - 1]
    arm = table_a + config.arm_muscle_use + config.arm_load
    return ArmScores(upper_arm, lower_arm, table_a, grand_score(arm, rest))


def _step(angle_deg: FloatArray, first: float, second: float, third: float) -> ScoreArray:
    """Return 1 up to the first limit, 2 up to the second, 3 up to the third, 4 beyond."""
    return 1 + (angle_deg > first).astype(np.int64) + (angle_deg > second) + (angle_deg > third)


def _aside_deg(outwards: FloatArray) -> FloatArray:
    """Return the angle between a unit vector and the plane of the body's middle, degrees."""
    angle: FloatArray = np.degrees(np.arcsin(np.clip(outwards, -1.0, 1.0)))
    return angle
