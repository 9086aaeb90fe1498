"""Fits the legs of a tracked person to the points of a detector.

The upper body comes first: it places the hips and turns them. For each image, the angles of both
legs then are a maximum a posteriori estimate by least squares. These residuals count, each in
units of its deviation:

- knees and ankles in the image;
- the slope of thigh and shank along the line of sight, from the detector's points in space;
- the height of each ankle above the floor. It may not be below; near the floor it is pulled there,
  and a foot that is lifted is not;
- the angles, from those of the image before and from a leg that hangs;
- the middle of the mass over the feet of somebody who stands, who would fall otherwise: one image
  shows poorly how far the hips of who squats are behind the feet.

Lengths of thigh and shank, and the height of the floor, are the same in all images. They are
unknowns of each fit whose prior is what the images before have shown, and the floor that is given.
So is the share by which the tracker's distance is wrong, which changes little: else, who squats
could stand on straight legs nearer to the camera. The whole person is moved along the line of sight
to that distance, unless depth images or a further camera show it.

Who squats leans so far that the trunk is balanced, too. The search of the next image expects this,
because the slope that the detector finds of a trunk before bent legs is too small.

A leg that the detector does not see keeps its angles, with growing deviations, and is ``hidden``.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.least_squares import DIFFERENCE
from cardbox_tracker.detectors.image_points import (
    CERTAIN,
    LEG_POINT_NAMES,
    POINT_INDEX,
    ImagePoints,
)
from cardbox_tracker.measuring.people_camera import is_inside
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.legs import leg_angles
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.posture import TORSO_Y, YAW
from cardbox_tracker.person.proportions import HIP_SHARE, MARKED_HEIGHTS, THIGH_SHARE, stature_of
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import LEG_LIMITS, LEG_NAMES, KeypointState, rotation_z
from cardbox_tracker.terms.joint_points import POINT_PX
from cardbox_tracker.terms.term import Frame
from cardbox_tracker.tracking import leg_fit
from cardbox_tracker.tracking.estimate import KEPT_S, LARGEST_RMS, Estimate, Legs
from cardbox_tracker.tracking.leg_fit import DISTANCE, N_VALUES, REST, Prior
from cardbox_tracker.tracking.place import DEPTH, SECOND_CAMERA

_SIDES = np.array([1.0, -1.0])
_N = leg_fit.N_ANGLES
# What the images share among the values of a fit.
_SHARED = slice(_N, N_VALUES)
# Knee and ankle, left and right, among the points.
_ENDS = [
    [LEG_POINT_NAMES.index(f"{side}_{name}") for name in ("knee", "ankle")]
    for side in ("left", "right")
]
# The bends of both knees among the angles.
_KNEES = [LEG_NAMES.index(f"{side}_knee_flexion") for side in ("left", "right")]
_HIPS = [POINT_INDEX[f"{side}_hip"] for side in ("left", "right")]
_SHOULDERS = [POINT_INDEX[f"{side}_shoulder"] for side in ("left", "right")]

# Height of the ankle, and lengths of thigh and shank between the joint of the hip and the marks of
# knee and ankle. Detectors mark the hip, too, but below its joint.
_ANKLE_SHARE = float(MARKED_HEIGHTS[5])
_BONES = np.array([THIGH_SHARE, MARKED_HEIGHTS[4] - _ANKLE_SHARE])
# Width of the image's border, as a share of its longer side, where the detector guesses points.
_BORDER = 0.005
# Deviation of the points of knee and ankle, m.
_POINT_M = 0.025
# Deviations of the slopes of thigh and shank.
_SLOPES = np.array([0.22, 0.12])
# The true slopes as linear functions of the detector's: factors and offsets.
_SLOPE_FACTORS, _SLOPE_OFFSETS = np.array([0.93, 0.68]), np.array([-0.04, -0.08])
# Change of an angle and its growth a second, rad.
_CHANGE, _CHANGE_PER_S = np.radians(8.0), np.radians(200.0)
# Logarithms of the lengths' factors, and the floor before it is seen, m.
_LENGTH, _FLOOR_M = 0.04, 0.12
# Relative deviation of the tracker's distance of the hips, in all images and in each.
_DISTANCE_SHARE = 0.03
_FIXED = 1e-6
# Deviation of the middle of the mass of somebody who stands, m.
_BALANCE_M = 0.03
# Somebody stands who bends the knees by less, rad. Who bends them more, and has not moved the hips
# by this distance, m, for this time, s, sits. A foot that is higher than the other one by this
# distance is not on the floor.
_STRAIGHT_RAD, _SITS_S, _STILL_M = np.radians(60.0), 2.0, 0.08
# Images whose information counts for what they share, because their errors are alike, and time over
# which it is averaged, s.
_IMAGES, _AVERAGED_S = 2.0, 3.0
# Deviation of a point from which it is uncertain, m.
_UNCERTAIN_M = 0.15
# Least deviation of a point: that of the skeletons of detectors and people.
_LEAST_M = 0.05
# What an image without legs shows to the fit.
_UNKNOWN = np.full((2, 2), np.nan)
_NOTHING = np.zeros((2, 2, 2)), np.full((2, 2), np.inf), _UNKNOWN, np.ones((2, 2)), (0.0, np.inf)


class _Seen(NamedTuple):
    """What one image shows; the rows of arrays are the left and the right leg."""

    px: FloatArray  #: knee and ankle, (2, 2, 2)
    sigma_px: FloatArray  #: their deviations, (2, 2)
    #: components of thigh and shank along the line of sight, (2, 2); nan if unknown.
    slopes: FloatArray
    sigma_slopes: FloatArray  #: their deviations, (2, 2)
    scores: FloatArray  #: of hip, knee and ankle, (2, 3)
    hips_px: FloatArray  #: both hips, (2, 2)
    #: whether the tracker and the detector exchange left and right, as they do for a person seen
    #: from behind, whose knees then bend to the wrong side.
    shows_back: bool


class LegReader:
    """Adds the legs to the estimates of one person, from the first camera's points.

    Attributes:
        lean_rad: lean of the trunk that balances who squats; 0 for others.
    """

    def __init__(self, body: BodyModel, camera: Camera) -> None:
        """Start with the usual lengths, and the floor if the camera's height above it is known."""
        self._body, self._camera = body, camera
        self.forget()
        self._stature_m = stature_of(body_parts(body.sizes))
        lengths_m = (_BONES.sum() + _ANKLE_SHARE) * self._stature_m
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
        self._last_stddev = REST
        self._last_s = 0.0
        self._hips_px, self._up_s = np.full((2, 2), np.nan), -np.inf
        self._is_level = False
        self.lean_rad = 0.0

    def see(self, frame: Frame, estimate: Estimate) -> Estimate:
        """Return the ``estimate`` with the legs, once points of the first camera show them."""
        points, camera = frame.points, self._camera
        self._time_s += frame.interval_s
        self.lean_rad = 0.0
        is_shown = points is not None and points.legs is not None
        if estimate.posture is None or not (is_shown or self._is_known):
            return estimate
        self._is_known = True
        fit = _Fit(estimate, self._body, self._stature_m, camera)
        time_s = self._time_s
        elapsed_s = abs(time_s - self._last_s)
        change = np.full(_N, np.inf)
        if self._last is not None and elapsed_s <= KEPT_S:
            change = np.hypot(self._last_stddev, _CHANGE + _CHANGE_PER_S * elapsed_s)
        else:
            self._last = np.zeros(_N)
        usual = np.diag(self._usual_stddev**-2.0)
        information = usual + _IMAGES * self._mean_information
        vector = usual @ self._usual + _IMAGES * self._mean_vector
        shared: FloatArray = np.asarray(np.linalg.solve(information, vector), np.float64)
        seen = fit.seen(points)
        changes = np.diag([0.0, 0.0, 0.0, _DISTANCE_SHARE**2])
        information = np.linalg.inv(np.linalg.inv(information) + changes)
        if fit.is_distance_fixed:
            shared[3] = 0.0
        if fit.is_distance_fixed or seen is None or seen.scores[:, 2].min() < CERTAIN:
            # Without both feet, nothing new shows the distance.
            information[3, 3] += _FIXED**-2.0
        vector = information @ shared
        root = np.asarray(np.linalg.cholesky(information), np.float64)
        prior = self._last, np.asarray(change, np.float64), shared, root
        stands = self._stands(seen, fit.px_per_m)
        values, inverse, rms = fit.solve(seen, prior, stands)
        self._last, self._last_s = values[:_N], time_s
        points_m = leg_fit.points_of(values[None], fit.person)[0]
        self._is_level = abs(points_m[2, 2] - points_m[5, 2]) < _STILL_M
        if stands and values[_KNEES].min() > _STRAIGHT_RAD:
            self.lean_rad = fit.balanced_rad(points_m)
        if values[_KNEES].max() < _STRAIGHT_RAD:
            self._up_s = time_s
        covariance = inverse * max(1.0, rms) ** 2
        self._last_stddev = np.minimum(np.sqrt(np.diag(covariance)[:_N]), REST)
        estimate = _moved(estimate, fit.hip_m * (np.exp(values[DISTANCE]) - 1.0), camera)
        if seen is not None and (seen.scores >= CERTAIN).all() and rms < LARGEST_RMS:
            after = np.linalg.inv(inverse[_SHARED, _SHARED])
            step_s = min(max(elapsed_s, 0.01), 0.2)
            self._seen_s = min(self._seen_s + step_s, _AVERAGED_S)
            share = step_s / self._seen_s
            new = after - information
            self._mean_information += share * (0.5 * (new + new.T) - self._mean_information)
            self._mean_vector += share * (after @ values[_SHARED] - vector - self._mean_vector)
        return replace(estimate, legs=fit.legs(seen, values, rms, covariance))

    def _stands(self, seen: _Seen | None, px_per_m: float) -> bool:
        """Return whether the person stands or squats, on both feet, rather than sits."""
        if seen is None or seen.scores.min() < CERTAIN:
            return False
        is_up = self._time_s - self._up_s < _SITS_S
        if is_up and not (np.abs(seen.hips_px - self._hips_px) < _STILL_M * px_per_m).all():
            self._hips_px, self._up_s = seen.hips_px, self._time_s
        return is_up and self._is_level


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


def _reached(start_m: FloatArray, ray: FloatArray, length_m: FloatArray) -> FloatArray:
    """Return where bones end on rays, (..., 3); nearer to the camera for lengths above 0."""
    along_m = (start_m * ray).sum(axis=-1)
    across_m2 = (start_m**2).sum(axis=-1) - along_m**2
    root_m = np.sqrt(np.maximum(length_m**2 - across_m2, 0.0))
    return np.asarray((along_m - np.sign(length_m) * root_m)[..., None] * ray)


class _Fit:
    """The fit of one image."""

    def __init__(
        self, estimate: Estimate, body: BodyModel, stature_m: float, camera: Camera
    ) -> None:
        assert estimate.posture is not None and estimate.keypoints_m is not None
        self._estimate, self._camera = estimate, camera
        self.hip_m = pose(body, estimate.placed_posture).hip
        shoulders_m = np.asarray(estimate.keypoints_m)[[0, 3]].mean(axis=0)
        self._trunk_m = camera.optical_to_reference(shoulders_m) - self.hip_m
        self.px_per_m = camera.fx / max(float(camera.reference_to_optical(self.hip_m)[2]), 0.3)
        self._turn = rotation_z(np.asarray(estimate.posture[YAW]))
        self._aside = self._turn[:, 1] * HIP_SHARE * stature_m
        self._lengths_m, ankle_m = _BONES * stature_m, _ANKLE_SHARE * stature_m
        self.person = self.hip_m, self._aside, self._turn, self._lengths_m, ankle_m
        lens = float(camera.fx), float(camera.fy), float(camera.cx), float(camera.cy)
        self._view = camera.reference_to_optical_rotation(), lens
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
        px, scores = points.legs.px[_ENDS], points.legs.scores[_ENDS]
        known = np.asarray(np.isfinite(px).all(axis=-1))
        # The detector guesses what is outside of the image, such as a foot that is cut off.
        inside = is_inside(points.legs.px, self._camera, _BORDER) | (points.legs.scores <= 0.0)
        scores[:, 0] *= inside[:2]
        scores[:, 1] *= inside[2:].reshape(3, 2).all(axis=0)
        px, scores = np.where(known[..., None], px, 0.0), np.where(known, scores, 0.0)
        is_seen = scores >= CERTAIN
        sigma_px = np.where(is_seen, np.hypot(POINT_PX, self.px_per_m * _POINT_M), np.inf)
        slopes = _UNKNOWN
        if points.spatial_m is not None and points.legs.spatial_m is not None:
            ends_m = points.legs.spatial_m[_ENDS]
            bones = np.diff(ends_m, axis=1, prepend=points.spatial_m[_HIPS][:, None])
            slopes = bones[..., 2] / np.maximum(np.linalg.norm(bones, axis=-1), 1e-6)
            slopes = _SLOPE_FACTORS * slopes + _SLOPE_OFFSETS
        sigma_slopes = np.where(is_seen, _SLOPES, np.inf)
        hips = points.scores[_HIPS][:, None]
        scores = np.concatenate([hips, scores], axis=1)
        return _Seen(px, sigma_px, slopes, sigma_slopes, scores, points.px[_HIPS], shows_back)

    def _is_exchanged(self, points: ImagePoints) -> bool:
        """Return whether the tracker takes the detector's left shoulder for the right one."""
        assert self._estimate.keypoints_m is not None
        shoulders = self._camera.project(np.asarray(self._estimate.keypoints_m)[[0, 3]])
        seen = points.px[_SHOULDERS]
        return bool((seen[0] - seen[1]) @ (shoulders[0] - shoulders[1]) < 0.0)

    def solve(
        self, seen: _Seen | None, prior: Prior, stands: bool
    ) -> tuple[FloatArray, FloatArray, float]:
        """Return the best of the fits that start at the angles before and at what is seen.

        It has values (12,), the inverse (12, 12) of their information, and the residuals' rms.
        """
        before, _, shared, _ = prior
        others, shown, count = np.empty((0, N_VALUES)), _NOTHING, 1
        if seen is not None:
            balance = float(self._trunk_m[0]), _BALANCE_M if stands else np.inf
            others, shown, count = self._folded(seen, shared), (*seen[:4], balance), 4 + 8
        first = np.concatenate([before, shared])
        found, gained, least = leg_fit.fit(first, others, (self.person, self._view, prior, shown))
        return found, np.asarray(np.linalg.inv(gained), np.float64), float(np.sqrt(least / count))

    def balanced_rad(self, points_m: FloatArray) -> float:
        """Return how far a trunk leans whose mass is balanced over legs (6, 3), rad."""
        ahead_m = leg_fit.balanced_m(points_m, self._turn[:, 0])
        share = ahead_m / np.linalg.norm(self._trunk_m)
        return float(np.arcsin(np.clip(share, 0.0, 1.0)))

    def _folded(self, seen: _Seen, shared: FloatArray) -> FloatArray:
        """Return values (16, 12) of legs whose knees and ankles are where they are seen.

        A bone of a known length ends in front of or behind its beginning, so there are four legs on
        each side. A bone that looks too long is across the line of sight.
        """
        lengths_m = self._lengths_m * np.exp(shared[:2])
        hips_m = self.hip_m * np.exp(shared[3]) + np.outer(_SIDES, self._aside)
        rays = self._camera.rays(seen.px)
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
        # Axes: side, where the knee is, where the ankle is.
        hips_m = self._camera.reference_to_optical(hips_m)[:, None, None]
        knees_m = _reached(hips_m, rays[:, 0, None, None], lengths_m[0] * _SIDES[:, None])
        ankles_m = _reached(knees_m, rays[:, 1, None, None], lengths_m[1] * _SIDES)
        bones = np.stack([np.broadcast_to(knees_m - hips_m, ankles_m.shape), ankles_m - knees_m])
        bones = self._camera.optical_to_reference(bones) @ self._turn
        bones /= np.linalg.norm(bones, axis=-1, keepdims=True)
        left, right = leg_angles(bones[0], bones[1], _SIDES[:, None, None]).reshape(2, 4, 4)
        folded = np.empty((16, N_VALUES))
        folded[:, :4], folded[:, 4:_N] = np.repeat(left, 4, axis=0), np.tile(right, (4, 1))
        folded[:, :_N] = np.clip(folded[:, :_N], *LEG_LIMITS.T)
        folded[:, _SHARED] = shared
        return folded

    def legs(
        self, seen: _Seen | None, values: FloatArray, rms: float, covariance: FloatArray
    ) -> Legs:
        """Return the legs of a solution."""
        # The place of the hips has its own deviation.
        moved = values + DIFFERENCE * np.eye(N_VALUES)[:DISTANCE]
        points_m = leg_fit.points_of(np.concatenate([values[None], moved]), self.person)
        slopes = ((points_m[1:] - points_m[0]) / DIFFERENCE).reshape(DISTANCE, -1)
        variance = ((covariance[:DISTANCE, :DISTANCE] @ slopes) * slopes).sum(axis=0)
        variance = variance.reshape(6, 3).sum(axis=1)
        stddev_m = np.sqrt(np.maximum(variance, 0.0) + _LEAST_M**2)
        is_seen = np.zeros(6) if seen is None else seen.scores.ravel() >= CERTAIN
        is_wrong = rms > LARGEST_RMS or (seen is not None and seen.shows_back)
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
