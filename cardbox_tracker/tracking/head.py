"""Finds how the head turns and nods on the torso from the points of a face in an image.

A silhouette shows the head's place but hardly its direction. A rigid model of the face (nose, eyes
and ears) is fitted to the points of a detector by maximum a posteriori estimation, from several
starts: over yaw, pitch and roll of the neck, the place of the head in the image and its size, with
normal priors. The torso is that of the tracked state, so the angles are those between torso and
head:

    R_head = R_torso Rz(yaw) Ry(pitch) Rx(roll)

The signs are those of the torso's angles: a positive yaw turns the face to the person's left, a
positive pitch lowers it. Both are 0 if the face looks along the torso's forward axis. Only joints
of the skeleton are returned, so the roll is not.
"""

from __future__ import annotations

from dataclasses import replace
from math import cos, exp, sin
from typing import NamedTuple

import numpy as np

from cardbox_tracker.camera.camera import NEAREST_M, Camera
from cardbox_tracker.common.compiling import borrowing_kernel, inlined_kernel, kernel
from cardbox_tracker.common.least_squares import (
    DIFFERENCE,
    ENDS,
    Equations,
    Solution,
    minimize_compiled,
    rules_of,
)
from cardbox_tracker.detectors.image_points import CERTAIN, POINT_INDEX, ImagePoints
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.posture import PITCH, ROLL, YAW
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import NECK_LIMITS
from cardbox_tracker.terms.kernel_arguments import Floats
from cardbox_tracker.terms.term import Frame
from cardbox_tracker.tracking.estimate import KEPT_S, LARGEST_RMS, Estimate

FACE_POINTS = ("nose", "left_eye", "right_eye", "left_ear", "right_ear")
FACE_M: FloatArray = np.array(
    [
        (0.090, 0.0, -0.018),
        (0.060, 0.0315, 0.017),
        (0.060, -0.0315, 0.017),
        (0.0, 0.065, 0.0),
        (0.0, -0.065, 0.0),
    ]
)
"""``FACE_POINTS`` of a head 0.23 m high, (5, 3), metres; X forwards, Y to its left, Z up.

The origin lies between the ears. Pupils are 63 mm apart (Dodgson, "Variation and extrema of human
interpupillary distance", 2004). The other lengths are those of the detector's points, whose ears
lie 2 cm before the ear canals; measured on rendered and recorded people whose heads turn.
"""
FACE_M.setflags(write=False)
HEAD_HEIGHT_M = 0.23
"""Chin to crown of the head of ``FACE_M``, metres."""

_CHOSEN = np.array([POINT_INDEX[name] for name in FACE_POINTS])
LEAST_POINTS = 3
"""Two points do not tell turning, nodding and tilting apart."""
LARGEST_STDDEV_RAD = np.radians(20.0)
"""Angles that the points determine less exactly are not returned."""
_N = len(NECK_LIMITS)
# Angles of the torso about the axes of the neck.
_OF_TORSO = [YAW, PITCH, ROLL][:_N]
_BEYOND_LIMITS_RAD = np.radians(15.0)
_FARTHEST_M = 0.3

# Standard deviations: face model and detector in metres at the face, detector in pixels.
_POINT_M, _POINT_PX = 0.010, 1.0
# Of the priors of yaw, pitch, roll, rad; place across and up, m; logarithm of the size.
_STDDEVS = np.array([*np.radians([60.0, 40.0, 15.0]), 0.15, 0.15, 0.10])
_RULES = rules_of(6, inverse=_STDDEVS**-2.0)

SMOOTHING_S, MOST_KEPT = 0.15, 0.5
"""Time constant of the smoothing, s, and largest weight of the last output."""
_DRIFT_RAD_S = 1.0


_Given = tuple[Floats, Floats, Floats, Floats, Floats, tuple[float, float, float, float], float]
"""Rotation (3, 3) from the torso's to the optical frame; axes of the reference frame (3, 3) and the
middle of the head (3,) there; a face of this size, (n, 3); the points in the image, (n, 2); focal
lengths and principal point, px; the points' deviation, px."""


class Neck(NamedTuple):
    """Direction of the head relative to the torso."""

    angles: FloatArray  #: ``NECK_NAMES``, (2,), rad
    stddev: FloatArray  #: their standard deviations, (2,), rad


def fit_neck(
    points: ImagePoints, body: BodyModel, camera: Camera, state: FloatArray
) -> Neck | None:
    """Return the direction of the head that fits the points of the face best.

    The ``camera`` has the pitch of the body model, and the torso of ``state``, (12,) or (14,), rad
    and metres, is taken as exact. None if points are too few or uncertain, or form no face.
    """
    known = points.scores[_CHOSEN] >= CERTAIN
    if np.count_nonzero(known) < LEAST_POINTS:
        return None
    frames, axes = pose(body, state), camera.reference_to_optical_rotation()
    head_m = axes @ frames.head
    depth_m = float(head_m[2])
    if depth_m <= _FARTHEST_M:
        return None
    size = body_parts(body.sizes).head.height_m / HEAD_HEIGHT_M
    given = (
        *(np.ascontiguousarray(axes @ frames.torso_rotation), np.ascontiguousarray(axes.T), head_m),
        *(size * FACE_M[known], points.px[_CHOSEN[known]]),
        (camera.fx, camera.fy, camera.cx, camera.cy),
        float(np.hypot(_POINT_PX, camera.fx * _POINT_M / depth_m)),
    )

    found = Solution(_solve(given), ["face"])
    values, information = found.values[0], found.information[0]
    # Priors add as many residuals as there are unknowns, so the points are the degrees of freedom.
    rms = float(np.sqrt(found.total[0] / (2 * np.count_nonzero(known))))
    angles = values[:_N]
    beyond = np.maximum(NECK_LIMITS[:, 0] - angles, angles - NECK_LIMITS[:, 1])
    stddev = np.sqrt(np.diag(np.linalg.inv(information))[:_N]) * max(1.0, rms)
    is_face = rms <= LARGEST_RMS and np.hypot(*values[3:5]) <= _FARTHEST_M
    if not is_face or (beyond > _BEYOND_LIMITS_RAD).any() or (stddev > LARGEST_STDDEV_RAD).any():
        return None
    return Neck(np.clip(angles, NECK_LIMITS[:, 0], NECK_LIMITS[:, 1]), stddev)


@inlined_kernel
def _component(c: int, x: float, y: float, z: float, values: Floats, given: _Given) -> float:
    """Return a component, in the optical frame, of a point of the turned face, m."""
    torso, axes, centre_m, _, _, _, _ = given
    at: float = centre_m[c] + values[3] * axes[1, c] + values[4] * axes[2, c]
    at += torso[c, 0] * x + torso[c, 1] * y + torso[c, 2] * z
    return at


@borrowing_kernel
def _write_residuals(values: Floats, given: _Given, residuals: Floats) -> None:
    """Write the residuals (2n,) of values (6,), in standard deviations.

    The values are yaw, pitch and roll of the neck, rad; place across and up, m; logarithm of the
    size.
    """
    _, _, _, face_m, px, (fx, fy, cx, cy_px), sigma_px = given
    cy, sy = cos(values[0]), sin(values[0])
    cp, sp = cos(values[1]), sin(values[1])
    cr, sr = cos(values[2]), sin(values[2])
    size = exp(values[5])
    for i in range(face_m.shape[0]):
        x, y, z = size * face_m[i, 0], size * face_m[i, 1], size * face_m[i, 2]
        # Rx(roll), then Ry(pitch), then Rz(yaw).
        y, z = cr * y - sr * z, sr * y + cr * z
        x, z = cp * x + sp * z, cp * z - sp * x
        x, y = cy * x - sy * y, sy * x + cy * y
        depth = max(_component(2, x, y, z, values, given), NEAREST_M)
        across = fx * _component(0, x, y, z, values, given) / depth + cx
        down = fy * _component(1, x, y, z, values, given) / depth + cy_px
        residuals[2 * i] = (across - px[i, 0]) / sigma_px
        residuals[2 * i + 1] = (down - px[i, 1]) / sigma_px


@kernel
def _solve(given: _Given) -> Equations:
    """Return the equations of the best values, from a head that looks ahead."""
    rows = given, 2 * given[3].shape[0], DIFFERENCE
    return minimize_compiled(_write_residuals, rows, np.zeros((1, 6)), _RULES, ENDS)


def low_passed(before: FloatArray, values: FloatArray, interval_s: float) -> FloatArray:
    """Return values (n,) after first-order smoothing, ``interval_s`` after the output ``before``.

    y = a y_before + (1 - a) x with a = exp(-dt / time constant), but at most 1/2. A ramp is delayed
    by dt a / (1 - a): less than the time constant, and never more than one interval.
    """
    kept = min(exp(-interval_s / SMOOTHING_S), MOST_KEPT)
    return kept * before + (1.0 - kept) * values


class HeadTracker:
    """Adds the direction of the head to the estimates of one person, smoothed over time.

    A face that is hidden for less than half a second keeps its direction, with a growing deviation.
    """

    def __init__(self, body: BodyModel, camera: Camera) -> None:
        """Start without a direction; the working camera has the pitch of the body model."""
        self._body, self._camera = body, camera
        self._last: Neck | None = None
        self._age_s = 0.0

    def see(self, frame: Frame, found: Estimate) -> Estimate:
        """Return ``found``, the estimate of a frame, with the angles of the neck if known."""
        self._age_s += frame.interval_s
        if self._age_s > KEPT_S:
            self._last = None
        neck = self._fit(frame.points, found)
        if neck is not None:
            if self._last is not None:
                angles = low_passed(self._last.angles, neck.angles, self._age_s)
                neck = neck._replace(angles=angles)
            self._last, self._age_s = neck, 0.0
        if self._last is None or found.posture is None:
            return found
        stddev = np.hypot(self._last.stddev, _DRIFT_RAD_S * self._age_s)
        return replace(found, neck=self._last.angles, neck_stddev=stddev)

    def _fit(self, points: ImagePoints | None, found: Estimate) -> Neck | None:
        if points is None or found.posture is None:
            return None
        neck = fit_neck(points, self._body, self._camera, found.placed_posture)
        if neck is None or found.posture_stddev is None:
            return neck
        return neck._replace(stddev=np.hypot(neck.stddev, found.posture_stddev[_OF_TORSO]))
