"""Time of a frame with two cameras against one, preset ``default``."""

from __future__ import annotations

import time

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.scene import BenchmarkScene
from benchmarks.tools import WARM_UP
from cardbox_tracker.body.cardbox import cardbox_patches
from cardbox_tracker.body.posture import N_JOINTS, TORSO_X, TORSO_Z
from cardbox_tracker.estimation.config import default_preset
from cardbox_tracker.estimation.cost.view import OtherCamera, View
from cardbox_tracker.estimation.observation import Observation
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.simulation.motions import WAVE_S, wave
from cardbox_tracker.vision.extrinsics import Extrinsics
from cardbox_tracker.vision.rasterisation import render

_ASIDE_RAD = 0.9


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
            for others in ((), (other,))
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


def beside(scene: BenchmarkScene) -> OtherCamera:
    """Return a camera like the first one, turned around the person."""
    turn = cv2.Rodrigues(np.array([0.0, _ASIDE_RAD, 0.0]))[0].astype(np.float64)
    person_m = np.array([0.0, 0.0, scene.body.placement.distance_m])
    return OtherCamera(scene.camera, Extrinsics(turn, person_m - turn @ person_m))


def seen_by(scene: BenchmarkScene, other: OtherCamera) -> list[NDArray[np.uint8]]:
    """Return the silhouettes (H, W) of the scene in the image of ``other``."""
    view = View.of(scene.body, scene.camera, other)
    states = [np.append(wave(i / 15.0 % WAVE_S), [0.0, 0.0]) for i in range(len(scene.images))]
    return [_drawn(view, view.states(state)) for state in states]


def _drawn(view: View, state: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return the silhouette (H, W) of a state (14,) of the view's person in its image."""
    patches = cardbox_patches(view.body, state[:N_JOINTS])
    return render(patches + np.array([state[TORSO_X], 0.0, state[TORSO_Z]]), view.camera)
