"""Files of calibrations: camera_calibration, OpenCV, Kalibr, aniposelib, and a CameraInfo."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree

import numpy as np

from cardbox_tracker.camera.camera import CALIBRATED, Calibration
from cardbox_tracker.common.errors import CameraError, cut, quoted
from cardbox_tracker.common.files import foreign, write_file
from cardbox_tracker.common.small_yaml import SmallYamlError, parse_small_yaml, read_small_text

_EXPECTED = "a file of camera_calibration, OpenCV's FileStorage, Kalibr or aniposelib"
# What FileStorage adds to YAML: the directive "%YAML:1.0" and the tags of its matrices.
_NO_YAML = re.compile(r"\A%YAML.*\n|!!opencv-matrix|\A---\s*$|^---\s*\Z", re.MULTILINE)
# First line of TOML and INI, in which sections have names in brackets.
_SECTION = re.compile(r"(?:[ \t\r]*(?:[#;].*)?\n)*[ \t]*\[[\w.\" -]+\][ \t\r]*\n")
# FileStorage names no model; OpenCV's sample has a switch for its fisheye.
_FILE_STORAGE = {"distortion_model": "plumb_bob"}
# Key that 'cardbox calibrate-camera' adds to the format of camera_calibration.
_STDDEV = "focal_length_stddev"
_ALIASES = MappingProxyType(
    {
        "image_width": ("imagewidth", "width"),
        "image_height": ("imageheight", "height"),
        "camera_matrix": ("cameramatrix", "k", "matrix"),
        "distortion_coefficients": ("distortioncoefficients", "distcoeffs", "d", "distortions"),
        "distortion_model": ("distortionmodel",),
    }
)


def load_calibration(path: str | os.PathLike[str]) -> Calibration:
    """Read a calibration of one camera; raise CameraError if it cannot be read or lacks a key.

    The file is YAML of camera_calibration, YAML, JSON or XML of OpenCV's FileStorage, a camchain of
    Kalibr or TOML of aniposelib with one camera, or YAML of a CameraInfo, as 'ros2 topic echo'
    prints it.
    """
    with foreign(path, CameraError, _EXPECTED):
        text = read_small_text(path)
        is_toml = os.fspath(path).lower().endswith(".toml") or _SECTION.match(text)
        data = _of_toml(text) if is_toml else parsed_storage(text)
        if not isinstance(data, Mapping):
            raise CameraError("it is no mapping")
        is_camchain = all(isinstance(one, Mapping) and "intrinsics" in one for one in data.values())
        calibration = _of_kalibr(data) if is_camchain else _of_matrix(data)
        calibration.camera(calibration.width, calibration.height)
    return calibration


def _of_toml(text: str) -> Mapping[str, Any]:
    """Return the entries of the only camera of aniposelib's camera group, or of the whole file."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise CameraError(
            f"it is no TOML ({error}); of an INI file, such as ost.txt of camera_calibration, give "
            "the YAML that is written beside it"
        ) from None
    if "camera_matrix" in data:
        return data
    cameras = {key: one for key, one in data.items() if isinstance(one, dict) and "matrix" in one}
    if len(cameras) != 1:
        raise CameraError(
            f"it is TOML with the cameras {cut(', '.join(cameras)) or 'none'}; expected one: keep "
            "the camera in question, and give the poses of several as --extrinsics"
        )
    (camera,) = cameras.values()
    return {"distortion_model": "plumb_bob", "fisheye_model": camera.get("fisheye", 0)} | camera


def save_calibration(path: str | os.PathLike[str], calibration: Calibration) -> None:
    """Write a calibration atomically as camera_calibration does, with its relative deviation.

    Raises CardboxError if the file cannot be written.
    """
    lens, k = calibration, calibration.k
    projection = np.pad(k, ((0, 0), (0, 1)))
    matrices = {
        "camera_matrix": k,
        "distortion_coefficients": lens.distortion[None],
        "rectification_matrix": np.eye(3),
        "projection_matrix": projection,
    }
    lines = [
        f"image_width: {lens.width}",
        f"image_height: {lens.height}",
        "camera_name: camera",
        f"distortion_model: {lens.distortion_model}",
        f"{_STDDEV}: {lens.focal_stddev:.5f}",
    ]
    for name, matrix in matrices.items():
        data = ", ".join(f"{value:.9g}" for value in matrix.ravel().tolist())
        rows, columns = matrix.shape
        lines += [f"{name}:", f"  rows: {rows}", f"  cols: {columns}", f"  data: [{data}]"]
    write_file(path, "\n".join(lines) + "\n")


def parsed_storage(text: str) -> Any:
    """Return what YAML or XML has, of OpenCV's FileStorage or others; SmallYamlError if it is none.

    A matrix is a mapping with ``data``, or, in XML, its numbers as words.
    """
    if not text.lstrip().startswith("<"):
        data = parse_small_yaml(_NO_YAML.sub("", text))
        is_storage = "opencv-matrix" in text and isinstance(data, dict)
        return _FILE_STORAGE | data if is_storage else data
    if "<!" in text.replace("<!--", ""):
        raise SmallYamlError("it is XML with declarations; remove them")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise SmallYamlError(f"it is not valid XML: {cut(str(error))}") from None
    return _FILE_STORAGE | dict(_xml_values(root))


def _xml_values(root: ElementTree.Element) -> Iterator[tuple[str, Any]]:
    for entry in root:
        matrix = entry.find("data")
        values = entry if matrix is None else matrix
        words = (values.text or "").split()
        yield entry.tag, words[0] if matrix is None and len(words) == 1 else words


def _of_matrix(data: Mapping[Any, Any]) -> Calibration:
    """Return the calibration of a file with a camera matrix, whatever the spelling of its keys."""
    plain = {str(key).lower().replace("_", ""): value for key, value in data.items()}

    def value(name: str) -> Any:
        found = next((plain[key] for key in _ALIASES[name] if key in plain), None)
        if found is None:
            raise KeyError(name)
        return found["data"] if isinstance(found, Mapping) else found

    size = (
        plain.get("imagesize") or plain.get("size") or (value("image_width"), value("image_height"))
    )
    stddev = float(plain.get(_STDDEV.replace("_", ""), CALIBRATED))
    if not 0.0 < stddev < 1.0:
        raise ValueError(f"{_STDDEV} is {stddev:g}; expected a share between 0 and 1")
    is_fisheye = str(plain.get("fisheyemodel", 0)) not in ("0", "False")
    return Calibration(
        int(size[0]),
        int(size[1]),
        np.array(value("camera_matrix"), dtype=np.float64).reshape(3, 3),
        np.array(value("distortion_coefficients"), dtype=np.float64).ravel(),
        "fisheye" if is_fisheye else str(value("distortion_model")),
        focal_stddev=stddev,
    )


def _of_kalibr(data: Mapping[Any, Any]) -> Calibration:
    """Return the calibration of the only camera of a camchain."""
    if len(data) != 1:
        raise ValueError(
            f"Kalibr's camchain has {cut(', '.join(map(str, data)))}; keep the camera in question"
        )
    (camera,) = data.values()
    if camera["camera_model"] != "pinhole":
        raise ValueError(
            f"Kalibr's camera model is {quoted(camera['camera_model'])}; expected pinhole"
        )
    fx, fy, cx, cy = (float(number) for number in camera["intrinsics"])
    width, height = (int(side) for side in camera["resolution"])
    return Calibration(
        width,
        height,
        np.array([(fx, 0.0, cx), (0.0, fy, cy), (0.0, 0.0, 1.0)]),
        np.array(camera.get("distortion_coeffs") or [], dtype=np.float64),
        str(camera["distortion_model"]),
    )
