"""Whatever a stranger sends or writes is read, or refused in words: no other error leaves a parser.

``make reliability`` runs these with a hundred thousand examples each.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from cardbox_tracker.camera.calibration_file import load_calibration
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.camera_info import calibration_from_info
from cardbox_tracker.camera.encodings import (
    SUPPORTED_ENCODINGS,
    SentImage,
    decode_as_sent,
    decode_bgr,
    decode_compressed,
    decode_grey,
)
from cardbox_tracker.camera.extrinsics_files import load_extrinsics
from cardbox_tracker.commands import arguments
from cardbox_tracker.common.small_yaml import parse_small_yaml
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import dumps_body_model, loads_body_model
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.bag_writer import BagWriter
from lab.tools.reliability import refusals

CORPUS = Path(__file__).parent / "corpus"
MODEL = dumps_body_model(BodyModel())
CALIBRATION = {
    "image_width": 64,
    "image_height": 48,
    "camera_name": "eye",
    "distortion_model": "plumb_bob",
    "camera_matrix": {"rows": 3, "cols": 3, "data": [60.0, 0, 31.5, 0, 60.0, 23.5, 0, 0, 1]},
    "distortion_coefficients": {"rows": 1, "cols": 5, "data": [0.1, 0, 0, 0, 0]},
}
CAMCHAIN = """left:
  T_cam_imu: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
right:
  T_cn_cnm1: [[1, 0, 0, -0.12], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
  rostopic: /right/image_raw
"""
CAMERA_GROUP = Path(__file__).with_name("camera_group.toml").read_text()
JUNK = st.one_of(
    st.text(max_size=12),
    st.sampled_from(
        (
            *("*a", "&a [1]", "!!int ''", "!!timestamp x", "{", "[[", "? ", "<<:", "1e999", ".nan"),
            *("2001-99-99", "0x" + "f" * 300, "9" * 5000, "1:2:3", "~", "- ", "\t", "\x00"),
        )
    ),
)
NUMBERS = st.one_of(
    st.floats(), st.integers(-(2**70), 2**70), st.sampled_from([0, 1, 64, 48, 10**400])
)
VALUES = st.recursive(
    st.none() | st.booleans() | NUMBERS | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=10) | st.dictionaries(st.text(max_size=9), inner),
    max_leaves=12,
)
UINT32 = st.integers(0, 2**32 - 1) | st.sampled_from([0, 1, 2, 48, 64])


@st.composite
def damaged_text(draw: st.DrawFn, whole: str) -> str:
    """Return a text with a few places replaced by something else."""
    for _ in range(draw(st.integers(1, 4))):
        begin = draw(st.integers(0, len(whole)))
        end = begin + draw(st.integers(0, 30))
        whole = whole[:begin] + draw(JUNK) + whole[end:]
    return whole


@st.composite
def damaged_bytes(draw: st.DrawFn, whole: bytes) -> bytes:
    """Return bytes of which a few are others, or of which some are missing."""
    data = bytearray(whole)
    for _ in range(draw(st.integers(1, 6))):
        begin = draw(st.integers(0, max(len(data) - 1, 0)))
        new = draw(st.binary(max_size=8))
        end = begin + draw(st.sampled_from([len(new), len(new), 0, 8, len(data)]))
        data[begin:end] = new
    return bytes(data)


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@given(st.text(max_size=200) | st.lists(JUNK, max_size=12).map("".join))
def test_yaml(text: str) -> None:
    with refusals():
        parse_small_yaml(text)


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@given(damaged_text(MODEL))
@example(MODEL.replace("sizes:", "sizes: !!timestamp x\nold:"))
@example(MODEL.replace("format:", "format: !!bool x\nold:"))
@example("[" * 3000)
def test_body_model(text: str) -> None:
    with refusals():
        loads_body_model(text)


@st.composite
def calibrations(draw: st.DrawFn) -> str:
    data: dict[str, Any] = {**CALIBRATION, "camera_matrix": dict(CALIBRATION["camera_matrix"])}  # type: ignore[call-overload]
    for key in draw(st.sets(st.sampled_from(sorted(data)), max_size=3)):
        data[key] = draw(VALUES | st.fixed_dictionaries({"data": VALUES | st.lists(NUMBERS)}))
    return draw(damaged_text(yaml.safe_dump(data))) if draw(st.booleans()) else yaml.safe_dump(data)


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@given(calibrations())
@example(yaml.safe_dump({**CALIBRATION, "image_width": 10**400}))
def test_calibration(text: str) -> None:
    read_calibration(text.encode("utf-8", "replace"))


def read_calibration(data: bytes) -> None:
    with tempfile.NamedTemporaryFile() as file:
        file.write(data)
        file.flush()
        with refusals():
            found = load_calibration(file.name)
            found.camera(64, 48)
            found.rectifier(64, 48)


def read_extrinsics(data: bytes, suffix: str) -> None:
    with tempfile.NamedTemporaryFile(suffix=suffix) as file:
        file.write(data)
        file.flush()
        with refusals():
            (found,) = load_extrinsics(file.name, ["left", "right"]).values()
            assert np.isfinite([*found.centre_m, *found.rotation.ravel()]).all()


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@given(damaged_text(CAMCHAIN), st.just(".yaml"))
@example(CAMCHAIN.replace("-0.12", "0x" + "f" * 300), ".yaml")
@example(CAMCHAIN.replace("-0.12", "1e308"), ".yaml")
def test_extrinsics(text: str, suffix: str) -> None:
    read_extrinsics(text.encode("utf-8", "replace"), suffix)


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@given(damaged_text(CAMERA_GROUP), st.just(".toml"))
@example(CAMERA_GROUP.replace("0.1", "1e308"), ".toml")
@example(CAMERA_GROUP.replace("0.1", "9" * 5000), ".toml")
@example("a = " + "[" * 3000, ".toml")
def test_camera_group(text: str, suffix: str) -> None:
    read_extrinsics(text.encode("utf-8", "replace"), suffix)


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@given(
    st.builds(
        SimpleNamespace,
        width=UINT32,
        height=UINT32,
        distortion_model=st.sampled_from(["plumb_bob", "rational_polynomial", "equidistant", ""])
        | st.text(max_size=20),
        d=st.lists(st.floats(), max_size=15),
        p=st.sampled_from([[0.0] * 12, [60.0, 0, 31, 0, 0, 60, 23, 0, 0, 0, 1, 0], [1e308] * 12]),
        k=st.lists(st.floats(), min_size=9, max_size=9)
        | st.just([60.0, 0, 31.5, 0, 60.0, 23.5, 0, 0, 1]),
        roi=st.builds(
            SimpleNamespace, x_offset=UINT32, y_offset=UINT32, width=UINT32, height=UINT32
        ),
        binning_x=UINT32,
        binning_y=UINT32,
        header=st.just(SimpleNamespace(frame_id="eye")),
    )
)
def test_camera_info(message: SimpleNamespace) -> None:
    with refusals():
        found = calibration_from_info(message, "/image_raw", "/camera_info")
        found.camera(64, 48)
        found.rectifier(64, 48)


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@given(
    st.binary(max_size=200),
    st.integers(0, 12) | UINT32,
    st.integers(0, 12) | UINT32,
    st.integers(0, 40) | UINT32,
    st.sampled_from(SUPPORTED_ENCODINGS) | st.text(max_size=20),
    st.booleans(),
)
def test_image(data: bytes, height: int, width: int, step: int, encoding: str, big: bool) -> None:
    for decode in (decode_grey, decode_bgr, decode_as_sent):
        with refusals():
            assert decode(SentImage(data, height, width, step, encoding, big)).shape[:2] == (
                height,
                width,
            )


@cache
def compressed(extension: str) -> bytes:
    image = np.random.default_rng(0).integers(0, 255, (12, 16, 3), dtype=np.uint8)
    return bytes(cv2.imencode(extension, image)[1].tobytes())


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@given(damaged_bytes(compressed(".jpg")) | damaged_bytes(compressed(".png")))
def test_compressed_image(data: bytes) -> None:
    with refusals():
        assert decode_compressed(data, most_pixels=10**6).size < 10**7


@cache
def recording(storage: str) -> dict[str, bytes]:
    """The files of a small recording."""
    camera = Camera(16, 12, 16.0, 16.0, 7.5, 5.5)
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        with BagWriter(bag, storage) as writer:
            for number in range(2):
                writer.write_camera_info("/camera_info", number, "eye", camera)
                image = np.full((12, 16), number, np.uint8)
                writer.write_image("/image_raw", number, "eye", image, "mono8")
        return {file.name: file.read_bytes() for file in bag.iterdir()}


@st.composite
def recordings(draw: st.DrawFn) -> dict[str, bytes]:
    files = dict(recording(draw(st.sampled_from(["mcap", "sqlite3"]))))
    name = draw(st.sampled_from(sorted(files)))
    return {**files, name: draw(damaged_bytes(files[name]))}


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
# Hypothesis warns of its own long texts about large recordings.
@pytest.mark.filterwarnings("ignore:Generating overly large repr")
@given(recordings())
def test_recording(files: dict[str, bytes]) -> None:
    folder = Path(tempfile.mkdtemp())
    try:
        for name, data in files.items():
            (folder / name).write_bytes(data)
        with refusals(), BagReader(folder) as bag:
            bag.calibration().camera(16, 12)
            for image in bag.images():
                assert image.as_sent.dtype == np.uint8
    finally:
        shutil.rmtree(folder)


def test_corpus() -> None:
    """Every input of the corpus: see its README."""
    readers: dict[str, Callable[[bytes], Any]] = {
        "yaml": lambda data: parse_small_yaml(data.decode("utf-8", "replace")),
        "body_model": lambda data: loads_body_model(data.decode("utf-8", "replace")),
        "calibration": read_calibration,
        "extrinsics": lambda data: read_extrinsics(data, ".yaml"),
        "camera_group": lambda data: read_extrinsics(data, ".toml"),
        "compressed_image": lambda data: decode_compressed(data, most_pixels=10**6),
    }
    folders = {folder.name for folder in CORPUS.iterdir() if folder.is_dir()}
    assert folders == set(readers)
    for name, read in readers.items():
        files = sorted((CORPUS / name).iterdir())
        assert files
        for file in files:
            with refusals():
                read(file.read_bytes())


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@given(
    st.text(max_size=20) | st.tuples(NUMBERS, NUMBERS).map(lambda pair: f"{pair[0]}:{pair[1]}"),
    st.sampled_from((arguments.span, arguments.time, *map(arguments.at_least, (0, 1, 2)))),
)
def test_words(word: str, convert: Any) -> None:
    try:
        convert(word)
    except argparse.ArgumentTypeError as error:
        assert "expected" in str(error)
