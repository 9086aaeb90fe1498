"""Cameras of several that are wrong for a while, and are left out as long as they are.

Sensors are noisy, so equal images come from a driver or a network that repeats the last one. They
do no harm while the person stands still, and none if every second image is a repetition. A
silhouette that fills the image shows a change of the light. In a mirrored image the person faces
another way than in the first camera, as a detector's points in space tell, unless the person faces
that very camera. The background of a camera that somebody has bumped into is elsewhere in its
images. :mod:`cardbox_tracker.measuring.silhouette_tangents` finds images that contradict the pose
or the focal length.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.health import WATCHES, Verdict
from cardbox_tracker.detectors.image_points import CERTAIN, ImagePoints
from cardbox_tracker.measuring.scene_camera import background_shift
from cardbox_tracker.measuring.silhouette_tangents import LEAST_POINTS
from cardbox_tracker.terms.term import USUAL_INTERVAL_S, Frame, Image, Silhouette
from cardbox_tracker.tracking.camera_agreement import CameraAgreement
from cardbox_tracker.tracking.observation import Observation

_POSE = (
    "{name} contradicts the first camera, by its pose and its CameraInfo: {count} of its images "
    "are not used"
)
# Fewest repetitions in a row that count: every second image may be one.
_LEAST = 2
# Time for which a fault that is over is told, ns.
_TOLD_NS = 1_000_000_000
# Time between comparisons of the background, ns; share of the width for the margin around people.
_COMPARED_NS, _AROUND = 700_000_000, 20


class CameraFaults:
    """Compares each camera's images with others.

    Attributes:
        is_contradicted: whether two cameras contradict each other: nobody knows which one is wrong.
    """

    def __init__(self, count: int) -> None:
        """Begin without images of ``count`` cameras."""
        self.is_contradicted = False
        # How many images of each camera are not used, by the reason, and when the last one came.
        self._left_out: list[dict[str, tuple[int, int]]] = [{} for _ in range(count)]
        self._now_ns = 0
        self._last: list[NDArray[Any] | None] = [None] * count
        self._repeated = [Verdict("frozen for long") for _ in range(count)]
        # The silhouettes of all cameras when each one's last image was new.
        self._then: list[list[NDArray[Any] | None]] = [[None] * count for _ in range(count)]
        self._turned = [Verdict("turned") for _ in range(count)]
        # Each camera's first image with a silhouette, which the background is compared with.
        self._begun: list[tuple[Image, Silhouette] | None] = [None] * count
        self._moved = [Verdict("moved") for _ in range(count)]
        self._compared_ns = [0] * count

    def without(
        self, observations: Sequence[Observation | None], stamp_ns: int | None = None
    ) -> list[Observation | None]:
        """Return the observations of one time, None for cameras that are frozen or useless."""
        self._now_ns = (
            self._now_ns + round(1e9 * USUAL_INTERVAL_S) if stamp_ns is None else stamp_ns
        )
        count = len(self._last)
        seen = [*observations, *[None] * (count - len(observations))]
        now = [None if one is None else one.silhouette for one in seen]
        kept = [None if mask is None else np.array(mask) for mask in now]
        for number, one in enumerate(seen):
            mask = kept[number]
            if mask is not None and WATCHES["full"].is_beyond(np.count_nonzero(mask) / mask.size):
                self._leave_out(number, WATCHES["full"].words)
                seen[number] = None if one is None or one.points is None else one
            shown = None if one is None else one.image
            if shown is None and mask is not None and mask.any():
                # Without an image, only a person shows that a camera goes on.
                shown = mask
            last = self._last[number]
            is_same = shown is not None and last is not None and np.array_equal(last, shown)
            self._repeated[number].count(is_same)
            if shown is not None and not is_same:
                self._last[number], self._then[number] = np.array(shown), kept
            if one is not None and self._has_moved(number, one):
                self._leave_out(number, WATCHES["moved"].words)
                seen[number] = None
        frozen = [self._is_frozen(number, kept) for number in range(count)]
        for number in np.flatnonzero(frozen).tolist():
            self._leave_out(number, WATCHES["frozen"].words)
            seen[number] = None
        return seen

    def agreeing(self, frames: Sequence[Frame], agreement: CameraAgreement) -> list[Frame]:
        """Return the frames of one time, empty ones of cameras that contradict the others.

        If all of several further cameras contradict the first one, that is left out.
        """
        is_whole = agreement.look(frames)
        before = frames[0].points if is_whole else None
        reasons = [_POSE if fault else "" for fault in agreement.are_contradicted]
        for number, (frame, view) in enumerate(zip(frames[1:], agreement.views, strict=True)):
            if self.is_turned(number + 1, likeness(before, frame.points, view.yaw_rad)):
                reasons[number] = reasons[number] or WATCHES["turned"].words
        doubts = zip(reasons, agreement.are_doubtful, strict=True)
        self.is_contradicted = any(
            is_doubtful if not reason else len(reasons) == 1 for reason, is_doubtful in doubts
        ) or (len(reasons) == 1 and any(one.holds for one in self._moved))
        wrong = ["", *reasons]
        if len(reasons) > 1 and all(reasons):
            wrong = [reasons[0], *[""] * len(reasons)]
        kept = []
        for number, (frame, reason) in enumerate(zip(frames, wrong, strict=True)):
            if reason and frame.foreground_px:
                self._leave_out(number, reason)
                channels = {"silhouette": np.zeros_like(frame.silhouette)}
                frame = frame.changed(channels=channels, foreground_px=0)
            kept.append(frame)
        return kept

    def _leave_out(self, camera: int, reason: str) -> None:
        count, _ = self._left_out[camera].get(reason, (0, 0))
        self._left_out[camera][reason] = count + 1, self._now_ns

    def _is_frozen(self, number: int, now: Sequence[NDArray[Any] | None]) -> bool:
        repeated = self._repeated[number]
        if repeated.value < _LEAST:
            return False
        moved = max(
            _change(before, there)
            for other, (before, there) in enumerate(zip(self._then[number], now, strict=True))
            if other != number
        )
        return moved > 0.0 if repeated.holds else WATCHES["frozen"].is_beyond(moved)

    def is_turned(self, camera: int, alike: float) -> bool:
        """Return whether somebody has faced another way than in the first camera for some images.

        ``alike`` is the :func:`likeness` in this image, or nan.
        """
        if np.isfinite(alike):
            self._turned[camera].see(alike)
        return self._turned[camera].holds

    def _has_moved(self, number: int, seen: Observation) -> bool:
        """Return whether a camera stands elsewhere than in its first images, by the background."""
        begun, moved = self._begun[number], self._moved[number]
        if seen.image is None or seen.silhouette is None:
            return moved.holds
        if begun is None or seen.is_cut:
            # Corners at the outline of people are theirs.
            side = 1 + seen.image.shape[1] // _AROUND
            people = (seen.silhouette != 0).astype(np.uint8)
            near = cv2.dilate(people, np.ones((side, side), np.uint8))
            self._begun[number] = np.array(seen.image), np.asarray(1 - near)
        elif self._now_ns - self._compared_ns[number] >= _COMPARED_NS:
            self._compared_ns[number] = self._now_ns
            shift = background_shift(begun[0], seen.image, begun[1])
            if shift is not None:
                moved.see(100.0 * shift)
        return moved.holds

    def remarks(self, names: Sequence[str] = (), is_all: bool = False) -> list[str]:
        """Return a warning for each camera that is left out now, with ``is_all`` also before."""
        count = len(self._left_out)
        names = names or [f"camera {number} of {count}" for number in range(1, count + 1)]
        return [
            reason.format(name=name, count=images)
            for name, reasons in zip(names, self._left_out, strict=True)
            for reason, (images, told_ns) in reasons.items()
            if is_all or 0 <= self._now_ns - told_ns <= _TOLD_NS
        ]


def likeness(before: ImagePoints | None, now: ImagePoints | None, yaw_rad: float) -> float:
    """Return the correlation of one person's points in space in two cameras; nan without them.

    The level frame of the second camera is turned by ``yaw_rad`` about the vertical.
    """
    if before is None or now is None or before.spatial_m is None or now.spatial_m is None:
        return float("nan")
    places = np.concatenate([before.spatial_m, now.spatial_m], axis=1)
    known = (np.minimum(before.scores, now.scores) >= CERTAIN) & np.isfinite(places).all(axis=1)
    if np.count_nonzero(known) < LEAST_POINTS:
        return float("nan")
    one, other = np.hsplit(places[known] - places[known].mean(axis=0), 2)
    # The points are right, down and away; yaw turns from right towards the camera.
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    turned = one @ np.array([(c, 0.0, -s), (0.0, 1.0, 0.0), (s, 0.0, c)])
    return float(np.sum(turned * other) / max(np.linalg.norm(one) * np.linalg.norm(other), 1e-9))


def _change(before: NDArray[Any] | None, now: NDArray[Any] | None) -> float:
    """Return the share of a silhouette that changed; 0 if one is missing."""
    if before is None or now is None or before.shape != now.shape:
        return 0.0
    changed, area = np.count_nonzero(before != now), np.count_nonzero(before)
    return float(changed) / max(float(area), 1.0)
