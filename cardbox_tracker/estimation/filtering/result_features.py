"""Features of a result for the networks: one arm, as if it were the left one, and the torso."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from cardbox_tracker.body.posture import N_STATE, YAW
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.compiling import njit

_OTHER_ARM = np.array([0, 1, 2, 3, 8, 9, 10, 11, 4, 5, 6, 7, 12, 13])
_MIRROR = np.array([-1.0, -1.0, 1.0, -1.0, *[1.0] * 10])
_OTHER_POINTS = np.array([3, 4, 5, 0, 1, 2])
# Of each bone of both arms: where it begins and ends among the keypoints.
_BEGIN, _END = np.array([0, 1, 3, 4]), np.array([1, 2, 4, 5])
_HAND = 2
# First columns of the features: unit vectors of four bones, the hand beside the middle of the
# shoulders, both squared, how far aside the hand is, the state and its deviations.
BONES, BONE_SQUARES, HAND, HAND_SQUARES, HAND_ASIDE = 0, 12, 24, 27, 30
STATE, STDDEV = 31, 31 + N_STATE
# The other columns.
IOU = STDDEV + N_STATE
YAW_SIZE, PITCH, ASIDE, AHEAD, SLANTING, IS_MEASURED, HAS_DEPTH = range(IOU + 1, IOU + 8)
FEATURES = HAS_DEPTH + 1
OF_CAMERAS = slice(ASIDE, FEATURES)
"""Columns that hardly ever change: what the cameras show, and whether the body was measured."""


class Viewpoints(NamedTuple):
    """How a person was seen, and how well known the body is.

    A camera shows what lies across its line of sight, so the squares of the lines' directions,
    summed over the cameras that see, say what is shown of all directions on the floor.

    Attributes:
        pitch_rad: how far the first camera looks down.
        aside: how much is shown of what is aside, as the first camera sees it: 1 of it alone.
        ahead: the same of depth: 0 of the first camera alone.
        slanting: the product of both; its sign is the side of a further camera.
        is_measured: the body was measured, not guessed from proportions.
        has_depth: a single camera has a depth image, too.
    """

    pitch_rad: float
    aside: float
    ahead: float
    slanting: float
    is_measured: bool
    has_depth: bool = False

    @classmethod
    def of(cls, pitch_rad: float, yaws_rad: Sequence[float], is_measured: bool) -> Viewpoints:
        """Return that of cameras turned by ``yaws_rad`` about the vertical: 0 is the first one."""
        lines = [(cos(yaw_rad), sin(yaw_rad)) for yaw_rad in yaws_rad]
        return cls(
            pitch_rad,
            sum(c * c for c, _ in lines),
            sum(s * s for _, s in lines),
            sum(c * s for c, s in lines),
            is_measured,
        )


def features_of(
    states: FloatArray,
    stddevs: FloatArray,
    keypoints_m: FloatArray,
    ious: FloatArray,
    viewpoints: Viewpoints,
) -> FloatArray:
    """Return what a network sees, (n, 2, F): the left arm, and the right one mirrored.

    Args:
        states: results of the filter, (n, 14).
        stddevs: their deviations, (n, 14).
        keypoints_m: (n, 6, 3), metres in the optical frame.
        ious: of model and silhouette, (n,).
        viewpoints: of all of them.
    """
    features = np.empty((len(states), 2, FEATURES))
    _fill(states, stddevs, keypoints_m, ious, *viewpoints, features)
    return features


@njit(cache=True, nogil=True, error_model="numpy")
def _fill(
    states: Any,
    stddevs: Any,
    keypoints_m: Any,
    ious: Any,
    pitch_rad: float,
    aside: float,
    ahead: float,
    slanting: float,
    is_measured: bool,
    has_depth: bool,
    features: Any,
) -> None:
    """Write :func:`features_of` to ``features``."""
    for n in range(len(states)):
        for arm in range(2):
            row = features[n, arm]
            sideways = -1.0 if arm else 1.0
            for bone in range(4):
                begin, end = _BEGIN[bone], _END[bone]
                if arm:
                    begin, end = _OTHER_POINTS[begin], _OTHER_POINTS[end]
                x, y, z = keypoints_m[n, end] - keypoints_m[n, begin]
                length = sqrt(x * x + y * y + z * z)
                for axis, value in enumerate((sideways * x / length, y / length, z / length)):
                    row[BONES + 3 * bone + axis] = value
                    row[BONE_SQUARES + 3 * bone + axis] = value * value
            hand = _OTHER_POINTS[_HAND] if arm else _HAND
            for axis in range(3):
                middle = 0.5 * (keypoints_m[n, 0, axis] + keypoints_m[n, 3, axis])
                value = keypoints_m[n, hand, axis] - middle
                row[HAND + axis] = sideways * value if axis == 0 else value
                row[HAND_SQUARES + axis] = value * value
            row[HAND_ASIDE] = abs(row[HAND])
            for i in range(N_STATE):
                if arm:
                    row[STATE + i] = states[n, _OTHER_ARM[i]] * _MIRROR[i]
                    row[STDDEV + i] = stddevs[n, _OTHER_ARM[i]]
                else:
                    row[STATE + i], row[STDDEV + i] = states[n, i], stddevs[n, i]
            row[IOU] = ious[n]
            row[YAW_SIZE] = abs(states[n, YAW])
            row[PITCH] = pitch_rad
            row[ASIDE] = aside
            row[AHEAD] = ahead
            row[SLANTING] = sideways * slanting
            row[IS_MEASURED] = is_measured
            row[HAS_DEPTH] = has_depth
