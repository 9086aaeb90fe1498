"""Each value of each file that is read, replaced by hostile ones: read, or refused in words."""

from __future__ import annotations

import copy
import csv
import io
import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from cardbox_tracker.applications.retargeting.joint_map import load_joint_map
from cardbox_tracker.applications.retargeting.robot import load_robot
from cardbox_tracker.applications.simulation.session import SessionFormat, synthesize_session
from cardbox_tracker.camera.calibration_file import load_calibration
from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.camera.extrinsics_files import load_extrinsics
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.point_table import PointTable
from cardbox_tracker.measuring.scene import Scene, SceneCamera, Value, dumps_scene, load_scene
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import dumps_body_model, load_body_model
from cardbox_tracker.recordings.result_reader import read_results
from cardbox_tracker.recordings.result_table import result_table
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.recordings.truth import load_ground_truth
from cardbox_tracker.search.config import TrackerConfig, read_settings
from cardbox_tracker.segmentation.background_file import (
    StoredBackground,
    load_background,
    save_background,
)
from cardbox_tracker.segmentation.empty_scene import BackgroundModel
from cardbox_tracker.tracking.estimate import Estimate
from lab.evaluation.results import read_json
from lab.tools.reliability import refusals

ROOT = Path(__file__).parents[2]
SIZE = (32, 24)
CAMERA = Calibration.of_fov(*SIZE, 60.0)
PROMISE = "Any damaged or hostile input is read or refused with a reason"
HOSTILE: tuple[Any, ...] = (
    *(None, True, "", "x" * 5000, "\x1b[2J", "a\nb", [], {}, -1, 0),
    *(10**400, float("nan"), float("inf"), 1e308, 2**63, [320], [[None]], "9" * 4400),
)


def refused_in_words(read: Callable[[], Any]) -> None:
    with refusals():
        read()


def places(data: Any) -> Iterator[tuple[Any, ...]]:
    """Yield the path of each value, but only of the first three of a list."""
    yield ()
    items: Any = data.items() if isinstance(data, dict) else ()
    if isinstance(data, list):
        items = list(enumerate(data))[:3]
    for key, value in items:
        for path in places(value):
            yield (key, *path)


def replaced(data: Any, path: tuple[Any, ...], value: Any) -> Any:
    if not path:
        return value
    changed = copy.copy(data)
    changed[path[0]] = replaced(data[path[0]], path[1:], value)
    return changed


BODY = BodyModel.of(distance_m=2.3)
CALIBRATION = {
    "image_width": 64,
    "image_height": 48,
    "distortion_model": "plumb_bob",
    "camera_matrix": {"data": [60.0, 0, 31.5, 0, 60.0, 23.5, 0, 0, 1]},
    "distortion_coefficients": {"data": [0.1, 0, 0, 0, 0]},
}
CAMCHAIN = {
    "left": {"T_cam_imu": np.eye(4).tolist()},
    "right": {"T_cn_cnm1": np.eye(4).tolist(), "rostopic": "/right/image_raw"},
}
KALIBR = {
    "cam0": {
        "camera_model": "pinhole",
        "intrinsics": [60.0, 60.0, 31.5, 23.5],
        "rostopic": "/i",
        "resolution": [64, 48],
        "distortion_model": "radtan",
        "distortion_coeffs": [0.0] * 4,
    }
}
KNOWN = Value(0.9, 0.1, "given")
PERSON = {"image_id": 1, "keypoints": [30.0, 20.0, 0.9] * 17, "score": 0.9}
OPENPOSE = {"pose_keypoints_2d": [3.0, 2.0, 0.9] * 17, "hand_left_keypoints_2d": [1.0] * 63}
POINTS: dict[str, Any] = {
    "results.json": [PERSON, {**PERSON, "image_id": "im_2.png"}],
    "annotations.json": {"images": [{"id": 1, "file_name": "1.png"}], "annotations": [PERSON]},
    "folder/f_1_keypoints.json": {"people": [OPENPOSE]},
}
CAMERA_GROUP = Path(__file__).with_name("camera_group.toml").read_text()
SETTINGS = {"lost_frames": 10, "whole_body": {"effort": 0.5, "cost": {"yaw_deg": 20.0}}}
YAML_FILES: dict[str, tuple[Callable[[Path], Any], Any]] = {
    "body": (load_body_model, yaml.safe_load(dumps_body_model(BODY))),
    "settings": (lambda path: read_settings(path, TrackerConfig()), SETTINGS),
    "calibration": (load_calibration, CALIBRATION),
    "extrinsics": (lambda path: load_extrinsics(path, ["left", "right"]), CAMCHAIN),
    "size of FileStorage": (load_calibration, {**CALIBRATION, "image_size": [64, 48]}),
    "Kalibr": (load_calibration, KALIBR),
    "scene": (load_scene, yaml.safe_load(dumps_scene(Scene(SceneCamera(*[KNOWN] * 3), ())))),
    "joint map": (
        load_joint_map,
        yaml.safe_load((ROOT / "config" / "example_joint_map.yaml").read_text()),
    ),
}


@pytest.mark.promise(PROMISE)
@pytest.mark.parametrize("kind", YAML_FILES)
def test_yaml_files(kind: str, tmp_path: Path) -> None:
    read, data = YAML_FILES[kind]
    path = tmp_path / "file.yaml"
    for place in places(data):
        for value in HOSTILE:
            text = yaml.dump(replaced(data, place, value), Dumper=yaml.CSafeDumper)
            path.write_text(text, encoding="utf-8")
            refused_in_words(lambda: read(path))


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hostile") / "session"
    synthesize_session(folder, "bow", form=SessionFormat(2.0, 80, 60), body=BODY)
    return folder


@pytest.mark.promise(PROMISE)
def test_json_files(session: Path, tmp_path: Path) -> None:
    data = json.loads((session / "ground_truth.json").read_text())
    data["frames"], data["segments"] = data["frames"][-2:], data["segments"][-2:]
    path = tmp_path / "file.json"
    for place in places(data):
        for value in HOSTILE:
            path.write_text(json.dumps(replaced(data, place, value)))
            refused_in_words(lambda: load_ground_truth(path))
    for value in HOSTILE:
        path.write_text(json.dumps(value))
        refused_in_words(lambda: read_json(path))


@pytest.mark.promise(PROMISE)
@pytest.mark.parametrize("name", POINTS)
def test_json_files_of_points(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    given = path if path.parent == tmp_path else path.parent
    for place in places(POINTS[name]):
        for value in HOSTILE:
            path.write_text(json.dumps(replaced(POINTS[name], place, value)))
            refused_in_words(lambda: PointTable(given).read(None, SIZE))


@pytest.mark.promise(PROMISE)
def test_many_empty_objects_are_refused_before_they_are_built(tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    path.write_text(f"[{'{},' * 4_000_000}{{}}]")
    with pytest.raises(CardboxError, match="more than 4000000 lists and objects"):
        PointTable(path).read(None, SIZE)


@pytest.mark.promise(PROMISE)
@pytest.mark.parametrize("word", ["0.1", '"left"', "[cam_0]", "rotation"])
def test_toml_files(word: str, tmp_path: Path) -> None:
    path = tmp_path / "file.toml"
    for value in HOSTILE:
        path.write_text(CAMERA_GROUP.replace(word, str(value)), encoding="utf-8")
        refused_in_words(lambda: load_extrinsics(path, ["left", "right"]))


@pytest.mark.promise(PROMISE)
def test_robots(tmp_path: Path) -> None:
    text = (ROOT / "config" / "example_arm.urdf").read_text()
    path = tmp_path / "robot.urdf"
    attributes = list(re.finditer(r'\w+="([^"]*)"', text))
    for found in attributes[:60]:
        for value in HOSTILE:
            shown = str(value).replace("\x1b", "&#27;")
            path.write_text(text[: found.start(1)] + shown + text[found.end(1) :])
            refused_in_words(lambda: load_robot(path))


@pytest.fixture
def tables(tmp_path: Path) -> dict[str, tuple[Callable[[Path], Any], list[list[str]]]]:
    """A table of results and one of points, each with the function that reads it."""
    posture = np.zeros(12)
    estimate = Estimate(
        *("tracking", posture, posture, np.zeros((6, 3)), 1, 0.9),
        offset_m=np.zeros(2),
        offset_stddev_m=np.zeros(2),
    )
    blank = np.zeros(SIZE[::-1], np.uint8)
    with result_table(tmp_path / "results.csv") as add:
        for number in range(2):
            add(RecordedFrame(number * 10**8, number / 10, blank, blank), estimate)
    with (tmp_path / "results.csv").open(newline="") as file:
        results = list(csv.reader(file))
    points = [["stamp_ns", "joint", "u", "v", "score"], ["1", "nose", "3", "4", "0.5"]]
    return {
        "results": (read_results, results),
        "points": (lambda path: PointTable(path).read(None, SIZE), points),
    }


@pytest.mark.promise(PROMISE)
@pytest.mark.parametrize("kind", ["results", "points"])
def test_tables(kind: str, tables: Any, tmp_path: Path) -> None:
    read, rows = tables[kind]
    path = tmp_path / "table.csv"
    for row in range(2):
        for column in range(len(rows[0])):
            for value in map(str, HOSTILE):
                text = io.StringIO()
                changed = [list(one) for one in rows]
                changed[row][column] = value
                csv.writer(text).writerows(changed)
                path.write_text(text.getvalue(), encoding="utf-8")
                refused_in_words(lambda: read(path))


@pytest.mark.promise(PROMISE)
@pytest.mark.parametrize("time_s", ["nan", "inf", "-inf"])
def test_no_export_has_a_time_that_is_no_number(time_s: str, tables: Any, tmp_path: Path) -> None:
    _, rows = tables["results"]
    rows[1][rows[0].index("time_s")] = time_s
    path = tmp_path / "table.csv"
    with path.open("w", newline="") as file:
        csv.writer(file).writerows(rows)
    with pytest.raises(CardboxError, match="the time is"):
        read_results(path)


@pytest.mark.promise(PROMISE)
def test_arrays_in_files(tmp_path: Path) -> None:
    plane = np.full(SIZE[::-1], 90.0, np.float32)
    path = tmp_path / "background.npz"
    save_background(StoredBackground(BackgroundModel(plane, plane), CAMERA), path)
    with np.load(path) as archive:
        whole = dict(archive)
    arrays = (
        *(np.array(1), np.array(1.5), np.array("x"), np.zeros(0), np.zeros((1, 1, 1)), plane),
        *(np.full(2, 2**62), np.full(2, -1), np.full(9, np.nan), np.full(9, 1e308), np.zeros(3)),
    )
    for name in whole:
        for array in arrays:
            np.savez(path, allow_pickle=False, **{**whole, name: array})
            refused_in_words(lambda: load_background(path, SIZE))
