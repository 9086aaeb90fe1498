"""Combines models of the scene from times in which a person hid different parts of it.

The person is located by motion: the outline of a standing person sways, and the area that it
encloses, down to the lower border, is hidden. A hidden pixel stays hidden until its brightness has
changed and nothing moves there any more.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.segmentation.chroma import ChromaModel
from cardbox_tracker.segmentation.empty_scene import BackgroundModel
from cardbox_tracker.segmentation.regions import disk
from cardbox_tracker.segmentation.scene_motion import changed_pixels

Mask = NDArray[np.bool_]
FloatImage = NDArray[np.float32]

MARGIN = 0.03
"""Margin of a person's pixels as a share of the image's width; moving parts of an outline whose
margins touch are one body."""
# Moving regions below this share of the image are noise.
_LEAST = 0.0005
# Hidden rests below this share of the image are filled from their surroundings.
_REST = 0.002
_REST_RADIUS_PX = 3.0


class PartialScene:
    """Combines models of the scene, each of which is valid outside the person."""

    def __init__(self) -> None:
        self._model: BackgroundModel | None = None
        self._known: Mask | None = None
        self._first = np.empty((0, 0), np.float32)

    @property
    def hidden(self) -> float:
        """Share of the scene that has not been seen yet."""
        return 1.0 if self._known is None else float(1.0 - np.mean(self._known))

    @property
    def is_whole(self) -> bool:
        """Whether only small specks are still hidden."""
        return self._known is not None and self.hidden <= _REST

    def add(self, model: BackgroundModel, moved: Mask) -> None:
        """Add mean and deviation (H, W) of a span of time, but not where something ``moved``."""
        size = model.mean.shape[1], model.mean.shape[0]
        body = bodies(_resized(moved, size))
        if self._model is None or self._known is None:
            self._model, self._known, self._first = model, ~body, model.mean
            return
        left = bodies(changed_pixels(self._first, model.mean) & ~self._known)
        new = ~self._known & ~body & (left | ~_touching(~self._known, body))
        both, level = self._known & ~body, 1.0
        if both.any():
            # The new part is put into the light of the known one.
            level = float(np.median(self._model.mean[both] / np.maximum(model.mean[both], 1.0)))
        light = np.full(new.shape, level, np.float32)
        self._model = merged(self._model, model, new, light)
        self._known = self._known | new

    def model(self) -> BackgroundModel:
        """Return the whole scene; ValueError if a part larger than a speck is hidden."""
        if self._model is None or self._known is None or not self.is_whole:
            raise ValueError(f"{100 * self.hidden:.1f} % of the scene was not seen yet")
        if self._known.all():
            return self._model
        unknown = ~self._known
        mean = _filled(self._model.mean, unknown)
        stddev = _filled(self._model.stddev, unknown)
        chroma = self._model.chroma
        if chroma is not None:
            small = _resized(unknown, chroma.mean.shape[:0:-1])
            planes = [np.stack([_filled(p, small) for p in part]) for part in chroma]
            chroma = ChromaModel(*planes)
        return BackgroundModel(mean, stddev, chroma)


def bodies(moved: Mask) -> Mask:
    """Return a mask (H, W) of possible persons, given the pixels (H, W) that moved.

    Regions that are near each other form one body: their convex hull with a margin, and everything
    below it, since feet do not sway.
    """
    height, width = moved.shape
    image = moved.astype(np.uint8)
    _, regions, statistics, _ = cv2.connectedComponentsWithStats(image, connectivity=8)
    image[(statistics[:, cv2.CC_STAT_AREA] < _LEAST * moved.size)[regions]] = 0
    near = cv2.dilate(image, disk(MARGIN * width))
    labels, regions = cv2.connectedComponents(near, connectivity=8)
    result = np.zeros(moved.shape, np.uint8)
    for label in range(1, labels):
        v, u = np.nonzero((regions == label) & (image > 0))
        if len(u):
            points = np.stack([u, v], axis=1).astype(np.int32)
            below = points.copy()
            below[:, 1] = height - 1
            cv2.fillConvexPoly(result, cv2.convexHull(np.concatenate([points, below])), 1)
    return np.asarray(cv2.dilate(result, disk(MARGIN * width)) > 0, np.bool_)


def _touching(mask: Mask, body: Mask) -> Mask:
    """Return the regions of ``mask`` that touch ``body``."""
    labels, regions = cv2.connectedComponents((mask | body).astype(np.uint8), connectivity=8)
    touching = np.zeros(labels, np.bool_)
    touching[np.unique(regions[body])] = True
    return np.asarray(mask & touching[regions], np.bool_)


def _resized(mask: Mask, size: tuple[int, ...]) -> Mask:
    """Return the mask at another size (width, height); a pixel is set if any part of it is."""
    whole = cv2.resize(mask.astype(np.float32), (size[0], size[1]), interpolation=cv2.INTER_AREA)
    return np.asarray(whole > 0, np.bool_)


def merged(
    known: BackgroundModel, other: BackgroundModel, new: Mask, light: FloatImage
) -> BackgroundModel:
    """Return a model with the pixels ``new`` (H, W) of another one, times the factors ``light``."""
    mean = np.where(new, other.mean * light, known.mean)
    stddev = np.where(new, other.stddev, known.stddev)
    if known.chroma is None or other.chroma is None:
        return BackgroundModel(mean, stddev)
    size = known.chroma.mean.shape[:0:-1]
    small = _resized(new, size)
    neutral = np.array([0.0, 128.0, 128.0], np.float32)[:, None, None]
    colors = (other.chroma.mean - neutral) * cv2.resize(light, size) + neutral
    chroma = ChromaModel(
        np.where(small, colors, known.chroma.mean),
        np.where(small, other.chroma.stddev, known.chroma.stddev),
    )
    return BackgroundModel(mean, stddev, chroma)


def _filled(plane: FloatImage, unknown: Mask) -> FloatImage:
    filled = cv2.inpaint(plane, unknown.astype(np.uint8), _REST_RADIUS_PX, cv2.INPAINT_NS)
    return np.asarray(filled, np.float32)
