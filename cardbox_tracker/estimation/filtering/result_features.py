"""Features of a result for the networks: torso and one arm, mirrored if it is the right one."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from cardbox_tracker.body.posture import MIRROR_SIGNS, MIRRORED, N_STATE, YAW
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.compiling import kernel

_OTHER_POINTS = np.array([3, 4, 5, 0, 1, 2])
# Keypoints at begin and end of each bone of both arms.
_BEGIN, _END = np.array([0, 1, 3, 4]), np.array([1, 2, 4, 5])
_HAND = 2
# First columns: unit vectors of four bones and their squares; hand relative to the middle of the
# shoulders, its squares, its absolute lateral distance; state and deviations.
BONES, BONE_SQUARES, HAND, HAND_SQUARES, HAND_ASIDE = 0, 12, 24, 27, 30
STATE, STDDEV = 31, 31 + N_STATE
# The other columns.
IOU = STDDEV + N_STATE
YAW_SIZE, PITCH, ASIDE, AHEAD, SLANTING, IS_MEASURED, HAS_DEPTH = range(IOU + 1, IOU + 8)
FEATURES = HAS_DEPTH + 1
# Largest mean squared sine of angles between directions that count as the same: 18 degrees of two.
_SAME_DIRECTION = 0.05
OF_CAMERAS = slice(ASIDE, FEATURES)
"""Columns that hardly change over time: directions of the cameras, and quality of the body."""


class Viewpoints(NamedTuple):
    """Directions of the cameras, and quality of the body model.

    A camera measures positions across its line of sight. The sum of the outer products of these
    level directions over the cameras describes how well each level direction is measured.

    Attributes:
        pitch_rad: pitch of the first camera, rad, positive downwards.
        aside: element of this sum for the first camera's lateral direction; 1 with one camera.
        ahead: element for the first camera's depth; 0 with one camera.
        slanting: off-diagonal element; its sign is the side of a further camera.
        is_measured: whether the body was measured, not estimated from proportions.
        has_depth: whether a single camera also has a depth image.
    """

    pitch_rad: float
    aside: float
    ahead: float
    slanting: float
    is_measured: bool
    has_depth: bool = False

    @classmethod
    def of(cls, pitch_rad: float, yaws_rad: Sequence[float], is_measured: bool) -> Viewpoints:
        """Return the viewpoints of cameras with these yaws about the vertical; the first has 0."""
        lines = [(cos(yaw_rad), sin(yaw_rad)) for yaw_rad in yaws_rad]
        return cls(
            pitch_rad,
            sum(c * c for c, _ in lines),
            sum(s * s for _, s in lines),
            sum(c * s for c, s in lines),
            is_measured,
        )

    @property
    def see_depth(self) -> bool:
        """Whether the cameras look from so different directions that outlines show the depth."""
        return self.ahead > _SAME_DIRECTION * (self.aside + self.ahead)

    def as_one(self) -> Viewpoints:
        """Return the viewpoint of the first camera alone."""
        return self._replace(aside=1.0, ahead=0.0, slanting=0.0)


def features_of(
    states: FloatArray,
    stddevs: FloatArray,
    keypoints_m: FloatArray,
    ious: FloatArray,
    viewpoints: Viewpoints,
) -> FloatArray:
    """Return the features (n, 2, F) for the left arm and the mirrored right arm.

    Args:
        states: results of the filter, (n, 14).
        stddevs: standard deviations of the states, (n, 14).
        keypoints_m: keypoints of the states, (n, 6, 3), metres in the optical frame.
        ious: intersections over union of model and silhouette, (n,).
        viewpoints: viewpoints of all results.
    """
    features = np.empty((len(states), 2, FEATURES))
    _fill(states, stddevs, keypoints_m, ious, tuple(viewpoints), features)
    return features


@kernel
def _fill(
    states: Any,
    stddevs: Any,
    keypoints_m: Any,
    ious: Any,
    viewpoints: tuple[Any, ...],
    features: Any,
) -> None:
    """Write :func:`features_of` to ``features``."""
    pitch_rad, aside, ahead, slanting, is_measured, has_depth = viewpoints
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
                    row[STATE + i] = states[n, MIRRORED[i]] * MIRROR_SIGNS[i]
                    row[STDDEV + i] = stddevs[n, MIRRORED[i]]
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
