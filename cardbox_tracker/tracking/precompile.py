"""Compilation of all kernels into the cache on disk, so that tracking starts without delay.

The installation, the tests and the tracker's node run it before their work begins.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.camera.view import OtherCamera
from cardbox_tracker.common import compiling
from cardbox_tracker.detectors.image_points import POINT_NAMES, ImagePoints
from cardbox_tracker.person.appearance import PARTS, Appearance, bins_of
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.search.config import PRESETS, TrackerConfig
from cardbox_tracker.segmentation import background
from cardbox_tracker.tracking import person_region
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.tracker import Tracker


def compile_all(
    presets: Sequence[str] = tuple(PRESETS),
    *,
    several_cameras: bool = True,
    points: bool = True,
) -> None:
    """Track a drawn person with each of ``presets``, which compiles all their kernels.

    Compiled code that is damaged is made again. Presets that allow it are also tracked with a
    further camera and with points of a detector.
    """
    try:
        _call_all(presets, several_cameras, points)
    except compiling.DAMAGED:
        compiling.discard()
        _call_all(presets, several_cameras, points)


def _call_all(presets: Sequence[str], several_cameras: bool, points: bool) -> None:
    background.warm_up()
    person_region.warm_up()
    body = BodyModel()
    camera = Camera(96, 72, 99.0, 99.0, 47.5, 35.5)
    beside = OtherCamera(camera, Extrinsics(np.eye(3), np.array([0.1, 0.0, 0.0])))
    silhouette = render(cardbox_patches(body, reference_posture("front")), camera)
    some = ImagePoints(np.full((len(POINT_NAMES), 2), 36.0), np.ones(len(POINT_NAMES)))
    found = (None, None, some, some) if points else (None, None)
    for name in presets:
        # Images with and without colour, since terms that use them are compiled for both.
        for shape in (silhouette.shape, (*silhouette.shape, 3)):
            channels = shape[2] if len(shape) == 3 else 1
            looks = Appearance(
                np.zeros((len(PARTS), bins_of(channels)), np.uint8), np.full(channels, 128.0)
            )
            config = quickest(PRESETS[name]())
            image = np.full(shape, 128, np.uint8)
            is_several = several_cameras and config.has_several_views
            for others in ((), (beside,)) if is_several else ((),):
                person = body.with_values(appearance=looks)
                tracker = Tracker(person, camera, config, others=others)
                for given in found:
                    one = Observation(silhouette, image, points=given)
                    tracker.track([one] * (1 + len(others)))


def quickest(config: TrackerConfig) -> TrackerConfig:
    """Return ``config`` with the smallest number of states that its filter allows."""
    if config.filter == "hierarchical":
        return config.with_particles(2)
    return config.changed({"whole_body": {"effort": 0.25}})


if __name__ == "__main__":
    compile_all()
