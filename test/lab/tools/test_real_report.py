"""The report on real people: joints as MediaPipe has them, and nobody's face."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import CardboxError
from lab.tools.real_frames import read_frames
from lab.tools.real_report import Run, cells, projected
from lab.tools.real_sheet import blurred

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)


def test_wrists_lie_before_the_knuckles() -> None:
    points = np.zeros((6, 3))
    points[:, 2] = 2.0
    points[2, 0] = 1.0
    pixels = projected(points, CAMERA)
    assert pixels[1] == pytest.approx([159.5, 119.5])
    assert pixels[2, 0] == pytest.approx(159.5 + 0.757 * 150)
    assert points[2, 0] == 1.0


def test_frames_without_an_estimate_count_in_their_column_only() -> None:
    errors = np.array(
        [[3.0, 6.0, 9.0, 5.0, 8.0, 11.0], [np.nan] * 6, [3.0, 6.0, 9.0, 5.0, 8.0, 11.0]]
    )
    run = Run([], [], errors, np.array([0.8, np.nan, 0.9]))
    chosen = np.ones(3, bool)
    assert cells([run, run], chosen) == ["7.0", "4.0", "7.0", "10.0", "0.85", "1 of 3"]
    assert cells([run], ~np.isfinite(run.iou))[-1] == "1 of 1"


def test_nobody_can_be_recognized() -> None:
    rng = np.random.default_rng(0)
    image = rng.integers(0, 255, (240, 320, 3)).astype(np.uint8)
    mask = np.zeros((240, 320), np.uint8)
    mask[40:, 100:200] = 255
    landmarks = np.array([[180.0, 120], [0, 0], [0, 0], [120, 110], [0, 0], [0, 0]])
    seen = blurred(image, mask, landmarks)
    sharp = (seen == image).all(axis=2)
    assert sharp[115:, 100:200].all()
    assert not sharp[:108].any(axis=1).all()
    assert np.abs(np.diff(seen[:108].astype(int), axis=1)).max() < 30
    assert np.abs(np.diff(seen[:, 210:].astype(int), axis=1)).max() < 30
    landmarks[0] = np.nan
    assert np.abs(np.diff(blurred(image, mask, landmarks).astype(int), axis=1)).max() < 30


def test_a_folder_that_is_no_session_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CardboxError, match=r"expected bag/, reference\.json"):
        read_frames(tmp_path)
