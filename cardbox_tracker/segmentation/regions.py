"""Finds the connected regions of a binary image and removes small ones.

Pixels are connected by their sides (4 neighbours). A region is a list of runs, joined with a
union-find forest: a silhouette has about a thousand runs but tens of thousands of pixels, and long
runs are skipped eight pixels at a time. This is faster than labelling every pixel with OpenCV and
recolouring the small regions in further passes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.array_checks import ANY, check_array
from cardbox_tracker.common.compiling import copied_kernel, kernel
from cardbox_tracker.segmentation.window import Window, window_of

ImageArray = NDArray[np.uint8]

NO_WORDS = np.zeros((1, 0), np.uint64)
"""Stands for the words of eight pixels of an image whose width is no multiple of eight."""
LOW_BITS = np.uint64(0x0101010101010101)
"""The lowest bit of each of eight bytes."""
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
    """Connected regions of a binary image as runs of pixels, row by row."""

    rows: NDArray[np.int32]  #: row of each run, (n,)
    starts: NDArray[np.int32]  #: first column of each run, (n,)
    ends: NDArray[np.int32]  #: column after the last of each run, (n,)
    #: region of each run, (n,), counted from 0 in the order of the first pixels.
    labels: NDArray[np.int32]
    areas_px: NDArray[np.int32]  #: number of pixels of each region, (m,)


def clean_silhouette(
    foreground: ImageArray, min_area: float, max_hole: float, window: Window | None = None
) -> tuple[ImageArray, Window]:
    """Return a binary image (H, W), 0 or 255, without small specks and holes, and its window.

    ``min_area`` and ``max_hole`` are fractions of the image; ``window`` contains all foreground.
    The columns of the window of what is left are multiples of 8 if the image's width and the given
    window's are. Raises ValueError if the image is of another type or layout.
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
    paint(*regions[:4], regions.areas_px < area_px, np.uint8(255 - colour), image)


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
    # A read-only array would make numba compile another version.
    image = np.require(image, requirements=("C", "W", "A"))
    check_array("image", image, (ANY, ANY))
    height, width = image.shape
    words = image.view(np.uint64) if width % 8 == 0 else NO_WORDS
    runs = np.empty((4, height * (width // 2 + 1)), np.int32)
    firsts = np.empty(height + 1, np.int32)
    count = _list_runs(image, words, np.uint8(255), runs, firsts)
    rows = np.empty(count, np.int32)
    regions = _number_regions(firsts, runs, rows)
    starts, ends, labels, areas = runs[:, :count]
    return Regions(rows, starts, ends, labels, areas[:regions])


@copied_kernel
def _root(parents: Any, run: Any) -> Any:
    """Return the root run of a region, with path compression."""
    while parents[run] != run:
        parents[run] = parents[parents[run]]
        run = parents[run]
    return run


@copied_kernel
def _end_of(image: Any, words: Any, v: Any, u: Any, colour: Any) -> Any:
    """Return the first column of row ``v`` from ``u`` on that is not of ``colour``."""
    # With unsigned indices, numba compiles no code for negative ones.
    row, column, width = np.uint64(v), np.uint64(u), np.uint64(image.shape[1])
    word, one, three = np.uint64(colour) * LOW_BITS, np.uint64(1), np.uint64(3)
    last = np.uint64(words.shape[1])
    while column < width and image[row, column] == colour:
        column += one
        if column & np.uint64(7) == np.uint64(0):
            w = column >> three
            while w < last and words[row, w] == word:
                w += one
            column = w << three if last > np.uint64(0) else column
    return np.int64(column)


@kernel
def _list_runs(image: Any, words: Any, colour: Any, runs: Any, firsts: Any) -> Any:
    """Write start, end, parent and area (valid at roots) of each run; return their number."""
    starts, ends, parents, areas = runs[0], runs[1], runs[2], runs[3]
    height, width = image.shape
    other = np.uint8(255) - colour
    count = 0
    above = 0
    for v in range(height):
        firsts[v] = count
        u = _end_of(image, words, v, 0, other)
        while u < width:
            end = _end_of(image, words, v, u, colour)
            if end == u:
                # A pixel of neither colour belongs to no region.
                u += 1
                continue
            starts[count], ends[count] = u, end
            parents[count], areas[count] = count, end - u
            # Runs above that end before this one begins touch none of the following runs.
            while above < firsts[v] and ends[above] <= u:
                above += 1
            touching = above
            while touching < firsts[v] and starts[touching] < end:
                one, two = _root(parents, touching), _root(parents, count)
                if one != two:
                    # The run with the smaller number becomes the root.
                    first, second = min(one, two), max(one, two)
                    parents[second] = first
                    areas[first] += areas[second]
                touching += 1
            count += 1
            u = _end_of(image, words, v, end, other)
        above = firsts[v]
    firsts[height] = count
    return count


@kernel
def _number_regions(firsts: Any, runs: Any, rows: Any) -> Any:
    """Replace parents by region numbers and write their areas; return the number of regions."""
    parents, areas = runs[2], runs[3]
    count = 0
    for v in range(len(firsts) - 1):
        for run in range(firsts[v], firsts[v + 1]):
            rows[run] = v
            root = parents[run]
            # A root precedes the other runs of its region, so it already has its number.
            if root == run:
                areas[count] = areas[run]
                parents[run] = count
                count += 1
            else:
                parents[run] = parents[root]
    return count


@kernel
def paint(
    rows: Any, starts: Any, ends: Any, labels: Any, chosen: Any, colour: Any, image: Any
) -> None:
    """Set the pixels of the chosen regions, whose runs are given, to a colour."""
    for run in range(len(rows)):
        if chosen[labels[run]]:
            image[rows[run], starts[run] : ends[run]] = colour
