"""Detection of depth images that show another view than the silhouettes.

The depth image of another camera may have the same size. If it belongs to the silhouettes' camera,
the depth grows at the person's outline, since what is seen beside a person is farther away. Pairs
of pixels on both sides of the outline are compared: anywhere else in a depth image, the depth
shrinks as often as it grows. ``docs/research.md#several-cameras`` has figures.
"""

from __future__ import annotations

from collections import deque

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.terms.term import DepthImage, Silhouette

# Pixels between a point of the outline and each pixel of its pair, as a share of the image's width.
_AWAY = 0.02
# Least jump, m, and share of the depth by which a sensor's noise may exceed it.
_JUMP_M, _JUMP_SHARE = 0.06, 0.02
# Depth of pixels without one, m.
_FAR_M = 100.0
# Fewest pairs of an image that count, and largest number that are compared.
_LEAST_PAIRS, _MOST_PAIRS = 20, 120
# Images in a window, and the fewest for a verdict; images between samples.
_WINDOW, _LEAST, _EVERY = 15, 6, 3
# Mean surpluses below which depth is refused, and above which it is taken again; depth of the
# same view has 0.5 and more, also from a pair of cameras.
_OTHER_VIEW, _SAME_VIEW = 0.25, 0.35


def surplus_of_jumps(silhouette: Silhouette, depth_m: DepthImage) -> float | None:
    """Return how much oftener the depth grows than shrinks across the outline, -1 to 1, or None.

    The value is a share of the pairs with a known depth, of which there must be some. A pixel
    without one counts as far away, because depth images may show the person alone. The silhouette
    is (H, W), 0 or 255; the depth (H, W), metres.
    """
    inner, outer = _pairs(silhouette)
    here, there = (
        np.where(np.isfinite(one) & (one > 0.0), one, _FAR_M)
        for one in (depth_m[at[:, 1], at[:, 0]] for at in (inner, outer))
    )
    nearer = np.minimum(here, there)
    if np.count_nonzero(nearer < _FAR_M) < _LEAST_PAIRS:
        return None
    jump_m = np.maximum(_JUMP_M, _JUMP_SHARE * nearer)
    grows, shrinks = there - here > jump_m, here - there > jump_m
    return float((grows.sum() - shrinks.sum()) / np.count_nonzero(nearer < _FAR_M))


def _pairs(silhouette: Silhouette) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return columns and rows of the inner and outer pixels, (N, 2) each, of one outline."""
    contours, _ = cv2.findContours(silhouette, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return np.zeros((0, 2), np.int64), np.zeros((0, 2), np.int64)
    outline = max(contours, key=len)[:, 0, :].astype(np.float64)
    height, width = silhouette.shape
    away = max(2.0, _AWAY * width)
    reach = max(2, round(away))
    # OpenCV walks down the left side of a region and up its right side.
    along = np.roll(outline, -reach, axis=0) - np.roll(outline, reach, axis=0)
    length = np.hypot(along[:, 0], along[:, 1])
    outward = np.column_stack([-along[:, 1], along[:, 0]]) / np.maximum(length, 1e-9)[:, None]
    some = slice(None, None, max(1, len(outline) // _MOST_PAIRS))
    inner = np.rint(outline[some] - away * outward[some]).astype(np.int64)
    outer = np.rint(outline[some] + away * outward[some]).astype(np.int64)
    last = np.array([width - 1, height - 1])
    is_inside = ((inner >= 0) & (inner <= last) & (outer >= 0) & (outer <= last)).all(axis=1)
    inner, outer = inner[is_inside], outer[is_inside]
    # At corners and thin parts a pair may not lie on both sides.
    is_across = (silhouette[inner[:, 1], inner[:, 0]] > 0) & (
        silhouette[outer[:, 1], outer[:, 0]] == 0
    )
    return inner[is_across], outer[is_across]


class DepthAgreement:
    """Says over about a second whether depth images show the view of the silhouettes.

    Attributes:
        is_other_view: whether the depth belongs to another view, so that it must not be used.
    """

    def __init__(self) -> None:
        """Trust the depth until images contradict it."""
        self.is_other_view = False
        self._surpluses = deque[float](maxlen=_WINDOW)
        self._frames = 0

    def accepted(self, silhouette: Silhouette, depth_m: DepthImage | None) -> DepthImage | None:
        """Return the depth image (H, W), metres; None if it belongs to another view."""
        if depth_m is None:
            return None
        self._frames += 1
        if self._frames % _EVERY == 0:
            surplus = surplus_of_jumps(silhouette, depth_m)
            if surplus is not None:
                self._surpluses.append(surplus)
                self._judge()
        return None if self.is_other_view else depth_m

    def _judge(self) -> None:
        if len(self._surpluses) < _LEAST:
            return
        mean = float(np.mean(self._surpluses))
        self.is_other_view = mean < (_SAME_VIEW if self.is_other_view else _OTHER_VIEW)

    @property
    def remark(self) -> str:
        """A warning about the depth of another view; empty if there is none."""
        if not self.is_other_view:
            return ""
        percent = 100.0 * float(np.mean(self._surpluses))
        return (
            "the depth images show another view than the silhouettes, so they are not used: at "
            f"the person's outline the depth grows outwards only {percent:.0f} % oftener than it "
            f"shrinks, expected at least {100 * _OTHER_VIEW:.0f} %. Give depth that is registered "
            "to the first camera (often .../aligned_depth_to_color/image_raw) and of the same "
            "time; wrong silhouettes have the same effect"
        )
