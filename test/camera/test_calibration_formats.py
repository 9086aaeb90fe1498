"""Calibration files of other programs than camera_calibration."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from cardbox_tracker.camera.calibration_file import load_calibration
from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.common.errors import CameraError

K = np.array([(330.0, 0.0, 159.5), (0.0, 331.0, 119.5), (0.0, 0.0, 1.0)])
LENS = (0.01, 0.001, 0.0, -0.002)


def file_storage(path: Path, lens: tuple[float, ...], names: tuple[str, ...]) -> Path:
    """Write what OpenCV's own programs write."""
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("calibration_time", "Mon 01 Jan 2024")
    storage.write(names[0], 320)
    storage.write(names[1], 240)
    storage.write(names[2], K)
    storage.write(names[3], np.array(lens)[:, None])
    if len(names) > 4:
        storage.write(names[4], 1)
    storage.release()
    return path


SAMPLE = ("image_width", "image_height", "camera_matrix", "distortion_coefficients")
OLD_SAMPLE = ("image_Width", "image_Height", "Camera_Matrix", "Distortion_Coefficients")
PLAIN = ("width", "height", "cameraMatrix", "distCoeffs")


@pytest.mark.parametrize("names", [SAMPLE, OLD_SAMPLE, PLAIN])
@pytest.mark.parametrize("ending", ["yaml", "xml", "json"])
@pytest.mark.parametrize("count", [4, 5, 8, 12, 14])
def test_opencvs_file_storage_is_read(
    tmp_path: Path, ending: str, names: tuple[str, ...], count: int
) -> None:
    lens = (*LENS, 0.1, 0.02, 0.03, 0.04, 1e-3, 1e-3, 1e-3, 1e-3, 1e-2, 1e-2)[:count]
    found = load_calibration(file_storage(tmp_path / f"camera.{ending}", lens, names))
    assert (found.width, found.height) == (320, 240)
    np.testing.assert_array_equal(found.k, K)
    np.testing.assert_allclose(found.distortion[:count], lens)
    assert found.distortion_model == ("plumb_bob" if count <= 5 else "rational_polynomial")


@pytest.mark.parametrize("ending", ["yml", "xml"])
def test_opencvs_switch_makes_a_fisheye(tmp_path: Path, ending: str) -> None:
    names = (*SAMPLE, "fisheye_model")
    found = load_calibration(file_storage(tmp_path / f"camera.{ending}", LENS, names))
    assert found.distortion_model == "equidistant"


def kalibr(path: Path, model: str, kind: str = "pinhole", cameras: int = 1) -> Path:
    one = f"""
  camera_model: {kind}
  distortion_coeffs: [0.01, 0.001, 0.0, -0.002]
  distortion_model: {model}
  intrinsics: [330.0, 331.0, 159.5, 119.5]
  resolution: [320, 240]
  rostopic: /image_raw
"""
    path.write_text("".join(f"cam{number}:{one}" for number in range(cameras)))
    return path


@pytest.mark.parametrize(("model", "name"), [("radtan", "plumb_bob"), ("equidistant",) * 2])
def test_a_camchain_of_kalibr_with_one_camera_is_read(
    tmp_path: Path, model: str, name: str
) -> None:
    found = load_calibration(kalibr(tmp_path / "camchain.yaml", model))
    assert (found.width, found.height, found.distortion_model) == (320, 240, name)
    np.testing.assert_array_equal(found.k, K)
    np.testing.assert_array_equal(found.distortion[:4], LENS)


@pytest.mark.parametrize(
    ("change", "text"),
    [({"kind": "omni"}, "'omni'; expected pinhole"), ({"cameras": 2}, "cam0, cam1; keep")],
)
def test_a_camchain_that_cannot_be_used_says_why(
    tmp_path: Path, change: dict[str, object], text: str
) -> None:
    path = kalibr(tmp_path / "camchain.yaml", "radtan", **change)  # type: ignore[arg-type]
    with pytest.raises(CameraError, match=f"{path}: .*Kalibr's .*{text}"):
        load_calibration(path)


def test_what_ros2_topic_echo_prints_is_read(tmp_path: Path) -> None:
    path = tmp_path / "info.yaml"
    path.write_text(
        "header:\n  frame_id: camera\nheight: 240\nwidth: 320\ndistortion_model: plumb_bob\n"
        f"d: {list(LENS)}\nk: {K.ravel().tolist()}\n---\n"
    )
    found = load_calibration(path)
    np.testing.assert_array_equal(found.k, K)


def aniposelib(path: Path, count: int) -> Path:
    one = (
        'name = "left"\nsize = [320, 240]\n'
        f"matrix = {K.tolist()}\ndistortions = {[*LENS, 0.0]}\n"
        "rotation = [0.0, 0.0, 0.0]\ntranslation = [0.0, 0.0, 0.0]\n"
    )
    text = "".join(f"[cam_{number}]\n{one}" for number in range(count))
    path.write_text(f"{text}[metadata]\nerror = 0.2\n")
    return path


def test_toml_of_aniposelib_with_one_camera_is_read(tmp_path: Path) -> None:
    found = load_calibration(aniposelib(tmp_path / "one.toml", 1))
    assert (found.width, found.height, found.distortion_model) == (320, 240, "plumb_bob")
    np.testing.assert_array_equal(found.k, K)
    np.testing.assert_array_equal(found.distortion[:4], LENS)
    for count, names in ((2, "cam_0, cam_1"), (0, "none")):
        with pytest.raises(CameraError, match=f"cameras {names}; expected one.*--extrinsics"):
            load_calibration(aniposelib(tmp_path / "other.toml", count))


def test_toml_and_ini_are_known_by_their_sections(tmp_path: Path) -> None:
    named = aniposelib(tmp_path / "one.toml", 1).rename(tmp_path / "camera.txt")
    np.testing.assert_array_equal(load_calibration(named).k, K)
    named.write_text("# oST version 5.0 parameters\n\n[image]\n\nwidth\n320\n\nheight\n240\n")
    with pytest.raises(CameraError, match=r"INI file.* the YAML that is written beside it"):
        load_calibration(named)
    named.write_text(
        f"image_width = 320\nimage_height = 240\ncamera_matrix = {K.tolist()}\n"
        f"distortion_coefficients = {[*LENS, 0.0]}\ndistortion_model = 'plumb_bob'\n"
    )
    np.testing.assert_array_equal(load_calibration(named.rename(tmp_path / "b.toml")).k, K)


def test_a_matrix_that_is_transposed_is_refused() -> None:
    """As MATLAB's IntrinsicMatrix; its principal point would be at the corner."""
    with pytest.raises(CameraError, match=r"below its diagonal .*, as if it were transposed"):
        Calibration(320, 240, K.T, np.zeros(5), "plumb_bob").camera(320, 240)


@pytest.mark.parametrize(
    "text",
    ["<opencv_storage>", "<!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>", "%YAML:1.0\n---\na: [1\n"],
)
def test_a_damaged_file_is_refused_with_the_formats(tmp_path: Path, text: str) -> None:
    path = tmp_path / "camera.xml"
    path.write_text(text)
    with pytest.raises(CameraError, match=r"FileStorage, Kalibr or aniposelib"):
        load_calibration(path)
