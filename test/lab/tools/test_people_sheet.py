"""Pictures of real people show nobody's face, and fill their rows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from lab.tools.people_sheet import HEAD_RADIUS_M, Circle, counts_of, heads_in, hidden

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
MASK = np.zeros((240, 320), np.uint8)
MASK[30:, 100:200] = 255


@pytest.fixture
def image() -> np.ndarray:
    rng = np.random.default_rng(0)
    return rng.integers(0, 255, (240, 320, 3)).astype(np.uint8)


def roughness(image: np.ndarray) -> int:
    return int(np.abs(np.diff(image.astype(int), axis=1)).max())


def test_head_and_surroundings_are_blurred_and_the_body_is_not(image: np.ndarray) -> None:
    seen = hidden(image, MASK, [Circle(150, 60, 25), Circle(160, 70, 25)])
    assert (seen[100:, 100:200] == image[100:, 100:200]).all()
    assert roughness(seen[52:76, 140:168]) < 30
    assert roughness(seen[:, 205:]) < 30
    assert (seen[40, 100:115] == image[40, 100:115]).all()


def test_without_a_head_nothing_is_sharp(image: np.ndarray) -> None:
    assert roughness(hidden(image, MASK, [])) < 30


def test_heads_are_those_of_the_reference_and_of_the_detector(image: np.ndarray) -> None:
    entry: dict[str, Any] = {
        "joints_m": {"neck": [0.0, 0.0, 2.0]},
        "joints_px": {"head": [300.0, 100.0]},
    }
    points = ImagePoints.of({"nose": (140.0, 44.0, 0.9), "left_wrist": (10.0, 10.0, 0.9)})
    frame = RecordedFrame(0, 0.0, image, MASK, points=points)
    radius = pytest.approx(150.0 * HEAD_RADIUS_M)
    found = heads_in(frame, entry, CAMERA, 640)
    assert found == [(150.0, 50.0, radius), (140.0, 44.0, radius)]
    assert heads_in(frame._replace(points=None), entry, CAMERA, 640) == found[:1]


def test_rows_are_filled_by_the_last_sessions() -> None:
    assert counts_of(9, 2) == [2, 2, 2, 2, 2, 2, 2, 3, 3]
    assert counts_of(1, 2) == [5]
    assert counts_of(5, 1) == [1] * 5
