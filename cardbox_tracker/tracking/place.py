"""How surely a result knows where the person is: distance, scale and height.

One camera shows a person's shape, but not its scale: an image of size s shows a person of length L
at the distance f L / s. So the relative deviation of the distance is

    sqrt(deviation of L ^ 2 + deviation of f ^ 2),

whatever fits the image. A trunk that is upright before a camera with pitch p looks shorter by
cos p, so an error of the pitch is one of the distance, too. Joints relative to each other, and the
states of keypoints, do not suffer from it, which is why the place has a state of its own.

A detector that estimates its points in space, too, shows the scale at once
(:func:`distance_of_points`). It is compared with a second source: the given distance, depth images,
or a further camera.

One outline without points may be that of somebody who has turned aside, or of somebody who stands
farther away with other arms. The wrong one fits worse, and an outline from aside lacks the breadth
of the shoulders. So what has changed of the distance since an outline from the front or from behind
fitted as usual is a deviation, too. Where a side of the image cuts the trunk, an outline does not
show its breadth, so no place is sure.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import cos, erfc, hypot, log, radians, sqrt, tan

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.health import Verdict
from cardbox_tracker.detectors.image_points import CERTAIN, POINT_INDEX, ImagePoints
from cardbox_tracker.measuring.first_sight import is_cut
from cardbox_tracker.measuring.people_camera import DISTANCE_STDDEV
from cardbox_tracker.measuring.scene_camera import GUESSED
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import MEASURED, BodyModel
from cardbox_tracker.person.posture import N_JOINTS, PITCH, TORSO_Y, YAW
from cardbox_tracker.search.doubt import FAR_M
from cardbox_tracker.terms.term import Frame
from cardbox_tracker.tracking.estimate import Estimate, Place

MEASURED_BODY, STATURE = "measured body", "given stature"
DEPTH, SECOND_CAMERA = "depth", "second camera"

SCALE_STDDEVS = {MEASURED_BODY: 0.02, STATURE: 0.05, DEPTH: 0.02, SECOND_CAMERA: 0.02}
"""Relative standard deviation of the scale, by what it rests on. A stature is known to 1 to 2 %,
and people of one stature differ in the lengths of trunk and arms by 4 to 6 %."""

# Seconds over which two sources are compared, and the relative deviation of the distance of points
# (0.89 to 1.11 of the true one in 32 recordings).
_COMPARED_S, _POINTS_STDDEV = 1.5, 0.045

# Outlines fit as usual from this share of a quantile of the latest overlaps on; least cosine of the
# yaw of who is not seen from aside.
_FITS, _USUAL, _LATEST, _ACROSS = 0.96, 0.8, 150, cos(radians(20.0))

_TRUNK, _ARM = ("shoulder", "hip"), ("shoulder", "elbow", "wrist")
# Lengths between a detector's points as shares of the length of an arm up to the knuckles, whose
# parts are 0.160 and 0.2005 of the stature.
_SHARES = {"trunk": 0.818, "upper": 0.452, "fore": 0.388}


def distance_of_points(points: ImagePoints, body: BodyModel, camera: Camera) -> float | None:
    """Return the distance along the optical axis of the middle of the shoulders, m, or None.

    The points in space are scaled to the lengths of the person's arms and trunk. Where they have to
    be, so that they project to the points in the image, is a linear problem with three unknowns. It
    needs both shoulders and an elbow.
    """
    if points.spatial_m is None:
        return None
    names = [f"{side}_{joint}" for joint in (*_ARM, "hip") for side in ("left", "right")]
    at = {
        name: POINT_INDEX[name]
        for name in names
        if points.scores[POINT_INDEX[name]] >= CERTAIN
        and np.isfinite(points.spatial_m[POINT_INDEX[name]]).all()
    }
    if "left_shoulder" not in at or "right_shoulder" not in at:
        return None
    there = {name: points.spatial_m[number] for name, number in at.items()}
    share = length_m = 0.0
    if "left_hip" in at and "right_hip" in at:
        trunk = [there[f"left_{joint}"] + there[f"right_{joint}"] for joint in _TRUNK]
        share, length_m = _SHARES["trunk"], float(np.linalg.norm(trunk[0] - trunk[1])) / 2
    for side in ("left", "right"):
        for part, (upper, lower) in zip(("upper", "fore"), pairwise(_ARM), strict=True):
            ends = f"{side}_{upper}", f"{side}_{lower}"
            if all(end in at for end in ends):
                share += _SHARES[part]
                length_m += float(np.linalg.norm(there[ends[0]] - there[ends[1]]))
    if length_m <= 0.0 or len(at) < 3:
        return None
    arm_m = body.size("upper_arm_length") + body.size("forearm_length")
    here_m = np.array(list(there.values())) * (share * arm_m / length_m)
    pixels = points.px[list(at.values())]
    rays = (pixels - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    axes = np.zeros((len(at), 2, 3))
    axes[:, 0, 0] = axes[:, 1, 1] = 1.0
    axes[:, :, 2] = -rays
    wanted = rays * here_m[:, 2:] - here_m[:, :2]
    moved_m = np.linalg.lstsq(axes.reshape(-1, 3), wanted.ravel(), rcond=None)[0]
    return float(here_m[:2, 2].mean() + moved_m[2])


def shoulders_m(body: BodyModel, pitch_rad: float) -> float:
    """Return the distance of :func:`distance_of_points` for a body that stands at its place, m."""
    keypoints_m = pose(body, np.zeros(N_JOINTS), pitch_rad).keypoints_m
    return float(keypoints_m[[0, 3], 2].mean())


class PlaceWatch:
    """The place of one tracked person over time.

    Attributes:
        contradiction: what two sources of scale say, if they differ beyond their deviations.
        is_too_large: whether the body is too large for the second source, so that its bones turn
            along the line of sight to fit the image, and the shape is wrong, too.
        scale: how much larger than the body the second source shows the person, if they differ.
    """

    def __init__(self, body: BodyModel, camera: Camera, earlier: PlaceWatch | None = None) -> None:
        """Begin with the first camera and the person before unknown values are fitted.

        ``earlier`` compared the sources of another version of the body before the same camera.
        """
        self._body, self._camera = body, camera
        self._scale = MEASURED_BODY if body.source == MEASURED else STATURE
        is_found = body.is_distance_found or "distance_m" in body.unknown
        self._is_given = body.source != MEASURED and not is_found
        stddev = hypot(_POINTS_STDDEV, DISTANCE_STDDEV, camera.focal_stddev)
        self._compared = Verdict("distance", lambda one, other: abs(log(one / other)) / stddev)
        self._first_ns: int | None = None
        self._apart_m = 0.0
        self._ious, self._fitted_m = deque[float](maxlen=_LATEST), np.nan
        self.contradiction, self.is_too_large, self.scale = "", False, 1.0
        if earlier is not None:
            # Neither source depends on the version, and some posture misleads the points later.
            self._compared, self._apart_m = earlier._compared, earlier._apart_m
            self._first_ns = earlier._first_ns
            self.contradiction, self.scale = earlier.contradiction, earlier.scale
            self.is_too_large = earlier.is_too_large

    def placed(self, estimate: Estimate, body: BodyModel, frames: Sequence[Frame]) -> Estimate:
        """Return an estimate with its place, which no deviation of it is surer than."""
        is_alone = not any(frame.foreground_px for frame in frames[1:])
        place = self.see(estimate, body, frames[0], is_alone)
        if place is None or estimate.posture_stddev is None or estimate.offset_stddev_m is None:
            return estimate
        stddev = estimate.posture_stddev.copy()
        stddev[TORSO_Y] = np.hypot(stddev[TORSO_Y], place.stddev_m[1])
        # The trunk leans in the level frame, which the camera's pitch defines.
        stddev[PITCH] = np.hypot(stddev[PITCH], body.camera_pose.pitch_stddev_rad)
        moved_m = np.hypot(estimate.offset_stddev_m, place.stddev_m[[0, 2]])
        return replace(estimate, posture_stddev=stddev, offset_stddev_m=moved_m, place=place)

    def see(
        self, estimate: Estimate, body: BodyModel, frame: Frame, is_alone: bool = True
    ) -> Place | None:
        """Return the place of an estimate; None if its filter does not estimate a place.

        ``is_alone`` says that no further camera sees the person.
        """
        if estimate.offset_m is None or estimate.posture is None:
            return None
        place, (x_m, z_m) = body.placement, estimate.offset_m.tolist()
        distance_m = max(place.distance_m - x_m, 0.1)
        rests_on = SECOND_CAMERA
        if frame.depth_m is not None:
            rests_on = DEPTH
        elif is_alone:
            rests_on = self._scale
        self._compare(estimate, body, rests_on, frame)
        tilt = body.camera_pose
        relative = hypot(SCALE_STDDEVS[rests_on], self._camera.focal_stddev)
        if rests_on == STATURE:
            # Deviation of log cos p to the second order. A body is measured with the same error.
            shorter = hypot(tan(tilt.pitch_rad), tilt.pitch_stddev_rad / sqrt(2.0))
            relative = hypot(relative, shorter * tilt.pitch_stddev_rad, body.stature_stddev)
        off_m = hypot(relative * distance_m, self._apart_m)
        if rests_on == self._scale:
            off_m = hypot(off_m, self._changed_m(estimate, frame, distance_m))
        aside_m = relative * abs(float(estimate.posture[TORSO_Y]))
        height_m = hypot(relative * (place.hip_height_m + z_m), distance_m * tilt.pitch_stddev_rad)
        chance = erfc(FAR_M / (sqrt(2.0) * off_m))
        stddev_m = np.array([off_m, aside_m, height_m])
        contradiction = self.contradiction
        if "distance_m" in body.unknown and rests_on == STATURE:
            contradiction = contradiction or "no image has shown the distance yet"
        if self._camera.focal_stddev > GUESSED and rests_on == STATURE:
            # Lenses that films of people are made with are up to twice as long.
            contradiction = contradiction or "nothing tells the field of view"
        if rests_on == self._scale and frame["points"] is None and is_cut(frame.silhouette):
            contradiction = contradiction or "a side of the image cuts the person"
        return Place(stddev_m, chance, rests_on, contradiction)

    def _changed_m(self, estimate: Estimate, frame: Frame, distance_m: float) -> float:
        """Return how far the distance is from that at which an outline fitted as usual, m."""
        is_known = np.isnan(self._fitted_m) or frame["points"] is not None
        if estimate.iou is not None and estimate.posture is not None:
            self._ious.append(estimate.iou)
            is_usual = estimate.iou >= _FITS * np.quantile(self._ious, _USUAL)
            is_known |= is_usual and abs(cos(estimate.posture[YAW])) >= _ACROSS
        if is_known:
            self._fitted_m = distance_m
        return abs(distance_m - self._fitted_m)

    def _compare(self, estimate: Estimate, body: BodyModel, rests_on: str, frame: Frame) -> None:
        """Compare the distance of the points with that of a second source, for some seconds."""
        points, stamp_ns = frame["points"], frame.stamp_ns
        is_second = rests_on in (DEPTH, SECOND_CAMERA)
        if points is None or stamp_ns is None or not (self._is_given or is_second):
            return
        if self._first_ns is None:
            self._first_ns = stamp_ns
        if stamp_ns - self._first_ns > _COMPARED_S * 1e9 or estimate.keypoints_m is None:
            return
        found_m = distance_of_points(points, self._body, self._camera)
        if found_m is None or found_m <= 0.0:
            return
        # Both are distances of the shoulders along the optical axis.
        if is_second:
            known_m = float(estimate.keypoints_m[[0, 3], 2].mean())
        else:
            known_m = shoulders_m(body, self._camera.pitch_rad)
        is_apart = self._compared.see(found_m, known_m)
        shown_m, other_m = self._compared.medians if is_apart else (1.0, 1.0)
        self._apart_m, self.scale = abs(shown_m - other_m), other_m / shown_m
        self.is_too_large = shown_m > other_m
        other = rests_on if is_second else "given distance"
        self.contradiction = self._compared.remark(
            scale=self._scale, shown_m=shown_m, other=other, other_m=other_m
        )
