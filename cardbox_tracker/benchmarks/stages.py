"""How long each step of a frame takes, on the particles of a tracker at work."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.benchmarks.scene import BenchmarkScene
from cardbox_tracker.benchmarks.tools import WARM_UP, extractor_of, one_core, summary
from cardbox_tracker.body.posture import reference_posture
from cardbox_tracker.estimation.config import TrackerConfig, paper_preset
from cardbox_tracker.estimation.cost.compiled import CompiledCost
from cardbox_tracker.estimation.filtering.hierarchy import HierarchicalFilter
from cardbox_tracker.estimation.filtering.particle_filter import ParticleFilter
from cardbox_tracker.estimation.filtering.resampling import deterministic


def measure_stages(scene: BenchmarkScene) -> dict[str, dict[str, float]]:
    """Measure the steps of a frame one by one, on the particles of a tracker at work."""
    extractor = extractor_of(scene)
    paper = one_core(paper_preset())
    cost = CompiledCost(scene.body, scene.camera)
    probe = CompiledCost(scene.body, scene.camera)
    filters = _Filters(paper, scene, cost)
    times: dict[str, list[float]] = {}

    def timed(name: str, work: Callable[..., object], *arguments: object) -> None:
        start = time.perf_counter()
        work(*arguments)
        times.setdefault(name, []).append(1e3 * (time.perf_counter() - start))

    for image, silhouette in zip(scene.images, scene.silhouettes, strict=True):
        posture = filters.track(silhouette)
        torso, left, right = filters.all
        timed("silhouette from the image", extractor, image)
        timed("running sums of the silhouette", probe.observe, silhouette)
        timed("arms of the last frame taken out", probe.fix_arms, posture)
        timed("cost of all torsos", probe.torso, torso.particles)
        timed("torso taken out", probe.fix_torso, posture[:4])
        timed("cost of all left arms", probe.arm, "left", left.particles)
        timed("cost of all right arms", probe.arm, "right", right.particles)
        timed("resampling of one filter", _resample, torso)
        timed("noise of one filter", _NOISE.standard_normal, torso.particles.shape)
        timed("standard deviations of one filter", torso.stddev, posture[:4])
    return {name: summary(values[WARM_UP:]) for name, values in times.items()}


class _Filters:
    """A tracker whose filters can be looked at."""

    def __init__(self, config: TrackerConfig, scene: BenchmarkScene, cost: CompiledCost) -> None:
        self._cost = cost
        area = scene.camera.width * scene.camera.height
        self._filter = HierarchicalFilter(cost, config, area, np.random.default_rng(0))
        self._started = False

    @property
    def all(self) -> list[ParticleFilter]:
        """Torso, left arm, right arm."""
        return [self._filter.torso, *self._filter.arms.values()]

    def track(self, silhouette: NDArray[np.uint8]) -> NDArray[np.float64]:
        """Return the posture (12,) of the next silhouette."""
        self._cost.observe(silhouette)
        if self._started:
            return self._filter.cycle()
        self._started = True
        return self._filter.scatter(reference_posture("front"))


def _resample(of: ParticleFilter) -> object:
    return deterministic(of.costs, of.config.survival_rate, 1.0, _NOISE)


_NOISE = np.random.default_rng(0)
