"""Fits the legs of a tracked person to the points of a detector.

The upper body comes first: it places the hips and turns them. For each image, the angles of both
legs then are a maximum a posteriori estimate by Gauss-Newton steps. These residuals count, each in
units of its deviation:

- knees and ankles in the image;
- the slope of thigh and shank along the line of sight, from the detector's points in space;
- the height of each ankle above the floor. It may not be below; near the floor it is pulled there,
  and a foot that is lifted is not;
- the angles, from those of the image before and from a leg that hangs.

Lengths of thigh and shank, and the height of the floor, are the same in all images. They are
unknowns of each fit whose prior is what the images before have shown, and the floor that is given.
So is the share by which the tracker's distance is wrong, which changes little: else, who squats
could stand on straight legs nearer to the camera. The whole person is moved along the line of sight
to that distance, unless depth images or a further camera show it.

A leg that the detector does not see keeps its angles, with growing deviations, and is ``hidden``.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.image_points import (
    LEG_POINT_NAMES,
    POINT_INDEX,
    ImagePoints,
)
from cardbox_tracker.measuring.people_camera import is_inside
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.legs import (
    HIP_SHARE,
    LEG_LIMITS,
    LEG_NAMES,
    leg_angles,
    leg_directions,
    stature_of,
)
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.posture import TORSO_Y, YAW
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import (
    KeypointState,
    rotation_z,
)
from cardbox_tracker.terms.term import Frame
from cardbox_tracker.tracking.estimate import Estimate, Legs
from cardbox_tracker.tracking.place import DEPTH, SECOND_CAMERA

_SIDES = np.array([1.0, -1.0])
_N = len(LEG_NAMES)
# Values of a fit: the angles, the logarithms of the lengths' factors, the floor, the distance.
_LENGTHS, _SHARED, _DISTANCE = slice(_N, _N + 2), slice(_N, _N + 4), _N + 3
# Knee and ankle, left and right, among the points.
_ENDS = [
    [LEG_POINT_NAMES.index(f"{side}_{name}") for name in ("knee", "ankle")]
    for side in ("left", "right")
]
_HIPS = [POINT_INDEX[f"{side}_hip"] for side in ("left", "right")]
_SHOULDERS = [POINT_INDEX[f"{side}_shoulder"] for side in ("left", "right")]

# Where detectors mark knees and ankles: lengths of thigh and shank, and height of the ankle above
# the floor, as shares of the stature (means of two real and two rendered people).
_MARKED, _ANKLE_SHARE = np.array([0.236, 0.228]), 0.05
# A point with a lower score is not seen.
LEAST_SCORE = 0.5
# Width of the image's border, as a share of its longer side, where the detector guesses points.
_BORDER = 0.005
# Deviations of the points of knee and ankle, m and px; how much larger that of an unseen one is.
_POINT_M, _POINT_PX, _UNSEEN = np.array([0.025, 0.025]), 1.5, 6.0
# Deviations of the slopes of thigh and shank, and how much larger those of unseen ones are.
_SLOPES, _UNSEEN_SLOPE = np.array([0.22, 0.12]), 1.5
# The true slopes as linear functions of the detector's: factors and offsets.
_SLOPE_FACTORS, _SLOPE_OFFSETS = np.array([0.93, 0.68]), np.array([-0.04, -0.08])
# Deviation of a foot on the floor, m, and height above it from which a foot is lifted rather.
_CONTACT_M, _LIFTED_M = 0.02, 0.06
# Of the priors: angles of a hanging leg, and change of an angle and its growth a second, rad.
_REST = np.tile(np.radians([60.0, 15.0, 15.0, 60.0]), 2)
_CHANGE, _CHANGE_PER_S = np.radians(8.0), np.radians(200.0)
# Logarithms of the lengths' factors, the largest one of people, and the floor before it is seen, m.
_LENGTH, _MOST_LENGTH, _FLOOR_M = 0.04, 0.12, 0.12
# Relative deviations of the tracker's distance of the hips, in all images and in each.
_DISTANCE_SHARE, _DISTANCE_CHANGE = 0.03, 0.02
_FIXED = 1e-6
# Images whose information counts for what they share, because their errors are alike, and time over
# which it is averaged, s.
_IMAGES, _AVERAGED_S = 2.0, 3.0
_KEPT_S = 1.0
_STEPS, _LARGEST_STEP, _DIFFERENCE = 8, 0.6, 1e-5
# Deviation of a point from which it is uncertain, m, and rms of the residuals of a wrong fit.
_UNCERTAIN_M, _WRONG_RMS = 0.15, 3.0
# Least deviation of a point: that of the skeletons of detectors and people.
_LEAST_M = 0.05


class _Seen(NamedTuple):
    """What one image shows; the rows of arrays are the left and the right leg."""

    px: FloatArray  #: knee and ankle, (2, 2, 2)
    sigma_px: FloatArray  #: their deviations, (2, 2)
    #: components of thigh and shank along the line of sight, (2, 2); nan if unknown.
    slopes: FloatArray
    sigma_slopes: FloatArray  #: their deviations, (2, 2)
    scores: FloatArray  #: of hip, knee and ankle, (2, 3)
    #: whether the tracker and the detector exchange left and right, as they do for a person seen
    #: from behind, whose knees then bend to the wrong side.
    shows_back: bool


class LegReader:
    """Adds the legs to the estimates of one person, from the first camera's points."""

    def __init__(self, body: BodyModel, camera: Camera) -> None:
        """Start with the usual lengths, and the floor if the camera's height above it is known."""
        self._body, self._camera = body, camera
        self.forget()
        stature_m = stature_of(body_parts(body.sizes))
        lengths_m = (_MARKED.sum() + _ANKLE_SHARE) * stature_m
        self._usual = np.array([0.0, 0.0, body.placement.hip_height_m - lengths_m, 0.0])
        self._usual_stddev = np.array([_LENGTH, _LENGTH, _FLOOR_M, _DISTANCE_SHARE])
        stands = body.camera_pose
        if stands.height_m is not None:
            self._usual[2], self._usual_stddev[2] = -stands.height_m, stands.height_stddev_m
        self._mean_information, self._mean_vector = np.zeros((4, 4)), np.zeros(4)
        self._seen_s = self._time_s = 0.0
        self._is_known = False

    def forget(self) -> None:
        """Forget the posture; lengths and floor stay."""
        self._last: FloatArray | None = None
        self._last_stddev = _REST
        self._last_s = 0.0

    def see(self, frame: Frame, estimate: Estimate) -> Estimate:
        """Return the ``estimate`` with the legs, once points of the first camera show them."""
        points, camera = frame.points, self._camera
        self._time_s += frame.interval_s
        is_shown = points is not None and points.legs is not None
        if estimate.posture is None or not (is_shown or self._is_known):
            return estimate
        self._is_known = True
        fit = _Fit(estimate, self._body, camera)
        time_s = self._time_s
        elapsed_s = abs(time_s - self._last_s)
        change = np.full(_N, np.inf)
        if self._last is not None and elapsed_s <= _KEPT_S:
            change = np.hypot(self._last_stddev, _CHANGE + _CHANGE_PER_S * elapsed_s)
        else:
            self._last = np.zeros(_N)
        usual = np.diag(self._usual_stddev**-2.0)
        information = usual + _IMAGES * self._mean_information
        vector = usual @ self._usual + _IMAGES * self._mean_vector
        shared: FloatArray = np.asarray(np.linalg.solve(information, vector), np.float64)
        seen = fit.seen(points)
        changes = np.diag([0.0, 0.0, 0.0, _DISTANCE_CHANGE**2])
        information = np.linalg.inv(np.linalg.inv(information) + changes)
        if fit.is_distance_fixed:
            shared[3] = 0.0
        if fit.is_distance_fixed or seen is None or seen.scores[:, 2].min() < LEAST_SCORE:
            # Without both feet, nothing new shows the distance.
            information[3, 3] += _FIXED**-2.0
        vector = information @ shared
        fit.prior(self._last, change, shared, information)
        found = fit.solve(seen, self._last)
        self._last, self._last_s = found.values[:_N], time_s
        covariance: FloatArray = np.asarray(np.linalg.inv(found.information), np.float64)
        covariance = covariance * max(1.0, found.rms) ** 2
        self._last_stddev = np.minimum(np.sqrt(np.diag(covariance)[:_N]), _REST)
        estimate = _moved(estimate, fit.hips_moved_m(found.values), camera)
        if seen is not None and (seen.scores >= LEAST_SCORE).all() and found.rms < _WRONG_RMS:
            after = np.linalg.inv(np.linalg.inv(found.information)[_SHARED, _SHARED])
            step_s = min(max(elapsed_s, 0.01), 0.2)
            self._seen_s = min(self._seen_s + step_s, _AVERAGED_S)
            share = step_s / self._seen_s
            new = after - information
            self._mean_information += share * (0.5 * (new + new.T) - self._mean_information)
            gained = after @ found.values[_SHARED] - vector
            self._mean_vector += share * (gained - self._mean_vector)
        return replace(estimate, legs=fit.legs(seen, found, covariance))


def _moved(estimate: Estimate, by_m: FloatArray, camera: Camera) -> Estimate:
    """Return an estimate whose person stands elsewhere, (3,) in the reference frame."""
    if estimate.offset_m is None:
        return estimate
    assert estimate.posture is not None and estimate.keypoints_m is not None
    posture = np.array(estimate.posture)
    posture[TORSO_Y] += by_m[1]
    return replace(
        estimate,
        posture=posture,
        offset_m=estimate.offset_m + by_m[[0, 2]],
        keypoints_m=estimate.keypoints_m + camera.reference_to_optical(by_m),
    )


class _Solution(NamedTuple):
    """Values (12,) of a fit, their information (12, 12), and the rms of the residuals."""

    values: FloatArray
    information: FloatArray
    rms: float


class _Fit:
    """The fit of one image."""

    def __init__(self, estimate: Estimate, body: BodyModel, camera: Camera) -> None:
        assert estimate.posture is not None
        self._estimate, self._camera = estimate, camera
        placed = estimate.placed(body)
        stature_m = stature_of(body_parts(body.sizes))
        self._hip_m = pose(placed, estimate.posture).hip
        self._turn = rotation_z(np.asarray(estimate.posture[YAW]))
        self._aside = self._turn[:, 1] * HIP_SHARE * stature_m
        self._lengths_m = _MARKED * stature_m
        self._ankle_m = _ANKLE_SHARE * stature_m
        self._sight = camera.optical_to_reference(np.array([0.0, 0.0, 1.0]))
        place = estimate.place
        # A filter that keeps the distance constant has no values for another one.
        self.is_distance_fixed = place is None or place.rests_on in (DEPTH, SECOND_CAMERA)

    def seen(self, points: ImagePoints | None) -> _Seen | None:
        """Return what the points show; None if they do not show the legs."""
        if points is None or points.legs is None:
            return None
        shows_back = self._is_exchanged(points)
        if shows_back:
            points = points.exchanged()
        assert points.legs is not None
        px, scores, spatial_m = points.legs.px[_ENDS], points.legs.scores[_ENDS], None
        known = np.asarray(np.isfinite(px).all(axis=-1))
        # The detector guesses what is outside of the image, such as a foot that is cut off.
        inside = is_inside(points.legs.px, self._camera, _BORDER) | (points.legs.scores <= 0.0)
        scores[:, 0] *= inside[:2]
        scores[:, 1] *= inside[2:].reshape(3, 2).all(axis=0)
        px, scores = np.where(known[..., None], px, 0.0), np.where(known, scores, 0.0)
        is_seen = scores >= LEAST_SCORE
        depth_m = float(self._camera.reference_to_optical(self._hip_m)[2])
        sigma_px = np.hypot(_POINT_PX, self._camera.fx * _POINT_M / max(depth_m, 0.3))
        sigma_px = np.where(is_seen, sigma_px, _UNSEEN * sigma_px)
        sigma_px = np.where(known, sigma_px, np.inf)
        slopes = np.full((2, 2), np.nan)
        if points.spatial_m is not None and points.legs.spatial_m is not None:
            spatial_m = points.legs.spatial_m[_ENDS]
            bones = np.diff(
                np.concatenate([points.spatial_m[_HIPS][:, None], spatial_m], axis=1), axis=1
            )
            slopes = bones[..., 2] / np.maximum(np.linalg.norm(bones, axis=-1), 1e-6)
            slopes = _SLOPE_FACTORS * slopes + _SLOPE_OFFSETS
        sigma_slopes = np.where(is_seen, _SLOPES, _UNSEEN_SLOPE * _SLOPES)
        hips = points.scores[_HIPS][:, None]
        scores = np.concatenate([hips, scores], axis=1)
        return _Seen(px, sigma_px, slopes, sigma_slopes, scores, shows_back)

    def _is_exchanged(self, points: ImagePoints) -> bool:
        """Return whether the tracker takes the detector's left shoulder for the right one."""
        assert self._estimate.keypoints_m is not None
        shoulders = self._camera.project(np.asarray(self._estimate.keypoints_m)[[0, 3]])
        seen = points.px[_SHOULDERS]
        return bool((seen[0] - seen[1]) @ (shoulders[0] - shoulders[1]) < 0.0)

    def prior(
        self,
        before: FloatArray,
        change: FloatArray,
        shared: FloatArray,
        information: FloatArray,
    ) -> None:
        """Set the priors: angles (8,) ``before`` and deviations of their change, inf for none.

        Also what images share, (4,), and its information (4, 4).
        """
        self._before, self._change = before, change
        self._expected, self._root = shared, np.linalg.cholesky(information).T

    def solve(self, seen: _Seen | None, before: FloatArray) -> _Solution:
        """Return the best of the fits that start at the angles before and at what is seen."""
        starts = [np.concatenate([before, self._expected])]
        if seen is not None:
            others = self._folded(seen)
            costs = np.sum(self._residuals(others, seen) ** 2, axis=1)
            starts.append(others[np.argmin(costs)])
        values = np.array(starts)
        nearby = _DIFFERENCE * np.eye(values.shape[1])
        found: list[_Solution] = []
        count = 1 if seen is None else 4 + 8
        for _ in range(_STEPS + 1):
            moved = np.concatenate([values[:, None], values[:, None] + nearby], axis=1)
            rows = self._residuals(moved.reshape(-1, values.shape[1]), seen)
            rows = rows.reshape(*moved.shape[:2], -1)
            steps = []
            jacobians = (rows[:, 1:] - rows[:, :1]).swapaxes(1, 2) / _DIFFERENCE
            for at, residuals, jacobian in zip(values, rows[:, 0], jacobians, strict=True):
                information = jacobian.T @ jacobian
                rms = float(np.sqrt(np.sum(residuals**2) / count))
                found.append(_Solution(at, information, rms))
                steps.append(np.linalg.solve(information, jacobian.T @ residuals))
            values = values - np.clip(steps, -_LARGEST_STEP, _LARGEST_STEP)
            values[:, :_N] = np.clip(values[:, :_N], *LEG_LIMITS.T)
            values[:, _LENGTHS] = np.clip(values[:, _LENGTHS], -_MOST_LENGTH, _MOST_LENGTH)
        return min(found, key=lambda one: one.rms)

    def _folded(self, seen: _Seen) -> FloatArray:
        """Return values (16, 12) of legs whose knees and ankles are where they are seen.

        A bone of a known length ends in front of or behind its beginning, so there are four legs on
        each side. A bone that looks too long is across the line of sight.
        """
        lengths_m = self._lengths_m * np.exp(self._expected[:2])
        hips_m = self._hip_m * np.exp(self._expected[3]) + np.outer(_SIDES, self._aside)
        both: list[list[FloatArray]] = [[], []]
        for number, side in enumerate(_SIDES):
            hip_m = self._camera.reference_to_optical(hips_m[number])
            rays = self._camera.rays(seen.px[number])
            rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
            for signs in product((-1.0, 1.0), repeat=2):
                joints_m = [hip_m]
                for ray, length_m, sign in zip(rays, lengths_m, signs, strict=True):
                    along_m = float(ray @ joints_m[-1])
                    across_m2 = joints_m[-1] @ joints_m[-1] - along_m**2
                    root_m = np.sqrt(max(length_m**2 - across_m2, 0.0))
                    joints_m.append((along_m + sign * root_m) * ray)
                bones = self._camera.optical_to_reference(np.diff(joints_m, axis=0)) @ self._turn
                bones /= np.linalg.norm(bones, axis=-1, keepdims=True)
                both[number].append(leg_angles(bones[0], bones[1], side))
        folded = np.array([np.concatenate([*pair, self._expected]) for pair in product(*both)])
        folded[:, :_N] = np.clip(folded[:, :_N], *LEG_LIMITS.T)
        return folded

    def hips_moved_m(self, values: FloatArray) -> FloatArray:
        """Return how far from the tracker's place the hips are, (3,), reference frame."""
        return np.asarray(self._hip_m * (np.exp(values[_DISTANCE]) - 1.0))

    def points_m(self, values: FloatArray) -> FloatArray:
        """Return hips, knees and ankles (..., 2, 3, 3) of values (..., 12), reference frame."""
        hip_m = self._hip_m * np.exp(values[..., _DISTANCE, None])
        lengths_m = self._lengths_m * np.exp(values[..., _N : _N + 2])
        angles = values[..., :_N].reshape(*values.shape[:-1], 2, 4)
        bones = np.stack(leg_directions(angles, _SIDES), axis=-2)
        turned = (bones.reshape(-1, 3) @ self._turn.T).reshape(bones.shape)
        hips_m = hip_m[..., None, None, :] + np.outer(_SIDES, self._aside)[:, None]
        steps_m = lengths_m[..., None, :, None] * turned
        return np.asarray(np.cumsum(np.concatenate([hips_m, steps_m], axis=-2), axis=-2))

    def _residuals(self, values: FloatArray, seen: _Seen | None) -> FloatArray:
        """Return the residuals (n, m) of values (n, 12)."""
        points_m = self.points_m(values)
        angles = values[:, :_N]
        found = [
            angles / _REST,
            (angles - self._before) / self._change,
            (values[:, _SHARED] - self._expected) @ self._root.T,
        ]
        # A foot may not be below the floor; from some height on, it is lifted.
        height_m = points_m[:, :, 2, 2] - values[:, _N + 2, None] - self._ankle_m
        contact = height_m / np.sqrt(1.0 + np.maximum(height_m / _LIFTED_M, 0.0) ** 2) / _CONTACT_M
        found.append(contact)
        if seen is not None:
            optical_m = self._camera.reference_to_optical(points_m[:, :, 1:])
            optical_m[..., 2] = np.maximum(optical_m[..., 2], 0.1)
            away = (self._camera.project(optical_m) - seen.px) / seen.sigma_px[..., None]
            found.append(away.reshape(len(values), -1))
            bones = np.diff(points_m, axis=2)
            bones /= np.linalg.norm(bones, axis=-1, keepdims=True)
            slopes = (bones @ self._sight - seen.slopes) / seen.sigma_slopes
            found.append(np.where(np.isnan(slopes), 0.0, slopes).reshape(len(values), -1))
        return np.concatenate(found, axis=1)

    def legs(self, seen: _Seen | None, found: _Solution, covariance: FloatArray) -> Legs:
        """Return the legs of a solution."""
        values = found.values
        moved = np.concatenate([values[None], values + _DIFFERENCE * np.eye(len(values))])
        # The place of the hips has its own deviation.
        moved[:, _DISTANCE] = values[_DISTANCE]
        points_m = self.points_m(moved).reshape(len(moved), 6, 3)
        slopes = (points_m[1:] - points_m[0]) / _DIFFERENCE
        variance = np.einsum("ika,ij,jka->k", slopes, covariance, slopes)
        stddev_m = np.sqrt(np.maximum(variance, 0.0) + _LEAST_M**2)
        is_seen = np.zeros(6) if seen is None else seen.scores.ravel() >= LEAST_SCORE
        is_wrong = found.rms > _WRONG_RMS or (seen is not None and seen.shows_back)
        states = tuple(
            KeypointState.HIDDEN
            if not is_there
            else KeypointState.UNCERTAIN
            if is_wrong or stddev > _UNCERTAIN_M
            else KeypointState.TRACKED
            for is_there, stddev in zip(is_seen, stddev_m, strict=True)
        )
        return Legs(
            values[:_N],
            np.sqrt(np.diag(covariance)[:_N]),
            self._camera.reference_to_optical(points_m[0]),
            stddev_m,
            states,
        )
