"""A background goes on after a restart or a change of the camera, if the image shows it fits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.common.errors import BackgroundFileError
from cardbox_tracker.segmentation.background_config import BackgroundConfig
from cardbox_tracker.segmentation.empty_scene import BackgroundModel
from cardbox_tracker.segmentation.kept_background import KeptBackground, compare_scene
from cardbox_tracker.segmentation.learning import StillLearning
from cardbox_tracker.segmentation.silhouettes import SilhouettePipeline

SIZE = (160, 120)


def pipeline(focal_px: float = 160.0) -> SilhouettePipeline:
    k = np.array([(focal_px, 0, 79.5), (0, focal_px, 59.5), (0, 0, 1)])
    calibration = Calibration(*SIZE, k, np.zeros(5))
    return SilhouettePipeline(calibration, SIZE, BackgroundConfig(learn_images=10), StillLearning)


def learned(room: Any) -> SilhouettePipeline:
    made = pipeline()
    while not made.learning.has_enough():
        made.learning.add(room.image())
    made.finish_learning()
    return made


@pytest.fixture
def path(tmp_path: Path, room: Any) -> Path:
    made = tmp_path / "background.npz"
    kept = KeptBackground(made, SIZE)
    assert kept.resume(pipeline(), room.image()) == ""
    assert kept.use == "not there yet"
    assert kept.keep(learned(room)) == f"; saved to {made}"
    assert kept.use == "written"
    return made


def iou(made: SilhouettePipeline, room: Any, at: float, image: Any) -> float:
    found, truth = made.silhouette(image) > 0, room.person(at)
    return float(np.count_nonzero(found & truth) / np.count_nonzero(found | truth))


@pytest.mark.parametrize("gain", [1.0, 1.2])
def test_a_restart_with_somebody_in_view_goes_on_at_the_first_image(
    path: Path, room: Any, gain: float
) -> None:
    never_stopped = learned(room)
    for at in np.linspace(20, 140, 10):
        image = room.image(at, gain=gain, sway_px=0)
        restarted = pipeline()
        done = KeptBackground(path, SIZE).resume(restarted, image)
        assert str(path) in done
        never_stopped.restart()
        expected = iou(never_stopped, room, at, image)
        assert expected > 0.9
        assert iou(restarted, room, at, image) == pytest.approx(expected, abs=0.02)


def test_a_tile_along_an_edge_stays_where_it_is() -> None:
    """It correlates as well higher and lower, so noise would choose."""
    edge = np.where(np.arange(160) < 70, 60.0, 160.0) * np.ones((120, 1))
    mean, stddev = edge.astype(np.float32), np.ones((120, 160), np.float32)
    noisy = edge + np.random.default_rng(0).normal(0, 4, edge.shape)
    fit = compare_scene(BackgroundModel(mean, stddev), noisy.astype(np.uint8))
    assert (fit.in_place, fit.shifted) == (6, 0)


def test_a_restart_goes_on_while_a_lamp_at_one_side_is_off(path: Path, room: Any) -> None:
    lamp = 0.88 - 0.28 * np.exp(-((np.arange(160) / 160 - 0.1) ** 2) / 0.2)
    image = (lamp * room.image(80.0, sway_px=0)).astype(np.uint8)
    restarted = pipeline()
    assert KeptBackground(path, SIZE).resume(restarted, image)
    assert iou(restarted, room, 80.0, image) > 0.85


def test_a_moved_camera_is_refused_until_it_is_back(path: Path, room: Any) -> None:
    kept, restarted = KeptBackground(path, SIZE), pipeline()
    with pytest.raises(BackgroundFileError, match=r"moved.*background/learn"):
        kept.resume(restarted, room.image(80, shift=(4, 0)))
    assert not restarted.is_ready and kept.use == "not used yet"
    assert kept.resume(restarted, room.image(80))
    assert restarted.is_ready and kept.use == "used"


def test_another_camera_is_refused(path: Path, room: Any) -> None:
    with pytest.raises(BackgroundFileError, match="another camera"):
        KeptBackground(path, SIZE).resume(pipeline(161.0), room.image())


def test_what_is_refused_can_be_learned_anew(path: Path, room: Any) -> None:
    kept = KeptBackground(path, SIZE)
    kept.forget()
    assert kept.resume(pipeline(161.0), room.image()) == ""


def test_a_background_survives_a_change_of_the_calibration(room: Any) -> None:
    kept, changed = KeptBackground(None, SIZE), pipeline(161.0)
    kept.carry_over(learned(room).model)
    assert "kept" in kept.resume(changed, room.image(80))
    assert changed.is_ready and changed.camera.fx == 161
    kept.carry_over(changed.model)
    assert kept.resume(pipeline(162.0), room.image(shift=(5, 0))) == ""


def test_without_a_file_nothing_is_written(room: Any) -> None:
    kept = KeptBackground(None, SIZE)
    assert kept.keep(learned(room)) == ""
