"""Compile everything into the cache on disk, so that nobody waits for the compiler later.

Installation, the tests and the tracker's node do so before their work begins.
"""

from __future__ import annotations

from cardbox_tracker.body.cardbox import cardbox_patches
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import reference_posture
from cardbox_tracker.estimation.config import PRESETS
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.vision import background
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.rasterisation import render


def compile_all() -> None:
    """Follow a drawn person with each preset, so that all compiled code was run once."""
    background.warm_up()
    body = BodyModel()
    camera = Camera(32, 24, 33.0, 33.0, 15.5, 11.5)
    silhouette = render(cardbox_patches(body, reference_posture("front")), camera)
    for make_config in PRESETS.values():
        tracker = Tracker(body, camera, make_config().with_particles(2))
        tracker.track(silhouette)
        tracker.track(silhouette)


if __name__ == "__main__":
    compile_all()
