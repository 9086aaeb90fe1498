"""Time of the estimation per image and per step, and ratios measured in one run.

Everything runs in one process on one core. Compared trackers take turns of a few images, so that
other load on the machine affects all of them.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.posture import N_JOINTS, clip_to_limits, reference_posture
from cardbox_tracker.search.config import TrackerConfig, default_preset, paper_preset
from cardbox_tracker.terms.compiled import CompiledSilhouette
from cardbox_tracker.tracking.tracker import Tracker
from lab.benchmarks.scene import (
    WARM_UP,
    BenchmarkScene,
    Times,
    extractor_of,
    make_scene,
    pinned,
    rss_mb,
    summary,
)
from lab.benchmarks.stages import measure_default_stages, measure_ratings
from lab.experiments.models import make_silhouette_term
from lab.experiments.volumetric import volumetric_faces

RESOLUTIONS = ((160, 120), (320, 240), (640, 480), (1280, 960))
PARTICLES = (60, 300, 600, 3000, 6000, 12_000, 20_001, 30_000, 60_000)
FRAME_30HZ_MS = 1000.0 / 30.0

_TURN = 10
_MOST_S = 3.0


def follow(
    scene: BenchmarkScene, config: TrackerConfig, cost: str = "compiled"
) -> Callable[[int], object]:
    """Return a function that tracks the ``i``-th silhouette of ``scene``."""
    made = make_silhouette_term(cost, scene.body, scene.camera)
    tracker = Tracker(scene.body, scene.camera, config, silhouette=made)
    return partial(_track, tracker, scene)


def _track(tracker: Tracker, scene: BenchmarkScene, i: int) -> object:
    return tracker.track(scene.silhouettes[i])


def frame_times_ms(
    scene: BenchmarkScene, trackers: dict[str, Callable[[int], object]]
) -> dict[str, Times]:
    """Let ``trackers`` process all images in turns; return milliseconds of each image, (n,).

    At the beginning of a turn the caches hold the data of other trackers, unlike in a live node.
    These images count; only those of the warm-up are left out.
    """
    times: dict[str, list[float]] = {name: [] for name in trackers}
    count = len(scene.silhouettes)
    for first in range(0, count, _TURN):
        for name, track in trackers.items():
            for i in range(first, min(first + _TURN, count)):
                start = time.perf_counter()
                track(i)
                times[name].append(1e3 * (time.perf_counter() - start))
    return {name: np.array(values[WARM_UP:]) for name, values in times.items()}


def measure_frames(scene: BenchmarkScene) -> dict[str, Any]:
    """Measure a whole frame: with both presets, and with the cost drawn by OpenCV.

    ``image_to_posture`` also computes the silhouette from the image.
    """
    extractor = extractor_of(scene)
    whole = Tracker(scene.body, scene.camera, paper_preset())
    times = frame_times_ms(
        scene,
        {
            "paper": follow(scene, paper_preset()),
            "opencv": follow(scene, paper_preset(), "cardbox"),
            "default": follow(scene, default_preset()),
            "image_to_posture": lambda i: whole.track(extractor(scene.images[i])),
        },
    )
    return {
        "frames": {name: summary(values) for name, values in times.items()},
        "ratio_opencv": float(np.median(times["opencv"] / times["paper"])),
        "ratio_default": float(np.median(times["default"] / times["paper"])),
    }


def measure_after_pauses(scene: BenchmarkScene) -> dict[str, float]:
    """Measure a frame, image to posture with the default preset, a 30th of a second apart.

    While a live node waits, the processor slows down and the caches lose its data.
    """
    extractor = extractor_of(scene)
    tracker = Tracker(scene.body, scene.camera, default_preset())
    times: dict[bool, list[float]] = {True: [], False: []}
    for paused in (False, True):
        for image in scene.images:
            time.sleep(FRAME_30HZ_MS / 1e3 if paused else 0.0)
            start = time.perf_counter()
            tracker.track(extractor(image))
            times[paused].append(1e3 * (time.perf_counter() - start))
    return {
        "without_ms": float(np.median(times[False][WARM_UP:])),
        "with_ms": float(np.median(times[True][WARM_UP:])),
    }


def measure_models(scene: BenchmarkScene, particles: int = 200, rounds: int = 30) -> float:
    """Return the ratio of the time of the box model to that of the cardbox, both compiled.

    Corners are computed beforehand, so only drawing 42 planes and 15 planes is compared.
    """
    rng = np.random.default_rng(0)
    front = reference_posture("front")
    postures = clip_to_limits(front + rng.normal(0.0, 0.25, (particles, N_JOINTS)))
    corners = {
        name: np.ascontiguousarray(scene.camera.reference_to_optical(make(scene.body, postures)))
        for name, make in (("cardbox", cardbox_patches), ("volumetric", volumetric_faces))
    }
    seen = CompiledSilhouette(scene.body, scene.camera).look(scene.silhouettes[0])
    ratios = []
    for turn in range(rounds + 1):
        seconds = {}
        for name, planes in corners.items():
            start = time.perf_counter()
            seen.polygons(planes)
            seconds[name] = time.perf_counter() - start
        if turn > 0:
            ratios.append(seconds["volumetric"] / seconds["cardbox"])
    return float(np.median(ratios))


def measure_resolutions(scenes: list[BenchmarkScene]) -> dict[str, dict[str, float]]:
    """Measure a whole frame at several resolutions, in turns, with the same number of images."""
    trackers = {f"{s.camera.width}x{s.camera.height}": follow(s, paper_preset()) for s in scenes}
    times = frame_times_ms(scenes[0], trackers)
    return {name: summary(values) for name, values in times.items()}


def measure_particles(
    scene: BenchmarkScene, counts: tuple[int, ...] = PARTICLES
) -> dict[str, float]:
    """Measure the median time of a frame, ms, by the number of particles in all filters."""
    result: dict[str, float] = {}
    for count in counts:
        config = paper_preset().with_particles(count // 3)
        track = partial(_track, Tracker(scene.body, scene.camera, config), scene)
        times: list[float] = []
        for i in range(len(scene.silhouettes)):
            start = time.perf_counter()
            track(i)
            times.append(1e3 * (time.perf_counter() - start))
            if len(times) > 2 * WARM_UP and sum(times) > 1e3 * _MOST_S:
                break
        result[str(3 * (count // 3))] = float(np.median(times[WARM_UP:]))
    return result


def particles_at_30hz(particles: dict[str, float]) -> int:
    """Return the number of particles that take 1/30 s on a core, interpolated linearly."""
    counts = np.array([float(count) for count in particles])
    times = np.maximum.accumulate(np.array(list(particles.values())))
    if times[0] > FRAME_30HZ_MS:
        return 0
    return int(np.interp(FRAME_30HZ_MS, times, counts))


def measure_core(frames: int, report: Callable[[float], None]) -> dict[str, Any]:
    """Measure everything that needs no ROS; ``report`` gets the finished fraction."""
    with pinned(1):
        scene = make_scene(320, 240, frames)
        results = measure_frames(scene)
        memory = rss_mb()
        pauses = measure_after_pauses(scene)
        report(0.3)
        stages = measure_ratings(scene)
        default_stages = measure_default_stages(scene)
        volumetric = measure_models(scene)
        report(0.4)
        scenes = [make_scene(w, h, max(2 * WARM_UP, frames // 3), 2) for w, h in RESOLUTIONS]
        resolutions = measure_resolutions(scenes)
        report(0.7)
        particles = measure_particles(scene)
    report(1.0)
    frame = results["frames"]["paper"]
    double = resolutions["640x480"]["median_ms"] / resolutions["320x240"]["median_ms"]
    return {
        "frame_ms_median": frame["median_ms"],
        "frame_ms_p95": frame["p95_ms"],
        "ratio_opencv": results["ratio_opencv"],
        "ratio_volumetric": volumetric,
        "ratio_double_resolution": double,
        "particles_at_30hz": particles_at_30hz(particles),
        "rss_mb": memory,
        "frames": results["frames"],
        "after_pauses": pauses,
        "stages": stages,
        "default_stages": default_stages,
        "ratio_default": results["ratio_default"],
        "resolutions": resolutions,
        "particles": particles,
    }
