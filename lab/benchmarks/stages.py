"""Time of the parts of a frame with the preset ``default``, and of the ratings of ``paper``."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from cardbox_tracker.search import doubt, whole_body
from cardbox_tracker.search.config import default_preset, paper_preset
from cardbox_tracker.search.hierarchy import Cycles
from cardbox_tracker.search.whole_body import STAGES, WholeBodyFilter
from cardbox_tracker.terms.compiled import CompiledSilhouette
from cardbox_tracker.tracking.tracked_camera import TrackedCamera
from cardbox_tracker.tracking.tracker import Tracker
from lab.benchmarks.scene import WARM_UP, BenchmarkScene, summary

WHOLE = "the whole frame"
# No part contains another one, so that the rest is the difference to the whole.
_PARTS: dict[str, tuple[Any, str]] = {
    "region of the person": (TrackedCamera, "frame"),
    "silhouette as bits, presence": (WholeBodyFilter, "look"),
    "place of the person": (WholeBodyFilter, "_observe"),
    "refinement": (WholeBodyFilter, "_refined"),
    "evidence": (doubt, "evidence_of_search"),
    "doubt": (doubt.Doubt, "judge"),
}
_SEARCH = tuple(f"search: {stage.__name__}" for stage in STAGES)


def measure_default_stages(scene: BenchmarkScene) -> dict[str, dict[str, float]]:
    """Return the times of the parts, of the rest and of the whole frame, ms."""
    times_ms: dict[str, list[float]] = {name: [] for name in (*_PARTS, *_SEARCH)}
    whole_ms: list[float] = []
    with _timed(times_ms):
        tracker = Tracker(scene.body, scene.camera, default_preset())
        for silhouette in scene.silhouettes:
            for values in times_ms.values():
                values.append(0.0)
            start = time.perf_counter()
            tracker.track(silhouette)
            whole_ms.append(1e3 * (time.perf_counter() - start))
    rest_ms = np.array(whole_ms) - np.sum(list(times_ms.values()), axis=0)
    rows = {**times_ms, "everything else": rest_ms.tolist(), WHOLE: whole_ms}
    return {name: summary(values[WARM_UP:]) for name, values in rows.items()}


@contextmanager
def _timed(times_ms: dict[str, list[float]]) -> Iterator[None]:
    """Context in which calls of the parts add their time to the last value of their list."""
    before = {name: getattr(*place) for name, place in _PARTS.items()}
    for name, (owner, called) in _PARTS.items():
        setattr(owner, called, _timing(before[name], times_ms[name]))
    named = zip(_SEARCH, STAGES, strict=True)
    whole_body.STAGES = tuple(_timing(stage, times_ms[name]) for name, stage in named)
    try:
        yield
    finally:
        for name, (owner, called) in _PARTS.items():
            setattr(owner, called, before[name])
        whole_body.STAGES = STAGES


def _timing(call: Callable[..., Any], times_ms: list[float]) -> Callable[..., Any]:
    def timed(*arguments: Any) -> Any:
        start = time.perf_counter()
        try:
            return call(*arguments)
        finally:
            times_ms[-1] += 1e3 * (time.perf_counter() - start)

    return timed


def measure_ratings(scene: BenchmarkScene) -> dict[str, dict[str, float]]:
    """Return the times, ms, in which all particles of a running tracker are rated."""
    tracker = Tracker(scene.body, scene.camera, paper_preset())
    term = CompiledSilhouette(scene.body, scene.camera)
    times_ms: dict[str, list[float]] = {}
    for silhouette in scene.silhouettes:
        posture = tracker.track(silhouette).posture
        assert posture is not None and isinstance(tracker.filter, Cycles)
        filters, seen = tracker.filter.hierarchy, term.look(silhouette)
        rate_arms = seen.arms_beside(posture[:4])
        calls = {"torsos": (seen.torsos_beside(posture), filters.torso.particles)}
        calls |= {
            f"{side} arms": (partial(rate_arms, side), one.particles)
            for side, one in filters.arms.items()
        }
        for what, (rate, particles) in calls.items():
            start = time.perf_counter()
            rate(particles)
            spent_ms = 1e3 * (time.perf_counter() - start)
            times_ms.setdefault(f"cost of all {what}", []).append(spent_ms)
    return {name: summary(values[WARM_UP:]) for name, values in times_ms.items()}
