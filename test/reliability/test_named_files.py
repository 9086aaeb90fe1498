"""Whatever file a user names, only a regular file of some size is read, and others are named."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.applications.retargeting.joint_map import load_joint_map
from cardbox_tracker.applications.retargeting.robot import load_robot
from cardbox_tracker.camera.calibration_file import load_calibration
from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.camera.extrinsics_files import load_extrinsics
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.model_files import install_models
from cardbox_tracker.detectors.point_table import PointTable
from cardbox_tracker.person.model_file import load_body_model
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.image_folder import ImageFolder
from cardbox_tracker.recordings.truth import load_ground_truth
from cardbox_tracker.recordings.video_reader import VideoReader
from cardbox_tracker.search.config import TrackerConfig, read_settings
from cardbox_tracker.segmentation.background_file import load_background

SIZE = (320, 240)
CAMERA = Calibration.of_fov(*SIZE, 60.0)


def read_video(path: Path) -> None:
    with VideoReader(path, GivenCamera()):
        pass


def read_image(path: Path) -> None:
    folder = path.parent / "images"
    folder.mkdir()
    (folder / "1.png").symlink_to(path)
    with ImageFolder(folder, GivenCamera()):
        pass


READERS: dict[str, Callable[[Path], Any]] = {
    "person": load_body_model,
    "settings": lambda path: read_settings(path, TrackerConfig()),
    "calibration": load_calibration,
    "extrinsics": lambda path: load_extrinsics(path, ["left", "right"]),
    "background": lambda path: load_background(path, SIZE),
    "joint map": load_joint_map,
    "robot": load_robot,
    "points": lambda path: PointTable(path).read(None, SIZE),
    "truth": load_ground_truth,
    "wheel": install_models,
    "video": read_video,
    "image": read_image,
}


def pipe(path: Path) -> None:
    os.mkfifo(path)


def endless(path: Path) -> None:
    path.symlink_to("/dev/zero")


def huge(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(10**12)


def circle(path: Path) -> None:
    path.symlink_to(path)


def noise(path: Path) -> None:
    path.write_bytes(np.random.default_rng(0).bytes(5000))


@pytest.mark.promise("No input fills memory, disk or log, or holds up a program")
@pytest.mark.timeout(60)
@pytest.mark.parametrize("make", [pipe, endless, huge, Path.mkdir, circle, noise, Path.touch])
@pytest.mark.parametrize("kind", READERS)
def test_what_is_no_file_is_refused(
    kind: str, make: Callable[[Path], None], tmp_path: Path
) -> None:
    path = tmp_path / "file"
    make(path)
    with pytest.raises(CardboxError) as refused:
        READERS[kind](path)
    assert 0 < len(str(refused.value)) < 2000
