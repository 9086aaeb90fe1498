"""Detection of inverted extrinsics, exchanged images and other gross errors of a camera's pose.

The planes through both cameras that touch the person from above touch both silhouettes
(:mod:`cardbox_tracker.measuring.silhouette_tangents`), for any posture and body. An error of the
heights by degrees therefore shows a wrong pose within seconds, also while no posture fits. If the
heights agree for the inverse pose, the pose is inverted or the images are exchanged.
"""

from __future__ import annotations

from collections import deque
from enum import Enum

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.measuring.silhouette_tangents import TopTangents
from cardbox_tracker.terms.term import Silhouette

# Samples in a window, and the least number for a verdict.
_WINDOW, _LEAST = 15, 6
# Frames between samples, and between those of the first frames, so that a verdict comes early.
_EVERY, _EVERY_AT_FIRST, _FIRST = 6, 2, 60
# Least median heights of an inverted pose and of any wrong pose, rad. Right poses have at most
# 0.7 degrees (docs/research.md#several-cameras).
_INVERTED_RAD, _WRONG_RAD = np.radians(0.3), np.radians(2.5)
# An inverted pose's height is more than that of its inverse divided by this.
_BETTER = 0.25


class PoseFault(Enum):
    """A gross error of a camera's pose."""

    INVERTED = "inverted"
    CONTRADICTED = "contradicted"


class PoseDirection:
    """Compares the heights of one further camera's tangents for its pose and the inverse pose."""

    def __init__(self, first: Camera, other: Camera, given: Extrinsics, roll_rad: float) -> None:
        """Begin without samples; ``other``, of the pose ``given``, was turned upright by a roll."""
        self._tangents = TopTangents(first, other, most=1)
        # The images have been turned by the roll of the given pose, even if that pose is inverted.
        c, s = np.cos(roll_rad), np.sin(roll_rad)
        roll = np.array([(c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)])
        raw = Extrinsics(roll @ given.rotation, roll @ given.translation_m).inverse()
        inverse = Extrinsics(roll.T @ raw.rotation, roll.T @ raw.translation_m)
        self._pencils = [self._tangents.pencil(pose) for pose in (given, inverse)]
        self._per_px = 1.0 / other.fx
        self._heights_rad = deque[tuple[float, float]](maxlen=_WINDOW)
        self._frames = 0
        self.fault: PoseFault | None = None
        """The error according to the latest samples; None for a pose without a gross error."""
        self.height_rad = 0.0
        """Median distance between both cameras' tangent planes, rad."""

    def see(self, first: Silhouette, other: Silhouette) -> None:
        """Add a frame with silhouettes (H, W), 0 or 255, whether a posture fits them or not."""
        self._frames += 1
        # An error that is over is forgotten as soon as it was found.
        is_often = self._frames <= _FIRST or self.fault is not None
        if self._frames % (_EVERY_AT_FIRST if is_often else _EVERY):
            return
        if not self._tangents.add(first, other):
            return
        heights = [float(self._tangents.heights(pencil)[0]) for pencil in self._pencils]
        given, inverse = (abs(height) * self._per_px for height in heights)
        if not np.isfinite(given):
            return
        # The inverse pose is no better if it does not even show the top.
        self._heights_rad.append((given, inverse if np.isfinite(inverse) else np.inf))
        if len(self._heights_rad) >= _LEAST:
            self._judge()

    def _judge(self) -> None:
        given, inverse = np.median(np.array(self._heights_rad), axis=0).tolist()
        self.height_rad, self.fault = given, None
        if given > _INVERTED_RAD and inverse < _BETTER * given:
            self.fault = PoseFault.INVERTED
        elif given > _WRONG_RAD:
            self.fault = PoseFault.CONTRADICTED
