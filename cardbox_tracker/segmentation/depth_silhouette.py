"""Extracts silhouettes from depth images by a distance limit; nothing has to be learned.

The person has to stand free of the wall, with nothing else nearer than the limit but the floor
below the hips, which does not count.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.depth_image import DepthImage
from cardbox_tracker.segmentation.regions import LEAST_AREA, MOST_HOLE, clean_silhouette

WITHIN_LIMITS_M = 0.3, 20.0
"""Range of the limit, metres."""

# Unknown pixels between near ones belong to the person: a depth camera measures nothing at edges
# and where only one of its eyes sees.
_GAP = 1 / 64

# A share of the pixels below which they are specks.
_NEAREST = 0.01


def nearest_m(depth_m: DepthImage) -> float:
    """Return the distance of the nearest hundredth of a depth image, metres; infinite without."""
    known = depth_m[np.isfinite(depth_m) & (depth_m > 0)]
    return float(np.quantile(known, _NEAREST)) if known.size else np.inf


def silhouette_within(depth_m: DepthImage, within_m: float) -> NDArray[np.uint8]:
    """Return the silhouette (H, W), 0 or 255, of the pixels nearer than ``within_m``.

    The depth is (H, W), metres along the optical axis; not finite or 0 where it is unknown.
    """
    is_known = np.isfinite(depth_m) & (depth_m > 0)
    near = np.where(is_known & (depth_m < within_m), 255, 0).astype(np.uint8)
    width = max(3, round(_GAP * depth_m.shape[1]) | 1)
    closed = cv2.morphologyEx(near, cv2.MORPH_CLOSE, np.ones((width, width), np.uint8))
    near[~is_known & (np.asarray(closed) > 0)] = 255
    return clean_silhouette(near, LEAST_AREA, MOST_HOLE)
