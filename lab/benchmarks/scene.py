"""The input of the benchmarks: a synthetic person who waves, at any resolution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.simulation.motions import WAVE_S, wave
from cardbox_tracker.applications.simulation.renderer import Renderer, Scene
from cardbox_tracker.applications.simulation.session import session_camera
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.model import BodyModel

Images = NDArray[np.uint8]


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
    renderer = Renderer(camera, Scene(), np.random.default_rng(0))
    background = np.array([renderer.image()[0] for _ in range(empty)])
    drawn = [renderer.image(body, wave(i / 15.0 % WAVE_S)) for i in range(count)]
    return BenchmarkScene(
        body,
        camera,
        background,
        np.array([image for image, _ in drawn]),
        np.array([silhouette for _, silhouette in drawn]),
    )
