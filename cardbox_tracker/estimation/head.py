"""Finds how the head turns and nods on the torso from the points of a face in an image.

A silhouette shows the head's place but hardly its direction. A rigid model of the face (nose, eyes
and ears) is fitted to the points of a detector by maximum a posteriori estimation: Gauss-Newton
from several starts over yaw, pitch and roll of the neck, the place of the head in the image and its
size, with normal priors. The torso is that of the tracked state, so the angles are those between
torso and head:

    R_head = R_torso Rz(yaw) Ry(pitch) Rx(roll)

The signs are those of the torso's angles: a positive yaw turns the face to the person's left, a
positive pitch lowers it. Both are 0 if the face looks along the torso's forward axis. The roll is
estimated and not returned.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from cardbox_tracker.body.kinematics import pose
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.parts import body_parts
from cardbox_tracker.body.posture import PITCH, YAW
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.body.skeleton import NECK_LIMITS, rotation_x, rotation_y, rotation_z
from cardbox_tracker.detection.image_points import POINT_INDEX, ImagePoints
from cardbox_tracker.estimation.cost.terms import Frame
from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.estimation.filtering.low_pass import LowPass
from cardbox_tracker.vision.camera import Camera

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

LEAST_SCORE = 0.5
"""Points with lower scores are not used."""
LEAST_POINTS = 3
"""Two points do not tell turning, nodding and tilting apart."""
LARGEST_STDDEV_RAD = np.radians(20.0)
"""Angles that the points determine less exactly are not returned."""
LARGEST_RMS = 2.5
"""Largest residual in its standard deviations; points that fit worse are not those of a face."""
_BEYOND_LIMITS_RAD = np.radians(15.0)
_FARTHEST_M = 0.3

# Standard deviations: face model and detector in metres at the face, detector in pixels.
_POINT_M, _POINT_PX = 0.010, 1.0
# Of the priors of yaw, pitch, roll, rad; place across and up, m; logarithm of the size.
_PRIOR = np.array([*np.radians([60.0, 40.0, 15.0]), 0.15, 0.15, 0.10])
_STARTS_RAD = np.radians([(0.0, 0.0), (45.0, 0.0), (-45.0, 0.0), (0.0, 35.0), (0.0, -35.0)])
_STEPS = 8
_LARGEST_STEP = np.array([0.5, 0.5, 0.5, 0.2, 0.2, 0.2])
_DIFFERENCE = 1e-6

_SMOOTHING_S = 0.15
_KEPT_S = 0.5
_DRIFT_RAD_S = 1.0


class Neck(NamedTuple):
    """Direction of the head relative to the torso.

    Attributes:
        angles: yaw and pitch, (2,), rad.
        stddev: their standard deviations, (2,), rad.
    """

    angles: FloatArray
    stddev: FloatArray


@dataclass(frozen=True)
class _Problem:
    """The fit of one face.

    Attributes:
        camera: the camera.
        torso_rotation: (3, 3), torso to reference frame.
        centre_m: (3,), where the model has the middle of the head, reference frame.
        face_m: points of the face of this size, (n, 3).
        px: the same points in the image, (n, 2).
        sigma_px: standard deviation of a coordinate.
    """

    camera: Camera
    torso_rotation: FloatArray
    centre_m: FloatArray
    face_m: FloatArray
    px: FloatArray
    sigma_px: float

    def residuals(self, values: FloatArray) -> FloatArray:
        """Return the residuals (..., 2n + 6) of values (..., 6), in standard deviations."""
        yaw, pitch, roll, across_m, up_m, log_size = np.moveaxis(values, -1, 0)
        neck = rotation_z(yaw) @ rotation_y(pitch) @ rotation_x(roll)
        face = (self.torso_rotation @ neck) @ self.face_m.T * np.exp(log_size)[..., None, None]
        place = self.centre_m + np.stack([0.0 * up_m, across_m, up_m], axis=-1)
        points = np.swapaxes(face, -1, -2) + place[..., None, :]
        optical = self.camera.reference_to_optical(points)
        optical[..., 2] = np.maximum(optical[..., 2], 0.05)
        off = (self.camera.project(optical) - self.px) / self.sigma_px
        return np.concatenate([off.reshape(*values.shape[:-1], -1), values / _PRIOR], axis=-1)

    def linearized(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return residuals (s, m) and their Jacobians (s, m, 6) at values (s, 6)."""
        steps = np.concatenate([np.zeros((1, 6)), _DIFFERENCE * np.eye(6)])
        all_values = self.residuals(values[:, None] + steps)
        here = all_values[:, 0]
        return here, np.swapaxes(all_values[:, 1:] - here[:, None], 1, 2) / _DIFFERENCE


def fit_neck(
    points: ImagePoints, body: BodyModel, camera: Camera, posture: FloatArray
) -> Neck | None:
    """Return the direction of the head that fits the points of the face best.

    Args:
        points: of the image of ``camera``.
        body: the person, at the place of the estimate.
        camera: working camera, with the pitch of the body model.
        posture: d1..d12, (12,), rad and metres; its torso is taken as exact.

    Returns:
        The angles; None if the points are too few or too uncertain, or do not form a face.
    """
    chosen = np.array([POINT_INDEX[name] for name in FACE_POINTS])
    known = points.scores[chosen] >= LEAST_SCORE
    if np.count_nonzero(known) < LEAST_POINTS:
        return None
    frames = pose(body, posture)
    depth_m = float(camera.reference_to_optical(frames.head)[2])
    if depth_m <= _FARTHEST_M:
        return None
    size = body_parts(body.sizes).head.height_m / HEAD_HEIGHT_M
    problem = _Problem(
        camera,
        frames.torso_rotation,
        frames.head,
        size * FACE_M[known],
        points.px[chosen[known]],
        float(np.hypot(_POINT_PX, camera.fx * _POINT_M / depth_m)),
    )
    values, rms, covariance = _solve(problem)
    angles = values[:2]
    beyond = np.maximum(NECK_LIMITS[:, 0] - angles, angles - NECK_LIMITS[:, 1])
    stddev = np.sqrt(np.diag(covariance)[:2]) * max(1.0, rms)
    is_face = rms <= LARGEST_RMS and np.hypot(*values[3:5]) <= _FARTHEST_M
    if not is_face or (beyond > _BEYOND_LIMITS_RAD).any() or (stddev > LARGEST_STDDEV_RAD).any():
        return None
    return Neck(np.clip(angles, NECK_LIMITS[:, 0], NECK_LIMITS[:, 1]), stddev)


def _solve(problem: _Problem) -> tuple[FloatArray, float, FloatArray]:
    """Return the best values (6,), the residuals' RMS and the covariance (6, 6)."""
    values = np.zeros((len(_STARTS_RAD), 6))
    values[:, :2] = _STARTS_RAD
    for _ in range(_STEPS):
        residuals, jacobians = problem.linearized(values)
        normal = np.swapaxes(jacobians, 1, 2)
        step = np.linalg.solve(normal @ jacobians, normal @ residuals[..., None])[..., 0]
        values = values - np.clip(step, -_LARGEST_STEP, _LARGEST_STEP)
    residuals, jacobians = problem.linearized(values)
    costs = (residuals**2).sum(axis=1)
    best = int(np.argmin(costs))
    # Priors add as many residuals as there are unknowns, so the points are the degrees of freedom.
    rms = float(np.sqrt(costs[best] / problem.px.size))
    return values[best], rms, np.linalg.inv(jacobians[best].T @ jacobians[best])


class HeadTracker:
    """Adds the direction of the head to the estimates of one person, smoothed over time.

    A face that is hidden for less than half a second keeps its direction, with a growing deviation.
    """

    def __init__(self, body: BodyModel, camera: Camera) -> None:
        """Start without a direction.

        Args:
            body: the person.
            camera: working camera of the points, with the pitch of the body model.
        """
        self._body, self._camera = body, camera
        self._smooth = LowPass(_SMOOTHING_S)
        self._last: Neck | None = None
        self._age_s = 0.0

    def see(self, frame: Frame, found: Estimate) -> Estimate:
        """Return ``found``, the estimate of a frame, with the angles of the neck if known."""
        self._age_s += frame.interval_s
        if self._age_s > _KEPT_S:
            self._smooth.forget()
            self._last = None
        neck = self._fit(frame.points, found)
        if neck is not None:
            angles = self._smooth(neck.angles, self._age_s)
            self._last, self._age_s = Neck(angles, neck.stddev), 0.0
        if self._last is None or found.posture is None:
            return found
        stddev = np.hypot(self._last.stddev, _DRIFT_RAD_S * self._age_s)
        return replace(found, neck=self._last.angles, neck_stddev=stddev)

    def _fit(self, points: ImagePoints | None, found: Estimate) -> Neck | None:
        if points is None or found.posture is None:
            return None
        neck = fit_neck(points, found.placed(self._body), self._camera, found.posture)
        if neck is None or found.posture_stddev is None:
            return neck
        return neck._replace(stddev=np.hypot(neck.stddev, found.posture_stddev[[YAW, PITCH]]))
