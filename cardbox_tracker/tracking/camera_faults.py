"""Cameras of several that are wrong for a while, and are left out as long as they are.

Sensors are noisy, so equal images come from a driver or a network that repeats the last one. They
do no harm while the person stands still, and none if every second image is a repetition. A
silhouette that fills the image shows a change of the light. In a mirrored image the person faces
another way than in the first camera; only a detector's points in space tell that, and nothing does
if the person faces that very camera. :mod:`cardbox_tracker.measuring.silhouette_tangents` finds
images that contradict the pose or the focal length.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.image_points import POINT_INDEX, ImagePoints
from cardbox_tracker.terms.term import Frame
from cardbox_tracker.tracking.camera_agreement import CameraAgreement
from cardbox_tracker.tracking.observation import Observation

FROZEN = (
    "{name} shows the same image again and again while the others go on: {count} of its images are "
    "not used. Is its driver or its connection stuck?"
)
FULL = (
    "the silhouette of {name} fills {count} of its images, which are of no use without points of a "
    "detector. Has the light changed, or is the camera covered?"
)
TURNED = (
    "{name} shows the person facing another way than the first camera: {count} of its images are "
    "not used. Is one of them mirrored?"
)
POSE = (
    "{name} contradicts the first camera, by its pose and its CameraInfo: {count} of its images "
    "are not used"
)
# Repetitions that count, and those that do so although the other silhouettes hardly changed.
_LEAST, _SURE = 2, 15
# Change of another camera's silhouette since the first of the equal images, as a share of its area.
_MOVED = 0.08
# Share of the image that no person fills.
_FULL = 0.8
# Images over which the direction that somebody faces is compared, and from which on; least
# difference, rad: right cameras differ by up to 34 degrees, mirrored ones by 60 and more.
_WINDOW, _JUDGED, _OTHER_WAY = 15, 6, np.radians(50.0)
# Time for which a fault that is over is told, ns, and the usual time between images.
_TOLD_NS, _USUAL_NS = 1_000_000_000, 66_666_667
_SHOULDERS = [POINT_INDEX["left_shoulder"], POINT_INDEX["right_shoulder"]]


class CameraFaults:
    """Compares each camera's images with others.

    Attributes:
        left_out: number of images of each camera that are not used, by the reason.
        is_contradicted: whether two cameras contradict each other: nobody knows which one is wrong.
    """

    def __init__(self, count: int) -> None:
        """Begin without images of ``count`` cameras."""
        self.left_out = [Counter[str]() for _ in range(count)]
        self.is_contradicted = False
        self._told_ns: list[dict[str, int]] = [{} for _ in range(count)]
        self._now_ns = 0
        self._last: list[NDArray[Any] | None] = [None] * count
        self._repeated = [0] * count
        # The silhouettes of all cameras when each one's last image was new.
        self._then: list[list[NDArray[Any] | None]] = [[None] * count for _ in range(count)]
        self._turned_rad = [deque[float](maxlen=_WINDOW) for _ in range(count)]

    def without(
        self, observations: Sequence[Observation | None], stamp_ns: int | None = None
    ) -> list[Observation | None]:
        """Return the observations of one time, None for cameras that are frozen or useless."""
        self._now_ns = self._now_ns + _USUAL_NS if stamp_ns is None else stamp_ns
        count = len(self.left_out)
        seen = [*observations, *[None] * (count - len(observations))]
        now = [None if one is None else one.silhouette for one in seen]
        kept = [None if mask is None else np.array(mask) for mask in now]
        for number, one in enumerate(seen):
            mask = kept[number]
            if mask is not None and np.count_nonzero(mask) > _FULL * mask.size:
                self.leave_out(number, FULL)
                seen[number] = None if one is None or one.points is None else one
            shown = None if one is None else one.image
            if shown is None and mask is not None and mask.any():
                # Without an image, only a person shows that a camera goes on.
                shown = mask
            if shown is None:
                self._repeated[number] = 0
                continue
            last = self._last[number]
            if last is not None and np.array_equal(last, shown):
                self._repeated[number] += 1
                continue
            self._last[number], self._repeated[number] = np.array(shown), 0
            self._then[number] = kept
        frozen = [self._is_frozen(number, kept) for number in range(count)]
        for number in np.flatnonzero(frozen).tolist():
            self.leave_out(number, FROZEN)
            seen[number] = None
        return seen

    def agreeing(self, frames: Sequence[Frame], agreement: CameraAgreement) -> list[Frame]:
        """Return the frames of one time, empty ones of cameras that contradict the others.

        If all of several further cameras contradict the first one, that is left out.
        """
        is_whole = agreement.look(frames)
        before_rad = facing_rad(frames[0].points, frames[0].camera) if is_whole else np.nan
        reasons = [POSE if fault else "" for fault in agreement.are_contradicted]
        for number, (frame, view) in enumerate(zip(frames[1:], agreement.views, strict=True)):
            turned_rad = facing_rad(frame.points, frame.camera) + view.yaw_rad - before_rad
            if self.is_turned(number + 1, turned_rad):
                reasons[number] = reasons[number] or TURNED
        self.is_contradicted = len(reasons) == 1 and bool(reasons[0])
        wrong = ["", *reasons]
        if len(reasons) > 1 and all(reasons):
            wrong = [reasons[0], *[""] * len(reasons)]
        kept = []
        for number, (frame, reason) in enumerate(zip(frames, wrong, strict=True)):
            if reason and frame.foreground_px:
                self.leave_out(number, reason)
                channels = {"silhouette": np.zeros_like(frame.silhouette)}
                frame = frame.changed(channels=channels, foreground_px=0)
            kept.append(frame)
        return kept

    def leave_out(self, camera: int, reason: str) -> None:
        """Count an image that is not used."""
        self.left_out[camera][reason] += 1
        self._told_ns[camera][reason] = self._now_ns

    def _is_frozen(self, number: int, now: Sequence[NDArray[Any] | None]) -> bool:
        if self._repeated[number] < _LEAST:
            return False
        moved = max(
            _change(before, there)
            for other, (before, there) in enumerate(zip(self._then[number], now, strict=True))
            if other != number
        )
        return moved > (0.0 if self._repeated[number] >= _SURE else _MOVED)

    def is_turned(self, camera: int, turned_rad: float) -> bool:
        """Return whether somebody has faced another way than in the first camera for some images.

        ``turned_rad`` is the difference in this image, or nan.
        """
        found = self._turned_rad[camera]
        if np.isfinite(turned_rad):
            found.append(abs(float(np.angle(np.exp(1j * turned_rad)))))
        return len(found) >= _JUDGED and bool(np.median(found) > _OTHER_WAY)

    def remarks(self, names: Sequence[str] = (), is_all: bool = False) -> list[str]:
        """Return a warning for each camera that is left out now, with ``is_all`` also before."""
        count = len(self.left_out)
        names = names or [f"camera {number} of {count}" for number in range(1, count + 1)]
        return [
            reason.format(name=name, count=images)
            for name, out, told_ns in zip(names, self.left_out, self._told_ns, strict=True)
            for reason, images in out.items()
            if is_all or 0 <= self._now_ns - told_ns[reason] <= _TOLD_NS
        ]


def facing_rad(points: ImagePoints | None, camera: Camera) -> float:
    """Return the angle from left to right shoulder in the level frame, rad; nan without points."""
    if points is None or points.spatial_m is None:
        return float("nan")
    across, _, away = np.subtract(*points.spatial_m[_SHOULDERS[::-1]])
    column = float(points.px[_SHOULDERS, 0].mean())
    bearing = np.arctan((column - camera.cx) / camera.fx)
    return float(np.arctan2(across, -away) - bearing)


def _change(before: NDArray[Any] | None, now: NDArray[Any] | None) -> float:
    """Return the share of a silhouette that changed; 0 if one is missing."""
    if before is None or now is None or before.shape != now.shape:
        return 0.0
    changed, area = np.count_nonzero(before != now), np.count_nonzero(before)
    return float(changed) / max(float(area), 1.0)
