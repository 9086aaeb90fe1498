"""Finds the connected regions of a binary image and removes small ones.

Pixels are connected by their sides (4 neighbours).
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.array_checks import ANY, check_array
from cardbox_tracker.segmentation.window import Window, window_of

ImageArray = NDArray[np.uint8]

SQUARE = np.ones((3, 3), np.uint8)
"""A pixel and its eight neighbours, for morphology."""

LEAST_AREA, MOST_HOLE = 0.004, 0.0008
"""Least area of a region of the foreground, and area below which a hole is filled, as shares of the
image."""


def disk(radius_px: float) -> NDArray[np.uint8]:
    """Return a disk of a radius of at least 1 px, for morphology."""
    size = 2 * max(round(radius_px), 1) + 1
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)), np.uint8)


class Regions(NamedTuple):
    """Connected regions of a binary image."""

    #: number of the region of each pixel, (H, W), from 1 on in the order of the first pixels; 0 for
    #: pixels of none
    labels: NDArray[np.int32]
    areas_px: NDArray[np.int64]  #: number of pixels of each region, (m,)


def clean_silhouette(
    foreground: ImageArray, min_area: float, max_hole: float, window: Window | None = None
) -> ImageArray:
    """Return a binary image (H, W), 0 or 255, without small specks and holes.

    ``min_area`` and ``max_hole`` are fractions of the image; ``window`` contains all foreground.
    Raises ValueError if the image is of another type or layout.
    """
    return clean_in_window(foreground, min_area, max_hole, window)[0]


def clean_in_window(
    foreground: ImageArray, min_area: float, max_hole: float, window: Window | None = None
) -> tuple[ImageArray, Window]:
    """Return what :func:`clean_silhouette` does, and the window of its foreground.

    The window's columns are multiples of 8 if the image's width and the given window's are.
    """
    check_array("foreground", foreground, (ANY, ANY))
    silhouette = np.zeros(foreground.shape, np.uint8)
    if not foreground.size or (window is not None and window.is_empty):
        return silhouette, Window(0, 0, 0, 0)
    # Background in a window is at least as long as a side; unless holes are smaller than that, the
    # whole image is used.
    sides = () if window is None else (window.bottom - window.top, window.right - window.left)
    if window is None or max_hole * foreground.size > min(sides):
        window = Window(0, foreground.shape[0], 0, foreground.shape[1])
    # Closing joins parts that noise separated; opening would remove thin fingers.
    part = foreground[window.slices]
    closed = np.asarray(cv2.morphologyEx(part, cv2.MORPH_CLOSE, SQUARE), np.uint8)
    check_array("part of the foreground", closed, part.shape, is_written=True)
    _recolour(closed, 255, min_area * foreground.size)
    _recolour(closed, 0, max_hole * foreground.size)
    silhouette[window.slices] = closed
    inside = window_of(closed)
    if inside.is_empty:
        return silhouette, Window(0, 0, 0, 0)
    offsets = window.top, window.top, window.left, window.left
    edges = (edge + offset for edge, offset in zip(inside, offsets, strict=True))
    return silhouette, Window(*edges)


def _recolour(image: ImageArray, colour: int, area_px: float) -> None:
    """Invert regions of ``colour``, 0 or 255, with fewer than ``area_px`` pixels, in place."""
    regions = find_regions(image if colour else ~image)
    paint(regions, regions.areas_px < area_px, 255 - colour, image)


def flooded(start: NDArray[np.bool_], passable: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the ``passable`` pixels (H, W) that ``start`` (H, W) reaches over sides of pixels."""
    count, found = cv2.connectedComponents(passable.astype(np.uint8), connectivity=4)
    labels = found.reshape(passable.shape)
    is_reached = np.zeros(count, np.bool_)
    is_reached[labels[start & passable]] = True
    reached: NDArray[np.bool_] = is_reached[labels]
    return reached


def find_regions(image: ImageArray) -> Regions:
    """Return the connected regions of the pixels of ``image`` (H, W), uint8, that are 255."""
    check_array("image", image, (ANY, ANY))
    _, found = cv2.connectedComponents((image == 255).view(np.uint8), connectivity=4)
    labels = np.asarray(found, np.int32).reshape(image.shape)
    # OpenCV's own statistics take five times as long.
    return Regions(labels, np.bincount(labels.ravel())[1:])


def paint(regions: Regions, chosen: NDArray[np.bool_], colour: int, image: ImageArray) -> None:
    """Set the pixels of the ``chosen`` regions (m,) to a colour."""
    if chosen.any():
        np.putmask(image, np.append(False, chosen).take(regions.labels), colour)
