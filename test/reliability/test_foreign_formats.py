"""Whatever stands in a foreign file, its reader reads it, or refuses the file by its name."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image

from cardbox_tracker.applications.retargeting.joint_map import load_joint_map
from cardbox_tracker.applications.retargeting.robot import load_robot
from cardbox_tracker.camera.calibration_file import load_calibration
from cardbox_tracker.camera.extrinsics_files import load_extrinsics
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.point_table import PointTable
from cardbox_tracker.measuring.scene import Scene, SceneCamera, Value, dumps_scene, load_scene
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES
from cardbox_tracker.recordings.focal_length import equivalent_mm
from cardbox_tracker.recordings.result_reader import read_results
from cardbox_tracker.recordings.truth import load_ground_truth
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.search.settings_file import read_settings
from cardbox_tracker.segmentation.background_file import load_background

K = [60.0, 0.0, 31.5, 0.0, 60.0, 23.5, 0.0, 0.0, 1.0]
POINTS = [30.0, 20.0, 0.9] * 17
ROWS = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
JUNK = (
    None,
    [],
    {},
    "",
    "x",
    "9" * 4400,
    -1,
    0,
    True,
    1e308,
    float("nan"),
    [320],
    [[None]],
    {"a": 1},
)
"""What stands in the place of each value and mapping of a file in turn."""

Read = Callable[[Path], Any]


def points(path: Path) -> Any:
    return PointTable(path).read(None, (64, 48))


CAMERA = {"image_width": 64, "image_height": 48, "camera_matrix": {"data": K}}
CAMERA |= {"distortion_model": "plumb_bob", "distortion_coefficients": {"data": [0.1, 0, 0, 0, 0]}}
ENTRY = {"image_id": 1, "category_id": 1, "keypoints": POINTS, "score": 0.9}
TREES: dict[str, tuple[str, Any, Read]] = {
    "calibration": ("a.yaml", CAMERA, load_calibration),
    "size of FileStorage": ("a.json", {**CAMERA, "image_size": [64, 48]}, load_calibration),
    "Kalibr": (
        "k.yaml",
        {
            "cam0": {"camera_model": "pinhole", "intrinsics": K[:4], "resolution": [64, 48]}
            | {"distortion_model": "radtan", "distortion_coeffs": [0.0] * 4, "rostopic": "/l/i"}
        },
        load_calibration,
    ),
    "extrinsics": (
        "e.yaml",
        {"l": {"rostopic": "/l/image"}, "r": {"T_cn_cnm1": ROWS, "rostopic": "/r/image"}},
        lambda path: load_extrinsics(path, ["l", "r"]),
    ),
    "results of COCO": ("c.json", [ENTRY, {**ENTRY, "image_id": "im_2.png"}], points),
    "annotations of COCO": (
        "c.json",
        {"images": [{"id": 1, "file_name": "im_1.png"}], "annotations": [ENTRY]},
        points,
    ),
    "OpenPose": (
        "folder/f_1_keypoints.json",
        {"people": [{"pose_keypoints_2d": POINTS, "hand_left_keypoints_2d": [1.0] * 63}]},
        lambda path: points(path.parent),
    ),
    "joint map": (
        "j.yaml",
        {"joints": [{"from": "torso_yaw", "to": "a", "scale": 1.0}]},
        load_joint_map,
    ),
    "settings": (
        "s.yaml",
        {"lost_frames": 10, "whole_body": {"effort": 0.5, "cost": {"yaw_deg": 20.0}}},
        lambda path: read_settings(path, TrackerConfig()),
    ),
    "truth": (
        "t.json",
        {
            "camera": {"width": 64, "height": 48, "pitch_down_deg": 0.0},
            "person": {"distance_m": 2.0, "height": 1.7},
            "side_posture_turns_to": "left",
            "segments": [{"name": "front", "start_s": 0.0, "end_s": 1.0}],
            "frames": [
                {"stamp_ns": 1, "segment": "front", "torso_rpy_deg": [0, 0, 0]}
                | {
                    "joints_m": {name: [0, 0, 2] for name in KEYPOINT_NAMES},
                    "torso_rpy_deg": [0, 0, 0],
                }
            ],
        },
        load_ground_truth,
    ),
    "scene": (
        "s.yaml",
        yaml.safe_load(dumps_scene(Scene(SceneCamera(*[Value(0.9, 0.1, "given")] * 3), ()))),
        load_scene,
    ),
}


def places(tree: Any) -> Iterator[tuple[Any, ...]]:
    """Yield the keys that lead to each value in a tree, of a long list to the first and last."""
    yield ()
    pairs = tree.items() if isinstance(tree, dict) else ()
    if isinstance(tree, list):
        pairs = [(number, tree[number]) for number in {0, len(tree) - 1} if tree]
    for key, value in pairs:
        for rest in places(value):
            yield key, *rest


def replaced(tree: Any, place: tuple[Any, ...], value: Any) -> Any:
    """Return a tree with another value at a place."""
    if not place:
        return value
    copy = tree.copy()
    copy[place[0]] = replaced(copy[place[0]], place[1:], value)
    return copy


def is_read_or_refused(read: Read, path: Path, note: object) -> None:
    try:
        read(path)
    except CardboxError as error:
        assert str(path) in str(error) or str(path.parent) in str(error), (note, str(error))
        assert len(str(error)) < 2000
    except Exception as error:
        raise AssertionError(f"{note}: {error!r}") from error


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@pytest.mark.parametrize("name", TREES)
def test_whatever_stands_in_a_place(tmp_path: Path, name: str) -> None:
    file, tree, read = TREES[name]
    path = tmp_path / file
    path.parent.mkdir(exist_ok=True)
    for place in places(tree):
        for junk in JUNK:
            damaged = replaced(tree, place, junk)
            dump = json.dumps if file.endswith("json") else yaml.safe_dump
            path.write_text(dump(damaged))
            is_read_or_refused(read, path, (place, str(junk)[:20]))


def background() -> bytes:
    file = io.BytesIO()
    np.savez(file, mean=np.zeros((48, 64), np.float32), stddev=np.ones((48, 64), np.float32))
    return file.getvalue()


def photo() -> bytes:
    exif, file = Image.Exif(), io.BytesIO()
    exif.get_ifd(0x8769)[0xA405] = 28
    Image.new("RGB", (16, 12)).save(file, "jpeg", exif=exif)
    return file.getvalue()


TABLE = "stamp_ns,joint,u,v,score\n" + "1,left_wrist,3.5,4,0.5\n" * 3
RESULTS = "stamp_ns,time_s,state,torso_y,torso_pitch\n1,0.0,tracking,0.1,0.2\n2,0.1,lost,,\n"
ROBOT = (
    '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="revolute">'
    '<parent link="a"/><child link="b"/><axis xyz="0 0 1"/><origin xyz="0 0 1" rpy="0 0 0"/>'
    '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>'
)
BYTES: dict[str, tuple[str, bytes, Read]] = {
    "points": ("p.csv", TABLE.encode(), points),
    "results": ("r.csv", RESULTS.encode(), read_results),
    "robot": ("r.urdf", ROBOT.encode(), load_robot),
    "background": ("b.npz", background(), lambda path: load_background(path, (64, 48))),
    "photo": ("p.jpg", photo(), equivalent_mm),
}


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@pytest.mark.parametrize("name", BYTES)
def test_whatever_bytes_are_damaged(tmp_path: Path, name: str) -> None:
    file, whole, read = BYTES[name]
    path, rng = tmp_path / file, np.random.default_rng(0)
    for number in range(300):
        data = bytearray(whole)
        for at in rng.integers(0, len(data), rng.integers(1, 6)):
            data[at : at + rng.integers(0, 4)] = rng.bytes(rng.integers(0, 4))
        if number % 3 == 0:
            del data[rng.integers(0, len(data)) :]
        path.write_bytes(data)
        is_read_or_refused(read, path, number)
