"""Reads calibrations as camera_calibration writes them."""

from __future__ import annotations

import os

import numpy as np

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.common.errors import CameraError, cut
from cardbox_tracker.common.small_yaml import SmallYamlError, parse_small_yaml, read_small_text


def load_calibration(path: str | os.PathLike[str]) -> Calibration:
    """Read a YAML file as camera_calibration writes it.

    Raises:
        CameraError: the file cannot be read or lacks a key; the text names the key.
    """
    name = os.fspath(path)
    try:
        text = read_small_text(path)
    except SmallYamlError as error:
        raise CameraError(
            f"cannot read the calibration {name}: {error}; give a YAML file as "
            "camera_calibration writes it"
        ) from None
    try:
        data = parse_small_yaml(text)
    except SmallYamlError as error:
        raise CameraError(f"calibration {name}: {error}") from None
    if not isinstance(data, dict):
        raise CameraError(f"calibration {name}: expected a mapping as camera_calibration writes it")
    try:
        k = np.array(data["camera_matrix"]["data"], dtype=np.float64)
        distortion = np.array(data["distortion_coefficients"]["data"], dtype=np.float64).ravel()
        calibration = Calibration(
            int(data["image_width"]),
            int(data["image_height"]),
            k.reshape(3, 3),
            distortion,
            str(data["distortion_model"]),
        )
    except KeyError as error:
        raise CameraError(
            f"calibration {name}: missing key {error}; expected a file as camera_calibration "
            "writes it"
        ) from None
    except (TypeError, ValueError, OverflowError) as error:
        raise CameraError(f"calibration {name}: malformed value: {cut(str(error))}") from None
    try:
        calibration.camera(calibration.width, calibration.height)
    except CameraError as error:
        raise CameraError(f"calibration {name}: {error}") from None
    return calibration
