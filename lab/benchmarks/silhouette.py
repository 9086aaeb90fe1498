"""Time of the silhouette with colours, shadows, light and absorption, against brightness alone."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.segmentation.background import SilhouetteExtractor
from cardbox_tracker.segmentation.background_config import BackgroundConfig
from cardbox_tracker.segmentation.empty_scene import BackgroundLearner
from lab.benchmarks.scene import WARM_UP, BenchmarkScene

Images = list[NDArray[np.uint8]]

BRIGHTNESS_ALONE = BackgroundConfig(color=False, soft_shadow=0.0, follow=False, absorb_after=0)
"""Settings that compare brightness and remove specks, and nothing else."""
WITHOUT = {
    "colours": BackgroundConfig(color=False),
    "soft shadows": BackgroundConfig(soft_shadow=0.0),
    "changes of the light": BackgroundConfig(follow=False),
    "absorption": BackgroundConfig(absorb_after=0),
}
"""Settings that leave out one step each."""

_PERIOD_NS = 33_333_333
_TINT_OF_WALL, _TINT_OF_PERSON = (0.9, 1.0, 0.95), (1.0, 0.8, 0.6)


def colored(scene: BenchmarkScene) -> tuple[Images, Images]:
    """Return the empty images and those with the person, bgr (H, W, 3), with tints for both."""
    wall, person = (np.array(tint) for tint in (_TINT_OF_WALL, _TINT_OF_PERSON))
    empty = [(image[..., None] * wall).astype(np.uint8) for image in scene.empty]
    images = [
        (image[..., None] * np.where(silhouette[..., None] > 0, person, wall)).astype(np.uint8)
        for image, silhouette in zip(scene.images, scene.silhouettes, strict=True)
    ]
    return empty, images


def measure_silhouettes(empty: Images, images: Images, repetitions: int = 3) -> dict[str, Any]:
    """Measure the silhouettes of ``images`` before the learned ``empty`` scene, both bgr.

    The settings take turns at each image, and the shortest of several repetitions counts.

    Returns:
        ``ratio``, the median over the images of the time of all steps relative to brightness alone;
        ``ratios_without``, the same if one step is left out, by step; ``median_ms``, the time of an
        image with all steps.
    """
    learner = BackgroundLearner()
    for image in empty:
        learner.add(image)
    settings = {"": BackgroundConfig(), "brightness": BRIGHTNESS_ALONE, **WITHOUT}
    model = learner.model()
    least_ms = {name: np.full(len(images), np.inf) for name in settings}
    for _ in range(repetitions):
        extractors = {name: SilhouetteExtractor(model, one) for name, one in settings.items()}
        for i, image in enumerate(images):
            for name, extract in extractors.items():
                start = time.perf_counter()
                extract(image, (i + 1) * _PERIOD_NS)
                spent_ms = 1e3 * (time.perf_counter() - start)
                least_ms[name][i] = min(least_ms[name][i], spent_ms)
    alone = least_ms["brightness"][WARM_UP:]
    ratios = {name: float(np.median(ms[WARM_UP:] / alone)) for name, ms in least_ms.items()}
    return {
        "ratio": ratios[""],
        "ratios_without": {name: ratios[name] for name in WITHOUT},
        "median_ms": float(np.median(least_ms[""][WARM_UP:])),
    }
