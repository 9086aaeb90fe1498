"""The input of the benchmarks: a drawn person who waves, at any resolution, or a recorded one.

With what all of them need to measure.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.simulation.motions import WAVE_S, wave
from cardbox_tracker.applications.simulation.renderer import Renderer
from cardbox_tracker.applications.simulation.session import session_camera
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.recordings.open_images import open_images
from cardbox_tracker.segmentation.background import SilhouetteExtractor
from cardbox_tracker.segmentation.empty_scene import BackgroundLearner
from lab.evaluation.session import load_session
from lab.evaluation.tracking import person_of

Images = NDArray[np.uint8]
Times = NDArray[np.float64]

WARM_UP = 5
"""Number of first images that do not count, as they allocate memory and compile code."""


@dataclass(frozen=True)
class BenchmarkScene:
    """Images of one person in motion, 15 a second.

    Attributes:
        body: the person.
        camera: the camera in front of the person.
        empty: images of the empty scene, (m, H, W), brightness.
        images: images with the person, (n, H, W), brightness.
        silhouettes: exact silhouettes, (n, H, W), 0 or 255.
    """

    body: BodyModel
    camera: Camera
    empty: Images
    images: Images
    silhouettes: Images


def make_scene(width: int, height: int, count: int, empty: int = 30) -> BenchmarkScene:
    """Draw ``count`` images of the motion ``wave``, from its beginning on."""
    body = BodyModel.of(hip_height_m=-0.51)
    camera = session_camera(width, height)
    renderer = Renderer(camera, np.random.default_rng(0))
    background = np.array([renderer.image()[0] for _ in range(empty)])
    drawn = [renderer.image(body, wave(i / 15.0 % WAVE_S)) for i in range(count)]
    return BenchmarkScene(
        body,
        camera,
        background,
        np.array([image for image, _ in drawn]),
        np.array([silhouette for _, silhouette in drawn]),
    )


def wide_scene(scene: BenchmarkScene, width: int = 1280, height: int = 720) -> BenchmarkScene:
    """Return a scene as a camera of another aspect shows it, whose borders are repeated."""
    large = scene.camera.scaled(round(scene.camera.width * height / scene.camera.height), height)
    left = (width - large.width) // 2
    border = 0, 0, left, width - large.width - left, cv2.BORDER_REPLICATE

    def widened(images: Images) -> Images:
        resized = (cv2.resize(image, (large.width, height)) for image in images)
        return np.array([cv2.copyMakeBorder(image, *border) for image in resized], np.uint8)

    camera = replace(large, width=width, cx=large.cx + left)
    return replace(scene, camera=camera, empty=widened(scene.empty), images=widened(scene.images))


def recorded_scene(folder: Path, count: int, empty: int = 30) -> BenchmarkScene:
    """Return ``count`` images of a session with one camera, from the first motion on, as grey.

    Raises:
        CardboxError: the folder is no session, does not say the stature, or has too few images.
    """
    session = load_session(folder)
    truth = session.truth
    with open_images(session.bag) as bag:
        lens = bag.calibration()
        grey: list[NDArray[Any]] = []
        for image in bag.images():
            shown = image.as_sent
            time_s = (image.stamp_ns - truth.start_ns) / 1e9
            if len(grey) < empty or time_s >= session.start_s:
                grey.append(shown if shown.ndim == 2 else cv2.cvtColor(shown, cv2.COLOR_BGR2GRAY))
            if len(grey) == empty + count:
                break
    if truth.stature_m is None or len(grey) < empty + count:
        raise CardboxError(
            f"{folder} has no stature, or fewer than {empty + count} images; expected both"
        )
    pictures = np.array(grey, np.uint8)
    return BenchmarkScene(
        person_of(truth),
        Camera(lens.width, lens.height, *lens.k[[0, 1, 0, 1], [0, 1, 2, 2]].tolist()),
        pictures[:empty],
        pictures[empty:],
        np.zeros((0, lens.height, lens.width), np.uint8),
    )


@contextmanager
def pinned(cores: int) -> Iterator[int]:
    """Pin this thread, and those it starts, to the first ``cores`` cores; yield their number."""
    before = os.sched_getaffinity(0)
    chosen = sorted(before)[:cores]
    os.sched_setaffinity(0, chosen)
    try:
        yield len(chosen)
    finally:
        os.sched_setaffinity(0, before)


def summary(milliseconds: Times | list[float]) -> dict[str, float]:
    """Return median and 95th percentile."""
    return {
        "median_ms": float(np.median(milliseconds)),
        "p95_ms": float(np.percentile(milliseconds, 95)),
    }


def extractor_of(scene: BenchmarkScene) -> SilhouetteExtractor:
    """Return an extractor of silhouettes with the learned background of ``scene``."""
    learner = BackgroundLearner()
    for image in scene.empty:
        learner.add(image)
    return SilhouetteExtractor(learner.model())


def rss_mb() -> float:
    """Return the resident memory of this process in MB, or NaN where the system hides it."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        return float("nan")
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
