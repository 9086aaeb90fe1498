"""Time of each step of a frame, on the particles of a running tracker."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.search.config import TrackerConfig, paper_preset
from cardbox_tracker.search.hierarchy import HierarchicalFilter
from cardbox_tracker.search.particle_filter import ParticleFilter
from cardbox_tracker.search.resampling import truncation
from cardbox_tracker.terms.compiled import CompiledSilhouette
from lab.benchmarks.scene import BenchmarkScene
from lab.benchmarks.tools import WARM_UP, extractor_of, summary

T = TypeVar("T")


def measure_stages(scene: BenchmarkScene) -> dict[str, dict[str, float]]:
    """Measure the steps of a frame one by one, on the particles of a running tracker."""
    extractor = extractor_of(scene)
    paper = paper_preset()
    term = CompiledSilhouette(scene.body, scene.camera)
    filters = _Filters(paper, scene, term)
    times: dict[str, list[float]] = {}

    def timed(name: str, work: Callable[..., T], *arguments: object) -> T:
        start = time.perf_counter()
        result = work(*arguments)
        times.setdefault(name, []).append(1e3 * (time.perf_counter() - start))
        return result

    for image, silhouette in zip(scene.images, scene.silhouettes, strict=True):
        posture = filters.track(silhouette)
        torso, left, right = filters.all
        timed("silhouette from the image", extractor, image)
        seen = timed("silhouette as bits", term.look, silhouette)
        rate_torsos = timed("arms of the last frame taken out", seen.torsos_beside, posture)
        timed("cost of all torsos", rate_torsos, torso.particles)
        rate_arms = timed("torso taken out", seen.arms_beside, posture[:4])
        timed("cost of all left arms", rate_arms, "left", left.particles)
        timed("cost of all right arms", rate_arms, "right", right.particles)
        timed("resampling of one filter", _resample, torso)
        timed("noise of one filter", _NOISE.standard_normal, torso.particles.shape)
        timed("standard deviations of one filter", torso.stddev, posture[:4])
    return {name: summary(values[WARM_UP:]) for name, values in times.items()}


class _Filters:
    """A hierarchical filter with access to its parts."""

    def __init__(
        self, config: TrackerConfig, scene: BenchmarkScene, term: CompiledSilhouette
    ) -> None:
        self._term = term
        area = scene.camera.width * scene.camera.height
        self._filter = HierarchicalFilter(config, area, np.random.default_rng(0))
        self._started = False

    @property
    def all(self) -> list[ParticleFilter]:
        """Torso, left arm, right arm."""
        return [self._filter.torso, *self._filter.arms.values()]

    def track(self, silhouette: NDArray[np.uint8]) -> NDArray[np.float64]:
        """Return the posture (12,) of the next silhouette."""
        seen = self._term.look(silhouette)
        if self._started:
            self._filter.iterate(seen)
        else:
            self._filter.initialize(seen, reference_posture("front"))
        self._started = True
        return self._filter.estimate()


def _resample(of: ParticleFilter) -> object:
    return truncation(of.costs, of.config.survival_rate)


_NOISE = np.random.default_rng(0)
