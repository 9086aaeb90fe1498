"""The camera is found while somebody stands before it, as in a film."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.detectors.pose_network import LANDMARKS
from cardbox_tracker.measuring.people_camera import FORWARD, LEVELS
from cardbox_tracker.measuring.scene_watch import SceneWatch
from cardbox_tracker.person.model import body_from_proportions
from cardbox_tracker.person.proportions import MARKED_HEIGHTS
from cardbox_tracker.terms.term import Image
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.session import Session

CAMERA = Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
PITCH_RAD, HEIGHT_M, AWAY_M = 0.2, 1.6, 2.5
GREY: Image = np.full((120, 160), 90, np.uint8)


def standing(score: float = 0.9) -> ImagePoints:
    """Return the points of somebody of 1.8 m who faces a camera that looks down."""
    camera, found = CAMERA.with_pitch(PITCH_RAD), {}
    for name in LANDMARKS:
        level = name.removeprefix("left_").removeprefix("right_")
        level = "ankle" if level in ("heel", "foot") else level
        if level in LEVELS:
            at = LEVELS.index(level)
            there = -AWAY_M + 1.8 * FORWARD[at], 0.0, 1.8 * MARKED_HEIGHTS[at] - HEIGHT_M
            column, row = camera.project(camera.reference_to_optical(np.array(there)))
            found[name] = float(column), float(row), score
    return ImagePoints.of(found)


def test_who_stands_shows_pitch_height_and_distance() -> None:
    watch = SceneWatch(CAMERA, [1.8])
    found = [watch.see(0.1 * image, [standing()], GREY) for image in range(80)]
    tries = [image for image, one in enumerate(found) if one is not None]
    # The first try follows ten images and a second; the pauses double.
    assert tries == [19, 29, 49]
    last = found[tries[-1]]
    assert last is not None and last.camera.height_m is not None
    assert last.camera.pitch_rad.mean == pytest.approx(PITCH_RAD, abs=0.06)
    assert last.camera.height_m.mean == pytest.approx(HEIGHT_M, abs=0.25)
    (far,) = last.distances
    assert far is not None and 1.8 * far.distances[0] == pytest.approx(AWAY_M, rel=0.1)
    assert watch.news.startswith("camera pitch ") and "people who stand" in watch.news


def test_a_pitch_that_is_given_stays_and_is_no_news() -> None:
    watch = SceneWatch(CAMERA, [1.8], (0.15, 0.01))
    found = [watch.see(0.1 * image, [standing()], GREY) for image in range(40)]
    assert [one.camera.pitch_rad.mean for one in found if one is not None] == [0.15, 0.15]
    assert watch.news == ""


def test_nobody_shows_nothing_and_tries_do_not_hold_images_up() -> None:
    with ThreadPoolExecutor(1) as beside:
        watch = SceneWatch(CAMERA, [None], None, beside)
        assert not any(watch.see(0.1 * n, [standing(0.0)], GREY) for n in range(100))
        found = None
        for image in range(100, 10_000):
            found = found or watch.see(0.1 * image, [standing()], GREY)
            if image % 1000 == 0:
                # The tries before are at an end, however slow the machine is.
                beside.submit(int).result()
        assert found is not None
        assert len(watch._people[0].items) <= 201


def test_a_session_goes_on_with_what_is_found() -> None:
    guess = body_from_proportions(1.8, None)
    session = Session([guess], CAMERA, scene=SceneWatch(CAMERA, [1.8]))
    silhouette: Image = np.zeros((120, 160), np.uint8)
    for image in range(60):
        session.track(Observation(silhouette, GREY, stamp_ns=image * 10**8, points=standing()))
    pose = session.trackers[0].body.camera_pose
    assert pose.pitch_rad == pytest.approx(PITCH_RAD, abs=0.06)
    assert pose.height_m == pytest.approx(HEIGHT_M, abs=0.25)
