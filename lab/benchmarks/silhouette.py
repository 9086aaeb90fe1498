"""Time of the silhouette with colours, shadows, light and absorption, against brightness alone.

``python -m lab.benchmarks.silhouette RECORDING`` measures a recording that begins with the empty
scene, and prints a digest of its silhouettes.
"""

from __future__ import annotations

import argparse
import hashlib
import sys
import time
from collections.abc import Callable
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.recordings.open_images import open_images
from cardbox_tracker.recordings.silhouettes import SilhouetteSource, TimeSpan
from cardbox_tracker.segmentation.background import SilhouetteExtractor
from cardbox_tracker.segmentation.background_config import BackgroundConfig
from cardbox_tracker.segmentation.empty_scene import BackgroundLearner, BackgroundModel
from lab.benchmarks.scene import BenchmarkScene
from lab.benchmarks.tools import WARM_UP, pinned

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

# Images of a recording that are read at most.
_MOST_IMAGES = 1000
_PERIOD_NS = 33_333_333
_TINT_OF_WALL, _TINT_OF_PERSON = (0.9, 1.0, 0.95), (1.0, 0.8, 0.6)


class Costs(NamedTuple):
    """Cost of the silhouette.

    Attributes:
        ratio: median over the images of the time of all steps relative to brightness alone.
        ratios_without: the same ratio if one step is left out, by step.
        median_ms: median time of an image with all steps.
        digest: of the silhouettes with all steps.
    """

    ratio: float
    ratios_without: dict[str, float]
    median_ms: float
    digest: str


def colored(scene: BenchmarkScene) -> tuple[Images, Images]:
    """Return the empty images and those with the person, bgr (H, W, 3), with tints for both."""
    wall, person = (np.array(tint) for tint in (_TINT_OF_WALL, _TINT_OF_PERSON))
    empty = [(image[..., None] * wall).astype(np.uint8) for image in scene.empty]
    images = [
        (image[..., None] * np.where(silhouette[..., None] > 0, person, wall)).astype(np.uint8)
        for image, silhouette in zip(scene.images, scene.silhouettes, strict=True)
    ]
    return empty, images


def measure_silhouettes(empty: Images, images: Images, repetitions: int = 3) -> Costs:
    """Measure the silhouettes of ``images`` before the learned ``empty`` scene, both bgr.

    The settings take turns at each image, and the shortest of several repetitions counts.
    """
    learner = BackgroundLearner()
    for image in empty:
        learner.add(image)
    settings = {"": BackgroundConfig(), "brightness": BRIGHTNESS_ALONE, **WITHOUT}
    model, digest = learner.model(), ""
    least_ms = {name: np.full(len(images), np.inf) for name in settings}
    for _ in range(repetitions):
        times_ms, digest = _turns(model, settings, images)
        for name, values in times_ms.items():
            np.minimum(least_ms[name], values, out=least_ms[name])
    alone = least_ms["brightness"][WARM_UP:]
    ratios = {name: float(np.median(ms[WARM_UP:] / alone)) for name, ms in least_ms.items()}
    return Costs(
        ratios[""],
        {name: ratios[name] for name in WITHOUT},
        float(np.median(least_ms[""][WARM_UP:])),
        digest,
    )


def _turns(
    model: BackgroundModel, settings: dict[str, BackgroundConfig], images: Images
) -> tuple[dict[str, NDArray[np.float64]], str]:
    """Return milliseconds of each image (n,) by the settings' name, and the digest of ``""``."""
    extractors: dict[str, Callable[[NDArray[np.uint8], int], NDArray[np.uint8]]] = {
        name: SilhouetteExtractor(model, config) for name, config in settings.items()
    }
    times = {name: np.empty(len(images)) for name in settings}
    digest = hashlib.sha256()
    for i, image in enumerate(images):
        for name, extract in extractors.items():
            start = time.perf_counter()
            silhouette = extract(image, (i + 1) * _PERIOD_NS)
            times[name][i] = 1e3 * (time.perf_counter() - start)
            if not name:
                digest.update(silhouette.tobytes())
    return times, digest.hexdigest()[:16]


def main() -> int:
    """Measure the recordings of the command line, on one core."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", nargs="+", help="recordings of one camera")
    parser.add_argument("--background", type=TimeSpan.parse, default=TimeSpan(0.0, 1.0))
    parser.add_argument("--images", type=int, default=200, help="number of images to measure")
    given = parser.parse_args()
    for path in given.recordings:
        try:
            empty, images = _recorded(path, given.background, given.images)
        except CardboxError as error:
            print(f"error: {error}", file=sys.stderr)
            return 1
        with pinned(1):
            costs = measure_silhouettes(empty, images)
        without = ", ".join(f"{ratio:.2f} without {s}" for s, ratio in costs.ratios_without.items())
        print(
            f"{path}: {costs.ratio:.2f} times brightness alone ({without}), "
            f"{costs.median_ms:.3f} ms, silhouettes {costs.digest}"
        )
    return 0


def _recorded(path: str, background: TimeSpan, count: int) -> tuple[Images, Images]:
    """Return images of the span ``background``, and ``count`` images after it."""
    with open_images(path) as recording:
        source = SilhouetteSource(recording, background)
        prepared = [
            (time_s, image) for _, time_s, image, *_ in islice(source.images(), _MOST_IMAGES)
        ]
    empty = [image for time_s, image in prepared if background.contains(time_s)]
    after = [image for time_s, image in prepared if time_s > background.end_s]
    return empty, after[:count]


if __name__ == "__main__":
    sys.exit(main())
