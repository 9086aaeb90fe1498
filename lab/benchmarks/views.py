"""Time of a frame with two cameras against one, preset ``default``."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.simulation.motions import WAVE_S, wave
from cardbox_tracker.applications.simulation.renderer import Renderer
from cardbox_tracker.applications.simulation.session import SyntheticCamera, synthetic_cameras
from cardbox_tracker.camera.view import OtherCamera
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.tracker import Tracker
from lab.benchmarks.scene import BenchmarkScene
from lab.benchmarks.tools import WARM_UP


def measure_two_views(scene: BenchmarkScene, repetitions: int = 3) -> float:
    """Return the time of a frame with two cameras as a multiple of that with one, a median.

    The cameras stand at the same distance from the person, and both trackers take turns at each
    frame. The shortest of several repetitions counts.
    """
    other = beside(scene)
    silhouettes = seen_by(scene, other)
    least_ms = np.full((2, len(silhouettes)), np.inf)
    for _ in range(repetitions):
        trackers = [
            Tracker(scene.body, scene.camera, default_preset(), others=others)
            for others in ((), (OtherCamera(other.camera, other.extrinsics),))
        ]
        for i, (first, second) in enumerate(zip(scene.silhouettes, silhouettes, strict=True)):
            seen = [Observation(first), Observation(second)]
            for count, tracker in enumerate(trackers, 1):
                start = time.perf_counter()
                tracker.track(seen[:count])
                spent_ms = 1e3 * (time.perf_counter() - start)
                least_ms[count - 1, i] = min(least_ms[count - 1, i], spent_ms)
    one_ms, two_ms = least_ms[:, WARM_UP:]
    return float(np.median(two_ms / one_ms))


def beside(scene: BenchmarkScene) -> SyntheticCamera:
    """Return a camera like the first one, at the same distance from the person."""
    return synthetic_cameras(scene.body, scene.camera, 2)[1]


def seen_by(scene: BenchmarkScene, other: SyntheticCamera) -> list[NDArray[np.uint8]]:
    """Return the silhouettes (H, W) of the scene in the image of ``other``."""
    renderer = Renderer(other.camera, np.random.default_rng(0))
    postures = (wave(i / 15.0 % WAVE_S) for i in range(len(scene.images)))
    return [renderer.silhouette(*other.seen(scene.body, posture)) for posture in postures]
