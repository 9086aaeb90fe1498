"""Each value of each file, replaced by hostile and random ones: it is read, or refused in words."""

from __future__ import annotations

import argparse
import copy
import csv
import io
import json
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, suppress
from dataclasses import fields, replace
from functools import cache
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st
from PIL import Image

from cardbox_tracker.applications.drawing.video import video_file
from cardbox_tracker.applications.retargeting.joint_map import load_joint_map
from cardbox_tracker.applications.retargeting.robot import load_robot, parse_robot
from cardbox_tracker.applications.simulation.session import SessionFormat, synthesize_session
from cardbox_tracker.camera.calibration_file import load_calibration
from cardbox_tracker.camera.camera import Calibration, Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.extrinsics_files import load_extrinsics
from cardbox_tracker.camera.view import OtherCamera
from cardbox_tracker.commands.arguments import add_options
from cardbox_tracker.commands.request import Request, TrackArguments
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.settings import nested, settings_below
from cardbox_tracker.detectors.image_points import COCO_NAMES, ImagePoints
from cardbox_tracker.detectors.point_table import PointTable
from cardbox_tracker.measuring.scene import Scene, SceneCamera, Value, dumps_scene, load_scene
from cardbox_tracker.person.model import CONSTANTS, BodyModel, body_from_proportions
from cardbox_tracker.person.model_file import dumps_body_model, load_body_model
from cardbox_tracker.recordings.given_camera import GivenCamera, told_focal
from cardbox_tracker.recordings.image_folder import ImageFolder
from cardbox_tracker.recordings.result_reader import read_results
from cardbox_tracker.recordings.result_table import result_table
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.recordings.truth import load_ground_truth
from cardbox_tracker.recordings.video_reader import VideoReader
from cardbox_tracker.search.config import TrackerConfig, default_preset, read_settings
from cardbox_tracker.segmentation.background_file import (
    StoredBackground,
    load_background,
    save_background,
)
from cardbox_tracker.segmentation.empty_scene import BackgroundModel
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.observation import CHANNELS, Observation
from cardbox_tracker.tracking.session import Session
from lab.evaluation.results import read_json
from lab.tools.reliability import refusals

ROOT = Path(__file__).parents[2]
SIZE = (32, 24)
CAMERA = Calibration.of_fov(*SIZE, 60.0)
NOWHERE = np.full((17, 2), np.nan)
ASIDE = Extrinsics(np.eye(3), np.array([-0.5, 0.0, 0.0]))
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
PAIR = {
    "R": {"rows": 3, "cols": 3, "dt": "d", "data": np.eye(3).ravel().tolist()},
    "T": {"rows": 3, "cols": 1, "dt": "d", "data": [-0.5, 0.0, 0.0]},
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
    "annotations.json": {
        "categories": [{"id": 1, "keypoints": [*reversed(COCO_NAMES)]}],
        "images": [{"id": 1, "file_name": "1.png"}],
        "annotations": [{**PERSON, "category_id": 1}],
    },
    "folder/f_1_keypoints.json": {"people": [OPENPOSE]},
}
CAMERA_GROUP = Path(__file__).with_name("camera_group.toml").read_text()
SETTINGS = {"lost_frames": 10, "whole_body": {"effort": 0.5, "cost": {"yaw_deg": 20.0}}}
YAML_FILES: dict[str, tuple[Callable[[Path], Any], Any]] = {
    "body": (load_body_model, yaml.safe_load(dumps_body_model(BODY))),
    "settings": (lambda path: read_settings(path, TrackerConfig()), SETTINGS),
    "calibration": (load_calibration, CALIBRATION),
    "extrinsics": (lambda path: load_extrinsics(path, ["left", "right"]), CAMCHAIN),
    "pair": (lambda path: load_extrinsics(path, ["left", "right"]), PAIR),
    "size of FileStorage": (load_calibration, {**CALIBRATION, "image_size": [64, 48]}),
    "Kalibr": (load_calibration, KALIBR),
    "scene": (load_scene, yaml.safe_load(dumps_scene(Scene(SceneCamera(*[KNOWN] * 3), ())))),
    "joint map": (
        load_joint_map,
        yaml.safe_load((ROOT / "config" / "example_joint_map.yaml").read_text()),
    ),
}


GONE = object()
ANY = st.one_of(
    st.sampled_from((*HOSTILE, GONE)),
    *(st.floats(), st.integers(-(2**70), 2**70), st.text(max_size=9), st.floats(0.0, 1.0)),
)


@st.composite
def changed(draw: st.DrawFn, whole: Any) -> Any:
    """Return content of which a few values are others, a little larger or smaller, or missing."""
    for _ in range(draw(st.integers(1, 4))):
        place = draw(st.sampled_from(list(places(whole))))
        before = whole
        for key in place:
            before = before[key]
        if isinstance(before, float) and draw(st.booleans()):
            value = before * draw(st.floats(-2.0, 2.0)) + draw(st.floats(-1.0, 1.0))
        else:
            value = draw(ANY)
        whole = replaced(whole, place, value)
    return without_gone(whole)


def without_gone(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: without_gone(one) for key, one in data.items() if one is not GONE}
    if isinstance(data, list):
        return [without_gone(one) for one in data if one is not GONE]
    return None if data is GONE else data


@contextmanager
def file_of(content: bytes | str, name: str = "file.yaml") -> Iterator[Path]:
    """Context of a new file."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(
            content.encode("utf-8", "replace") if isinstance(content, str) else content
        )
        yield path


@pytest.mark.promise(PROMISE)
@pytest.mark.parametrize("kind", YAML_FILES)
@given(draw=st.data())
def test_any_yaml_file(kind: str, draw: st.DataObject) -> None:
    read, whole = YAML_FILES[kind]
    text = yaml.dump(draw.draw(changed(whole)), Dumper=yaml.CSafeDumper)
    with file_of(text) as path, refusals():
        read(path)


@pytest.mark.promise(PROMISE)
@pytest.mark.parametrize("name", POINTS)
@given(draw=st.data())
def test_any_points(name: str, draw: st.DataObject) -> None:
    with file_of(json.dumps(draw.draw(changed(POINTS[name]))), name) as path, refusals():
        PointTable(path.parent if "/" in name else path).read(None, SIZE)


ARM = (ROOT / "config" / "example_arm.urdf").read_text()
ATTRIBUTES = [found.span(1) for found in re.finditer(r'\w+="([^"]*)"', ARM)]


@pytest.mark.promise(PROMISE)
@given(
    st.dictionaries(st.sampled_from(ATTRIBUTES), ANY | st.sampled_from(ARM.split('"')), max_size=4)
)
def test_any_robot(values: dict[tuple[int, int], Any]) -> None:
    text = ARM
    for (begin, end), value in sorted(values.items(), key=lambda item: item[0], reverse=True):
        text = text[:begin] + ("" if value is GONE else str(value)) + text[end:]
    with refusals():
        parse_robot(text)


@cache
def film() -> bytes:
    """A small MP4, whose boxes are at its end."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "a.mp4"
        with video_file(path, 10.0) as add:
            for level in range(3):
                add(np.full((*SIZE[::-1], 3), 80 * level, np.uint8))
        return path.read_bytes()


@cache
def photo() -> bytes:
    """A small JPEG with a lens in its EXIF."""
    exif, file = Image.Exif(), io.BytesIO()
    exif[0x0110], exif[0x0112] = "ILCE-7M3", 6
    exif.get_ifd(0x8769).update({0xA405: 28, 0x920A: 4.2, 0xA20E: 900.0, 0xA002: 32})
    Image.new("RGB", SIZE).save(file, "JPEG", exif=exif)
    return file.getvalue()


@st.composite
def changed_bytes(draw: st.DrawFn, whole: bytes, begin: int, end: int) -> bytes:
    """Return bytes with other numbers of one to eight bytes between ``begin`` and ``end``."""
    data = bytearray(whole)
    for _ in range(draw(st.integers(1, 5))):
        place, size = draw(st.integers(begin, end - 8)), draw(st.sampled_from([1, 2, 4, 8]))
        data[place : place + size] = draw(st.binary(min_size=size, max_size=size))
    return bytes(data[: draw(st.integers(begin, len(data)))] if draw(st.booleans()) else data)


@pytest.mark.promise(PROMISE)
@given(st.data())
def test_any_boxes_of_a_film(draw: st.DataObject) -> None:
    whole = film()
    data = draw.draw(changed_bytes(whole, whole.index(b"moov") - 4, len(whole)))
    with file_of(data, "film.mp4") as path, refusals():
        told_focal(path)
        with VideoReader(path, GivenCamera(fov_deg=60.0)) as reader:
            assert all(image.as_sent.dtype == np.uint8 for image in islice(reader.images(), 9))


@pytest.mark.promise(PROMISE)
@given(st.data())
def test_any_exif(draw: st.DataObject) -> None:
    whole = photo()
    data = draw.draw(changed_bytes(whole, 2, whole.index(b"\xff\xdb")))
    with file_of(data, "images/1.jpg") as path, refusals():
        told_focal(path)
        with ImageFolder(path.parent, GivenCamera()) as folder:
            assert all(image.as_sent.dtype == np.uint8 for image in folder.images())


NUMBER = st.one_of(
    *(st.floats(), st.floats(-3.0, 3.0), st.integers(), st.none(), st.text(max_size=3)),
    st.sampled_from([*HOSTILE[:-1], len, float, np.float32("nan"), np.array([1.0, 2.0])]),
)


@pytest.mark.promise(PROMISE)
@given(
    st.sampled_from(
        [
            *(f"camera {one.name}" for one in fields(Camera)),
            *(f"calibration {one.name}" for one in fields(Calibration)),
            *(f"points {name}" for name in ("px", "scores", "spatial_m", "legs")),
            *("named", "named nose"),
            *(f"body {name}" for name in (*CONSTANTS, "version", "stature_stddev", "unknown")),
            *("body sizes", "body shoulder_rise", "body appearance"),
            *(f"settings {name}" for name, *_ in settings_below(default_preset())),
            *(f"request {one.name}" for one in fields(Request)),
            *(f"session {name}" for name in ("bodies", "camera", "config", "rng", "others")),
            *("session scene", "observed people", "changed"),
            *("session people", "session only", "pose rotation", "pose translation_m"),
            *("stamp", "field of view", "proportions"),
        ]
    ),
    NUMBER,
)
@example("field of view", 5e-324)
@example("calibration distortion_model", 7)
@example("calibration roll_rad", np.nan)
@example("body sizes", "abc")
@example("body shoulder_rise", np.nan)
@example("points legs", 7)
@example("named nose", 5.0)
@example("observed people", 3)
@example("changed", len)
@example("session scene", "abc")
def test_any_number_in_python(of: str, value: Any) -> None:
    kind, _, name = of.partition(" ")
    camera = CAMERA.camera(*SIZE)
    make: dict[str, Callable[[], Any]] = {
        "camera": lambda: replace(camera, **{name: value}),
        "calibration": lambda: replace(CAMERA, **{name: value}).camera(*SIZE),
        "points": lambda: ImagePoints(**{"px": NOWHERE, "scores": np.zeros(17), name: value}),
        "named": lambda: ImagePoints.of({"nose": value} if name else value),
        "observed": lambda: CHANNELS[name].checked(value, name, SIZE),
        "changed": lambda: default_preset().changed(value),
        "body": lambda: BODY.with_values(**{name: value}),
        "settings": lambda: default_preset().changed(nested({name: value})),
        "request": lambda: Request(**{"recording": Path("none"), name: value}),
        "session": lambda: Session(**{"bodies": [BODY], "camera": camera, name: value}),
        "pose": lambda: OtherCamera(camera, replace(ASIDE, **{name: value})),
        "stamp": lambda: Observation(stamp_ns=value),
        "field": lambda: Calibration.of_fov(*SIZE, value),
        "proportions": lambda: body_from_proportions(value),
    }
    with refusals(ValueError):
        make[kind]()


TRACK = argparse.ArgumentParser()
add_options(TRACK, TrackArguments)
OPTIONS = [one.option_strings[-1] for one in TRACK._actions if one.option_strings]


@pytest.mark.promise(PROMISE)
@given(
    st.lists(
        st.sampled_from(OPTIONS)
        | st.text(max_size=9)
        | st.floats().map(str)
        | st.sampled_from(["0:1", "1.75", "60,43", "mediapipe", "2", "left@3", "a=1", "trc,bvh"]),
        max_size=7,
    )
)
def test_any_options(words: list[str]) -> None:
    with suppress(SystemExit), redirect_stderr(io.StringIO()), refusals():
        TrackArguments.of(TRACK.parse_args(["none", *(word for word in words if "-h" not in word)]))


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
