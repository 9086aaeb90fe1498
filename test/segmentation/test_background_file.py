"""The learned background in a file: whole or not at all, read only if it is what it should be."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.common.errors import BackgroundFileError
from cardbox_tracker.segmentation.background_file import (
    StoredBackground,
    background_path,
    load_background,
    save_background,
)
from cardbox_tracker.segmentation.chroma import ChromaModel
from cardbox_tracker.segmentation.empty_scene import BackgroundModel

SIZE = (16, 12)
K = np.array([(330.0, 0, 159.5), (0, 330.0, 119.5), (0, 0, 1)])
CALIBRATION = Calibration(320, 240, K, np.array([0.1, 0.0, 0.0, 0.0, 0.0]))


def planes(*shape: int) -> Any:
    return np.random.default_rng(len(shape)).uniform(0, 255, shape).astype(np.float32)


def stored(*, color: bool = True) -> StoredBackground:
    chroma = ChromaModel(planes(3, 6, 8), planes(3, 6, 8)) if color else None
    return StoredBackground(BackgroundModel(planes(12, 16), planes(12, 16), chroma), CALIBRATION)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    made = tmp_path / "background.npz"
    save_background(stored(), made)
    return made


def with_entry(path: Path, **entries: Any) -> None:
    with np.load(path) as archive:
        arrays = dict(archive) | entries
    np.savez(path, **{key: value for key, value in arrays.items() if value is not None})


@pytest.mark.parametrize("color", [False, True])
def test_what_is_written_is_read(tmp_path: Path, color: bool) -> None:
    original = stored(color=color)
    save_background(original, tmp_path / "b.npz")
    read = load_background(tmp_path / "b.npz", SIZE)
    np.testing.assert_array_equal(read.model.mean, original.model.mean)
    np.testing.assert_array_equal(read.model.stddev, original.model.stddev)
    assert (read.model.chroma is None) == (not color)
    if read.model.chroma is not None and original.model.chroma is not None:
        np.testing.assert_array_equal(read.model.chroma.mean, original.model.chroma.mean)
        np.testing.assert_array_equal(read.model.chroma.stddev, original.model.chroma.stddev)
    assert read.calibration.is_same(CALIBRATION)
    read.check_camera(CALIBRATION, "b.npz")
    assert os.listdir(tmp_path) == ["b.npz"]


def test_another_camera_is_refused_with_both(path: Path) -> None:
    other = Calibration(320, 240, K + np.diag((1.0, 1.0, 0.0)), np.zeros(5))
    with pytest.raises(BackgroundFileError, match=r"330 px, plumb_bob.*331 px, no distortion"):
        load_background(path, SIZE).check_camera(other, "b.npz")


def test_another_working_size_is_refused(path: Path) -> None:
    for size in ((32, 24), (24, 16)):
        with pytest.raises(BackgroundFileError, match=r"16x12|too much"):
            load_background(path, size)


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({"format": np.array("something_else")}, "format .*'something_else'"),
        ({"format": None}, "'format'"),
        ({"mean": None}, "'mean'"),
        ({"mean": planes(12, 16) + np.nan}, "0 to 255"),
        ({"stddev": planes(12, 16) - 300}, "0 to 255"),
        ({"stddev": planes(6, 16)}, "'stddev' .*shape"),
        ({"mean": np.zeros((12, 16))}, "float64"),
        ({"chroma_mean": planes(3, 5, 8)}, "'chroma_mean' .*shape"),
        ({"mean": planes(1200, 1600)}, "too much"),
        ({"distortion": np.zeros(1000)}, "too much"),
        ({"distortion_model": np.array("x" * 1000)}, "too much"),
        ({"k": np.zeros(4)}, "of another type, size or range"),
        ({"size": np.array([320])}, "size is not two whole numbers"),
    ],
)
def test_what_is_no_background_is_refused(path: Path, entries: Any, words: str) -> None:
    with_entry(path, **entries)
    with pytest.raises(BackgroundFileError, match=words) as error:
        load_background(path, SIZE)
    assert str(path) in str(error.value)


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({"size": np.array([-320, -240])}, "-320x-240"),
        ({"size": np.array([0, 0])}, "0x0"),
        ({"size": np.array([320.0, 240.0])}, "whole numbers"),
        ({"size": np.array([2**62, 2**62])}, "at most"),
        ({"k": K * np.nan}, "not finite"),
        ({"k": -K}, "focal length"),
        ({"distortion": np.full(5, np.inf)}, "not finite"),
        ({"distortion": np.ones(5), "distortion_model": np.array("mirror")}, "mirror"),
        ({"format": np.array(["cardbox_background_1"] * 2)}, "format"),
    ],
)
def test_a_camera_that_cannot_be_is_refused(path: Path, entries: Any, words: str) -> None:
    with_entry(path, **entries)
    with pytest.raises(BackgroundFileError, match=words):
        load_background(path, SIZE)


def entry_of(header: str, data: bytes = b"") -> bytes:
    """Return an entry of an archive with any header."""
    text = header.encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + data


def crafted(path: Path, name: str, content: bytes, kind: int = zipfile.ZIP_STORED) -> None:
    """Replace an entry of the background."""
    with_entry(path, **{name: None})
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(f"{name}.npy", content, kind)


@pytest.mark.promise("Any damaged or hostile input is read or refused with a reason")
@pytest.mark.parametrize("name", ["mean", "size", "format"])
@pytest.mark.parametrize(
    "header",
    [
        "(" * 9000,
        "{'descr': " + "[" * 3000,
        "{'descr': '<f4', 'shape': (",
        '"""',
        "{'descr': '<f4', 'fortran_order': False, 'shape': 7, }\n",
        "{'descr': '<f4', 'fortran_order': False, 'shape': (-12, -16), }\n",
        "{'descr': '<f4', 'fortran_order': False, 'shape': (12, None), }\n",
        "{'descr': '<f4', 'fortran_order': False, 'shape': (1000000, 1000000), }\n",
        "{'descr': '<U999999999', 'fortran_order': False, 'shape': (), }\n",
        "{'descr': '|O', 'fortran_order': False, 'shape': (12, 16), }\n",
        "{'descr': [['x', {}]], 'fortran_order': False, 'shape': (12, 16), }\n",
        "{1: 2}",
        "",
    ],
)
def test_no_header_is_evaluated(path: Path, name: str, header: str) -> None:
    whole = path.read_bytes()
    for rest in (b"", bytes(1000)):
        path.write_bytes(whole)
        crafted(path, name, entry_of(header, rest))
        with pytest.raises(BackgroundFileError, match="background that can be used"):
            load_background(path, SIZE)


def test_a_bomb_and_rare_compressions_are_refused(path: Path) -> None:
    begun = "{'descr': '<f4', 'fortran_order': False, 'shape': (12, 16), }\n"
    crafted(path, "mean", entry_of(begun, bytes(10**8)), zipfile.ZIP_DEFLATED)
    assert load_background(path, SIZE).model.mean.max() == 0.0
    for kind in (zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2):
        save_background(stored(), path)
        crafted(path, "mean", entry_of(begun, bytes(1000)), kind)
        with pytest.raises(BackgroundFileError, match="compressed"):
            load_background(path, SIZE)


@pytest.mark.promise("No input fills memory, disk or log, or holds up a program")
def test_only_a_file_of_some_size_is_opened(path: Path, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with (tmp_path / "huge").open("wb") as file:
        file.truncate(10**10)
    (tmp_path / "link").symlink_to("/dev/zero")
    for name, words in (
        ("pipe", "pipe or a device"),
        ("link", "pipe or a device"),
        ("huge", "more than 256 MB"),
        (".", "directory"),
        ("none", "No such file"),
    ):
        with pytest.raises(BackgroundFileError, match=f"{words}.*the file"):
            load_background(tmp_path / name, SIZE)


def test_pickled_objects_are_never_loaded(path: Path) -> None:
    with np.load(path) as archive:
        arrays = dict(archive)
    np.savez(path, **(arrays | {"size": np.array([{}, {}], dtype=object)}))
    with pytest.raises(BackgroundFileError, match=r"background\.npz"):
        load_background(path, SIZE)


def test_a_huge_header_is_refused_before_anything_is_allocated(path: Path) -> None:
    with np.load(path) as archive:
        arrays = dict(archive)
    del arrays["mean"]
    np.savez(path, **arrays)
    header = b"{'descr': '<f4', 'fortran_order': False, 'shape': (999999999, 999999999), }\n"
    entry = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header
    with zipfile.ZipFile(path, "a") as archive_file:
        archive_file.writestr("mean.npy", entry)
    with pytest.raises(BackgroundFileError, match="too much"):
        load_background(path, SIZE)


def test_a_damaged_file_is_refused_wherever_it_is_damaged(path: Path) -> None:
    whole = path.read_bytes()
    rng = np.random.default_rng()
    for length in (0, 1, 100, len(whole) // 2, len(whole) - 5):
        path.write_bytes(whole[:length])
        with pytest.raises(BackgroundFileError, match=r"background\.npz"):
            load_background(path, SIZE)
    for _ in range(200):
        damaged = bytearray(whole)
        for place in rng.integers(0, len(whole), 20):
            damaged[place] = rng.integers(256)
        path.write_bytes(damaged)
        try:
            load_background(path, SIZE)
        except BackgroundFileError:
            continue


def test_a_text_is_refused(path: Path) -> None:
    path.write_text("sizes:\n  torso_height: 0.5\n")
    with pytest.raises(BackgroundFileError, match=r"expected .*background node"):
        load_background(path, SIZE)


def test_home_is_expanded_and_no_name_is_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert background_path("~/b.npz") == tmp_path / "b.npz"
    assert background_path("") is None
    assert os.listdir(tmp_path) == []


def test_what_cannot_be_a_file_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for name, words in (
        (str(tmp_path), "folder"),
        (str(tmp_path / "pipe"), "ordinary file"),
        (str(tmp_path / "none" / "b.npz"), "No such file"),
        ("/proc/b.npz", "/proc/b.npz"),
        ("/dev/null", "ordinary file"),
        ("~nobody_of_that_name/b.npz", "nobody_of_that_name"),
        ("b" * 300, "too long"),
    ):
        with pytest.raises(BackgroundFileError, match=words):
            background_path(name)


def test_what_cannot_be_written_is_said(tmp_path: Path) -> None:
    with pytest.raises(BackgroundFileError, match="choose a folder"):
        save_background(stored(), tmp_path / "none" / "b.npz")
