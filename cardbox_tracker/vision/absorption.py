"""Finds what was moved and stays, such as a door left open, so that it becomes background.

Whoever stands before a camera sways: means over fifteen images differ along every edge of the body.
Of a thing, or of the place that one was taken from, they do not. A region of the silhouette is a
thing if hardly any pixel in it or near it has changed for many images. Somebody who touches it in
the image keeps all of it foreground.
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.vision.empty_scene import BackgroundLearner, BackgroundModel
from cardbox_tracker.vision.scene_motion import changed_pixels

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]
Mask = NDArray[np.bool_]

# Motion is looked for at a quarter of the pixels, the noise of which is halved.
_SCALE = 2
_SMOOTHING_PX = 0.8
_LEAST_LEVEL = 1e-3
# A pixel has changed by so many times the noise: chance does that to one in some thousand.
_TIMES_NOISE = 4.0
# Images that a mean is made of: a second at 15 Hz, so that noise is a quarter of an image's.
_BLOCK = 15
# Images that follow each other more closely, as at more than 20 Hz, do not all count.
_SPACING_NS = 50_000_000
# A region is still if no larger share of it with what is near, and of its outline, has changed
# in so many images. In 300 of them, of things 0.5 % changes, and up to 9 % where hands pass by; of
# people of eleven sessions, who sway by 3 mm, 54 % or more, of one who stands for a minute 38 %,
# of one who sways by 1 mm in strong noise 25 % (docs/evaluation/silhouettes.md).
STILL = 0.08
_NEAR_PX = 8
# An edge is blurred by the smoothing, and colours are compared at half the resolution.
_EDGE_PX = 5


class StillRegions:
    """Tells which regions of the silhouettes have stayed perfectly still, one image at a time."""

    def __init__(self, images: int) -> None:
        """Start with nothing seen; what stays still for so many ``images`` is a thing."""
        self._blocks = max(2, -(-images // _BLOCK))
        self._count = 0
        self._sum = np.zeros((0, 0), np.float32)
        self._seen = np.zeros((0, 0), np.uint8)
        self._before: FloatImage | None = None
        self._still = np.zeros((0, 0), np.int32)

    def add(self, brightness: ImageArray, silhouette: ImageArray, level: float) -> Mask | None:
        """Look at an image and its silhouette, both (H, W), in a light ``level`` times the first.

        Returns:
            Every fifteenth time, the pixels (H, W) of things that stay; None in between.
        """
        height, width = brightness.shape
        size = max(width // _SCALE, 1), max(height // _SCALE, 1)
        seen = cv2.resize(silhouette, size, interpolation=cv2.INTER_AREA)
        if self._count == 0:
            self._sum = np.zeros(size[::-1], np.float32)
            self._seen = np.zeros(size[::-1], np.uint8)
        cv2.accumulate(cv2.resize(brightness, size, interpolation=cv2.INTER_AREA), self._sum)
        cv2.bitwise_or(self._seen, seen, dst=self._seen)
        self._count += 1
        if self._count < _BLOCK:
            return None
        self._count = 0
        now = self._sum / np.float32(_BLOCK * max(level, _LEAST_LEVEL))
        now = np.asarray(cv2.GaussianBlur(now, (0, 0), _SMOOTHING_PX), np.float32)
        if self._before is None:
            self._before, self._still = now, np.ones(now.shape, np.int32)
        else:
            changed = changed_pixels(self._before, now, _TIMES_NOISE)
            self._still = np.where(changed, 1, self._still + 1)
            self._before = np.where(changed, now, self._before)
        things = self._things().astype(np.uint8)
        whole = cv2.resize(things, (width, height), interpolation=cv2.INTER_NEAREST)
        return np.asarray(whole > 0, np.bool_)

    def _things(self) -> Mask:
        things = np.zeros(self._seen.shape, np.bool_)
        if (self._still >= self._blocks).any():
            for region, share in self.regions():
                if share <= STILL:
                    things |= region
        return things

    def regions(self) -> Iterator[tuple[Mask, float]]:
        """Yield the regions of the last fifteen silhouettes, and how much of each moves.

        Regions are (H / 2, W / 2), shares from 0 to 1. What is near a region is part of it, so that
        a head is not left alone where the neck has the colour of the wall.
        """
        moves = (self._still < self._blocks).astype(np.uint8)
        joined = cv2.dilate(self._seen, _disk(_NEAR_PX // _SCALE))
        count, labels = cv2.connectedComponents(joined, connectivity=8)
        for number in range(1, count):
            region = ((labels == number) & (self._seen > 0)).astype(np.uint8)
            near = cv2.dilate(region, _disk(_NEAR_PX // _SCALE))
            outline = near - cv2.erode(region, _disk(_NEAR_PX // 2 // _SCALE))
            yield region > 0, max(cv2.mean(moves, part)[0] for part in (near, outline))


class Absorber:
    """Learns what things that stay look like, to become background."""

    def __init__(self, images: int) -> None:
        """Start with nothing seen; what stays still for so many ``images`` is learned."""
        self._images = images
        self.restart()

    def restart(self) -> None:
        """Forget all images."""
        self._regions = StillRegions(self._images)
        self._things: Mask | None = None
        self._others = np.zeros((0, 0), np.uint8)
        self._learner = BackgroundLearner()
        self._last_ns: int | None = None

    def add(
        self,
        image: ImageArray,
        brightness: ImageArray,
        silhouette: ImageArray,
        level: float,
        stamp_ns: int = 0,
    ) -> tuple[Mask, BackgroundModel] | None:
        """Look at an image, grey (H, W) or bgr (H, W, 3), and its silhouette (H, W).

        Args:
            image: as the extractor got it.
            brightness: of it, (H, W).
            silhouette: 0 or 255.
            level: of the light, as a factor of what was learned.
            stamp_ns: of the image, 0 if unknown; nobody sways in images that follow too closely, so
                those are left out.

        Returns:
            Pixels (H, W) that have become background, and what they look like now; mostly None.
        """
        if self._is_too_soon(stamp_ns):
            return None
        if self._things is not None:
            self._learner.add(image)
            cv2.bitwise_or(self._others, silhouette, dst=self._others)
        found = self._regions.add(brightness, silhouette, level)
        if found is None:
            return None
        absorbed = None
        if self._things is not None:
            things = self._things & found
            if things.any():
                around = cv2.dilate(things.astype(np.uint8), _disk(_EDGE_PX)) > 0
                others = (self._others > 0) & ~things
                absorbed = around & ~others, self._learner.model()
        self._things = found if found.any() else None
        self._others = np.zeros_like(silhouette)
        self._learner = BackgroundLearner()
        return absorbed

    def _is_too_soon(self, stamp_ns: int) -> bool:
        """Whether an image follows the last one that counted too closely."""
        last_ns = self._last_ns
        if stamp_ns and last_ns is not None and 0 <= stamp_ns - last_ns < _SPACING_NS:
            return True
        self._last_ns = stamp_ns or None
        return False


def _disk(radius_px: int) -> ImageArray:
    size = 2 * radius_px + 1
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)), np.uint8)
