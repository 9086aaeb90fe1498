"""Markers: the skeleton has a line where the face looks."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.recordings.markers import marker_shapes

BODY = BodyModel()
CAMERA = Camera(320, 240, 250.0, 250.0, 159.5, 119.5)
FRONT = reference_posture("front")


def test_the_skeletons_marker_has_the_gaze_last() -> None:
    plain = marker_shapes(BODY, FRONT)[1].points_m
    looking = marker_shapes(BODY, FRONT, neck=np.array([0.5, 0.2]))[1].points_m
    np.testing.assert_array_equal(looking[:-2], plain)
    start, end = CAMERA.optical_to_reference(looking[-2:])
    direction = (end - start) / np.linalg.norm(end - start)
    expected = (np.cos(0.5) * np.cos(0.2), np.sin(0.5) * np.cos(0.2), -np.sin(0.2))
    np.testing.assert_allclose(direction, expected, atol=1e-9)
