"""Classifies the pixels that differ enough from the background as foreground.

A single pass over the image replaces six of OpenCV, so that the rows stay in the cache. It also
finds the window of the foreground.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.array_checks import ANY, check_array
from cardbox_tracker.common.compiling import kernel
from cardbox_tracker.segmentation.window import Window, find_edges

FloatImage = NDArray[np.float32]
ImageArray = NDArray[np.uint8]


def segment_foreground(
    difference: FloatImage,
    brighter: FloatImage,
    darker: FloatImage,
    edge: float,
    score: FloatImage,
) -> tuple[ImageArray, Window]:
    """Mark the pixels whose score is at least 1 and at least ``edge`` times their neighbours'.

    The score of a difference is the larger of its products with ``brighter`` and ``darker``.

    Args:
        difference: image minus background, (H, W), grey levels.
        brighter: score of one grey level more than the background, (H, W).
        darker: negative score of one grey level less, (H, W).
        edge: smallest score of a foreground pixel, as a fraction of the highest score among it and
            its 8 neighbours.
        score: scratch, (H, W).

    Returns:
        (H, W), 0 or 255, and its window as :func:`~.window.window_of` has it.

    Raises:
        ValueError: the arrays differ in shape, or one is read-only.
    """
    check_array("difference", difference, (ANY, ANY), np.float32, is_written=True)
    shape = difference.shape
    check_array("brighter", brighter, shape, np.float32, is_written=True)
    check_array("darker", darker, shape, np.float32, is_written=True)
    check_array("score", score, shape, np.float32, is_written=True)
    foreground = np.empty(shape, np.uint8)
    edges = _foreground(difference, brighter, darker, np.float32(edge), score, foreground)
    return foreground, Window(*edges)


@kernel
def _foreground(
    difference: Any, brighter: Any, darker: Any, edge: Any, score: Any, foreground: Any
) -> Any:
    """Write the foreground (H, W), and return the edges of its window."""
    height, width = difference.shape
    one = np.float32(1)
    for v in range(height):
        for u in range(width):
            value = difference[v, u]
            score[v, u] = max(value * brighter[v, u], value * darker[v, u])
    # Maximum over three rows, with a margin that is never the maximum.
    columns = np.full(width + 2, np.float32(-np.inf))
    for v in range(height):
        above, here, below = score[max(v - 1, 0)], score[v], score[min(v + 1, height - 1)]
        for u in range(width):
            columns[u + 1] = max(max(above[u], here[u]), below[u])
        for u in range(width):
            limit = edge * max(max(columns[u], columns[u + 1]), columns[u + 2])
            foreground[v, u] = 255 * ((here[u] >= limit) & (here[u] >= one))
    return find_edges(foreground)
