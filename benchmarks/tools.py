"""Helpers of all benchmarks of the estimation."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.scene import BenchmarkScene
from cardbox_tracker.vision.background import SilhouetteExtractor
from cardbox_tracker.vision.empty_scene import BackgroundLearner

WARM_UP = 5
"""Number of first images that are not counted: they wait for memory and for the compiler."""

Times = NDArray[np.float64]


@contextmanager
def pinned(cores: int) -> Iterator[int]:
    """Keep this thread, and those it starts, on the first ``cores`` cores; yields how many."""
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
    """Return what cuts the person out, with the scene's background learned."""
    learner = BackgroundLearner()
    for image in scene.empty:
        learner.add(image)
    return SilhouetteExtractor(learner.model())


def rss_mb() -> float:
    """Return the memory that this process holds, in MB; not a number where the system hides it."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        return float("nan")
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
