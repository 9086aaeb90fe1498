"""MediaPipe Pose on the same images, where the extra ``mediapipe`` is installed.

It finds 33 points of an average person in colour images with a neural network, its "full" model;
here it sees the same grey images, on the same single core.
"""

from __future__ import annotations

import importlib
import importlib.util
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

_FULL = 1
_WARM_UP = 5


def full_model() -> Any:
    """Return the full model for images that follow each other, as a context; needs the extra."""
    solutions = importlib.import_module("mediapipe.python.solutions.pose")
    return solutions.Pose(static_image_mode=False, model_complexity=_FULL)


def measure_mediapipe(images: NDArray[np.uint8]) -> dict[str, float] | None:
    """Measure MediaPipe on images (n, H, W); None if it is not installed.

    Returns:
        ``median_ms`` and ``p95_ms`` of an image, and ``found``, the fraction with a person found.
    """
    if importlib.util.find_spec("mediapipe") is None:
        return None
    times = []
    found = 0
    with full_model() as pose:
        for image in images:
            colour = np.repeat(image[..., None], 3, axis=2)
            start = time.perf_counter()
            result = pose.process(colour)
            times.append(1e3 * (time.perf_counter() - start))
            found += result.pose_landmarks is not None
    return {
        "median_ms": float(np.median(times[_WARM_UP:])),
        "p95_ms": float(np.percentile(times[_WARM_UP:], 95)),
        "found": found / len(images),
    }
