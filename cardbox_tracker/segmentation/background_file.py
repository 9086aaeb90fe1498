"""Saves and loads a learned background, so that a restart does not need an empty scene.

The file is a NumPy archive without pickled objects: the format's name, mean and standard deviation
of the brightness and of the colours, and the calibration of the camera. The size of every entry is
checked against the expected working size before it is unpacked.
"""

from __future__ import annotations

import math
import os
import re
import struct
import zipfile
from pathlib import Path
from typing import IO, Any, BinaryIO, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.common.errors import BackgroundFileError, CardboxError, quoted
from cardbox_tracker.common.files import (
    check_writable,
    foreign,
    is_written_in_place,
    regular_file,
    saved_file,
    user_path,
)
from cardbox_tracker.segmentation.chroma import ChromaModel
from cardbox_tracker.segmentation.empty_scene import BackgroundModel

FORMAT = "cardbox_background_1"

_FORMAT, _MEAN, _STDDEV = "format", "mean", "stddev"
_CHROMA_MEAN, _CHROMA_STDDEV = "chroma_mean", "chroma_stddev"
_SIZE, _K, _DISTORTION, _DISTORTION_MODEL = "size", "k", "distortion", "distortion_model"
_NEEDED = (_FORMAT, _MEAN, _STDDEV, _SIZE, _K, _DISTORTION, _DISTORTION_MODEL)
_COLOR = (_CHROMA_MEAN, _CHROMA_STDDEV)
_MAGIC, _HEADER = b"\x93NUMPY\x01\x00", struct.Struct("<8sH")
_WRITTEN = re.compile(
    r"\{'descr': '(?P<kind><(?:[if][48]|U\d{1,6}))', 'fortran_order': (?P<order>True|False), "
    r"'shape': \((?P<shape>(?:\d{1,12}, ?)*(?:\d{1,12})?)\), \} *\n"
)
_BRIGHTEST = 255.0


class StoredBackground(NamedTuple):
    """A background and the calibration of the camera that it was learned with."""

    model: BackgroundModel  #: the learned scene
    calibration: Calibration  #: calibration of the images that the scene was learned from

    def check_camera(self, calibration: Calibration, name: str) -> None:
        """Raise BackgroundFileError unless ``calibration`` is that of this background's camera."""
        known = self.calibration
        if not (known.is_same(calibration) or known.is_resized(calibration)):
            raise BackgroundFileError(
                f"the background in {name} was learned with another camera or calibration "
                f"({self.calibration}) than the images have now ({calibration}); start the node "
                "with the file of this camera, or call background/learn with nobody in view, "
                "which replaces it"
            )


def background_path(name: str) -> Path | None:
    """Return the path of ``name``; None if empty, BackgroundFileError if it cannot be."""
    if not name:
        return None
    try:
        path = user_path(name)
        check_writable(path)
        if is_written_in_place(path):
            raise CardboxError(f"{path} is no ordinary file; give the name of a file")
    except (CardboxError, ValueError) as error:
        raise BackgroundFileError(f"background_file: {error}") from None
    return path


def save_background(stored: StoredBackground, path: str | os.PathLike[str]) -> None:
    """Write a background atomically; raise BackgroundFileError if that fails."""
    model, calibration = stored
    arrays: dict[str, NDArray[Any]] = {
        _FORMAT: np.array(FORMAT),
        _MEAN: model.mean,
        _STDDEV: model.stddev,
        _SIZE: np.array([calibration.width, calibration.height]),
        _K: np.asarray(calibration.k, np.float64),
        _DISTORTION: np.asarray(calibration.distortion, np.float64),
        _DISTORTION_MODEL: np.array(calibration.distortion_model),
    }
    if model.chroma is not None:
        arrays |= {_CHROMA_MEAN: model.chroma.mean, _CHROMA_STDDEV: model.chroma.stddev}
    with saved_file(path, BackgroundFileError) as file:
        np.savez(file, allow_pickle=False, **arrays)


def load_background(path: str | os.PathLike[str], most: tuple[int, int]) -> StoredBackground:
    """Read a background of a pipeline with ``most`` pixels; BackgroundFileError if it is none."""
    expected = (
        "a background that can be used: the file that the background node wrote. Delete it, or "
        "give another name, and let the node learn with nobody in view"
    )
    with foreign(path, BackgroundFileError, expected):
        with regular_file(path) as file:
            # Working images have about as many pixels in each of two views, and fewer colours.
            arrays = _read(file, 2 * np.float64().nbytes * most[0] * most[1])
        return _checked(arrays, most)


def _read(file: BinaryIO, most_bytes: int) -> dict[str, NDArray[Any]]:
    arrays: dict[str, NDArray[Any]] = {}
    with zipfile.ZipFile(file) as archive:
        names = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
        for key in _NEEDED:
            if key not in names:
                raise ValueError(f"it has no entry '{key}'")
        for key in (*_NEEDED, *(k for k in _COLOR if k in names)):
            if names[key].compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise ValueError(f"'{key}' is compressed in a way that NumPy does not use")
            with archive.open(names[key]) as entry:
                arrays[key] = _array(entry, key, most_bytes)
    return arrays


def _array(entry: IO[bytes], key: str, most_bytes: int) -> NDArray[Any]:
    """Return the array of an entry with at most so many bytes, which is checked first."""
    begin = entry.read(_HEADER.size)
    if len(begin) < _HEADER.size or not begin.startswith(_MAGIC):
        raise ValueError(f"'{key}' is not in version 1.0 of NumPy's format")
    text = entry.read(_HEADER.unpack(begin)[-1]).decode("latin-1")
    # NumPy would evaluate the header as Python, with all errors of its parser.
    header = _WRITTEN.fullmatch(text)
    if header is None:
        raise ValueError(f"'{key}' has the header {quoted(text)}, which NumPy does not write")
    kind = np.dtype(header["kind"])
    shape = tuple(int(side) for side in header["shape"].split(",") if side.strip())
    count = math.prod(shape)
    if count * kind.itemsize > most_bytes:
        raise ValueError(
            f"'{key}' has the shape {shape} and type {kind}, too much for a background of this size"
        )
    data = entry.read(count * kind.itemsize)
    order: Literal["C", "F"] = "F" if header["order"] == "True" else "C"
    return np.frombuffer(data, kind, count).reshape(shape, order=order)


def _checked(arrays: dict[str, NDArray[Any]], most: tuple[int, int]) -> StoredBackground:
    if str(arrays[_FORMAT]) != FORMAT:
        raise ValueError(f"its format is '{arrays[_FORMAT]}'; this version reads '{FORMAT}'")
    if arrays[_SIZE].dtype.kind != "i" or arrays[_SIZE].shape != (2,):
        raise ValueError("its size is not two whole numbers")
    width, height = arrays[_SIZE].tolist()
    calibration = Calibration(
        width,
        height,
        np.asarray(arrays[_K], np.float64).reshape(3, 3),
        np.asarray(arrays[_DISTORTION], np.float64).ravel(),
        str(arrays[_DISTORTION_MODEL]),
    )
    size, mean = calibration.working_size(most), arrays[_MEAN]
    if mean.shape not in (size, size[::-1]):  # a camera that lies on its side
        found = "x".join(map(str, mean.shape[::-1]))
        raise ValueError(
            f"it is of {found} px, but width and height of the node ask for {size[0]}x{size[1]}"
        )
    chroma = None
    if all(key in arrays for key in _COLOR):
        shape = 3, max(mean.shape[0] // 2, 1), max(mean.shape[1] // 2, 1)
        chroma = ChromaModel(*(_plane(arrays, key, shape) for key in _COLOR))
    model = BackgroundModel(
        _plane(arrays, _MEAN, mean.shape), _plane(arrays, _STDDEV, mean.shape), chroma
    )
    return StoredBackground(model, calibration)


def _plane(
    arrays: dict[str, NDArray[Any]], key: str, shape: tuple[int, ...]
) -> NDArray[np.float32]:
    plane = arrays[key]
    if plane.shape != shape or plane.dtype != np.float32:
        raise ValueError(f"'{key}' has the shape {plane.shape} of {plane.dtype}, expected {shape}")
    if not (np.isfinite(plane).all() and plane.min() >= 0.0 and plane.max() <= _BRIGHTEST):
        raise ValueError(f"'{key}' has values outside 0 to {_BRIGHTEST:g}")
    return np.asarray(plane, np.float32)
