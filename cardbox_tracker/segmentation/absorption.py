"""Absorbs objects that were moved and stay, such as a door left open, into the background.

A standing person sways, so means over fifteen images differ along the edges of the body. They do
not differ along an object, nor at the place from which one was removed. A region of the silhouette
is therefore taken as an object if hardly any pixel in it or near it has changed for many images. A
region that a person touches in the image stays foreground.
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.array_checks import ANY, check_array
from cardbox_tracker.segmentation.empty_scene import BackgroundLearner, BackgroundModel
from cardbox_tracker.segmentation.regions import disk
from cardbox_tracker.segmentation.scene_motion import SCALE, SMOOTHING_PX, changed_pixels

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]
Mask = NDArray[np.bool_]

# A pixel has changed if it differs by more than this multiple of the noise.
_TIMES_NOISE = 4.0
# Images a mean is computed from; this many reduce the noise to a quarter.
_BLOCK = 15
# Images that follow the last one used in less time are skipped, since nobody sways that fast.
_SPACING_NS = 50_000_000
# A region is still if at most this share of it, its surroundings and its outline has changed;
# docs/evaluation/silhouettes.md has the shares of objects and people.
STILL = 0.08
_NEAR_PX = 8


class StillRegions:
    """Detects regions of the silhouettes that do not move at all, one image at a time."""

    def __init__(self, images: int) -> None:
        """Start without images; a region that stays still for ``images`` images is an object."""
        self._blocks = max(2, -(-images // _BLOCK))
        self._count = 0
        self._sum = np.zeros((0, 0), np.uint16)
        self._seen = np.zeros((0, 0), np.uint8)
        self._before: FloatImage | None = None
        self._still = np.zeros((0, 0), np.int32)

    def add(self, brightness: ImageArray, silhouette: ImageArray, level: float) -> Mask | None:
        """Add an image and its silhouette, both (H, W) uint8; ``level`` is the light's factor.

        Returns, every fifteenth time, a mask (H, W) of the objects that stay, and None in between.
        Raises ValueError if images are of another type or layout, differ in shape, or have no
        pixels.
        """
        check_array("brightness", brightness, (ANY, ANY))
        check_array("silhouette", silhouette, brightness.shape)
        if not brightness.size:
            raise ValueError(f"brightness has the shape {brightness.shape}; expected pixels")
        height, width = brightness.shape
        size = max(width // SCALE, 1), max(height // SCALE, 1)
        if self._count == 0:
            self._sum = np.zeros(size[::-1], np.uint16)
            self._seen = np.zeros(size[::-1], np.uint8)
        check_array("sum of the images before it", self._sum, size[::-1], np.uint16)
        seen = cv2.resize(silhouette, size, interpolation=cv2.INTER_AREA)
        small = cv2.resize(brightness, size, interpolation=cv2.INTER_AREA)
        self._sum += np.asarray(small, np.uint8).reshape(self._sum.shape)
        self._seen |= np.asarray(seen, np.uint8).reshape(self._seen.shape)
        self._count += 1
        if self._count < _BLOCK:
            return None
        self._count = 0
        now = self._sum.astype(np.float32) / np.float32(_BLOCK * level)
        now = np.asarray(cv2.GaussianBlur(now, (0, 0), SMOOTHING_PX), np.float32)
        if self._before is None:
            self._before, self._still = now, np.ones(now.shape, np.int32)
        else:
            changed = changed_pixels(self._before, now, _TIMES_NOISE)
            self._still = np.where(changed, 1, self._still + 1)
            self._before = np.where(changed, now, self._before)
        things = self._things()
        if not things.any():
            return np.zeros((height, width), np.bool_)
        whole = cv2.resize(
            things.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST
        )
        return np.asarray(whole > 0, np.bool_)

    def _things(self) -> Mask:
        things = np.zeros(self._seen.shape, np.bool_)
        if (self._still >= self._blocks).any():
            for region, share in self.regions():
                if share <= STILL:
                    things |= region
        return things

    def regions(self) -> Iterator[tuple[Mask, float]]:
        """Yield each region of the last fifteen silhouettes and the share of it that moves.

        Regions are masks (H / 2, W / 2), shares are 0 to 1. The surroundings of a region count as
        part of it, so that a head is not separated where the neck has the colour of the wall.
        """
        moves = (self._still < self._blocks).astype(np.uint8)
        joined = cv2.dilate(self._seen, disk(_NEAR_PX // SCALE))
        count, labels = cv2.connectedComponents(joined, connectivity=8)
        for number in range(1, count):
            region = ((labels == number) & (self._seen > 0)).astype(np.uint8)
            near = cv2.dilate(region, disk(_NEAR_PX // SCALE))
            outline = near - cv2.erode(region, disk(_NEAR_PX // 2 // SCALE))
            yield region > 0, max(cv2.mean(moves, part)[0] for part in (near, outline))


class Absorber:
    """Learns the appearance of objects that stay, to add them to the background."""

    def __init__(self, images: int) -> None:
        """Start without images; a region that stays still for ``images`` images is learned."""
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
        """Return pixels (H, W) that have become background, and a model of them as they look.

        None if there are none. The image is grey (H, W) or bgr (H, W, 3), the silhouette (H, W) 0
        or 255; ``level`` is the brightness of the scene relative to the learned background. An
        image whose stamp is less than 50 ms after the last one is skipped.
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
                around = cv2.dilate(things.astype(np.uint8), disk(_NEAR_PX)) > 0
                others = (self._others > 0) & ~things
                absorbed = around & ~others, self._learner.model()
        self._things = found if found.any() else None
        self._others = np.zeros_like(silhouette)
        self._learner = BackgroundLearner()
        return absorbed

    def _is_too_soon(self, stamp_ns: int) -> bool:
        """Return whether an image follows the last one used too closely."""
        last_ns = self._last_ns
        if stamp_ns and last_ns is not None and 0 <= stamp_ns - last_ns < _SPACING_NS:
            return True
        self._last_ns = stamp_ns or None
        return False
