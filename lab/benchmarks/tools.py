"""Helpers of all benchmarks of the estimation."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.segmentation.background import SilhouetteExtractor
from cardbox_tracker.segmentation.empty_scene import BackgroundLearner
from lab.benchmarks.scene import BenchmarkScene

WARM_UP = 5
"""Number of first images that do not count, as they allocate memory and compile code."""

Times = NDArray[np.float64]


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
