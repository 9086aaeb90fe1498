"""Projection, frames, calibration and lens distortion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cardbox_tracker.camera.calibration_file import load_calibration
from cardbox_tracker.camera.camera import Calibration, Camera
from cardbox_tracker.common.errors import CameraError

CAMERA = Camera(320, 240, 300.0, 310.0, 159.5, 119.5)
K = np.array([(600.0, 0, 319.5), (0, 600.0, 239.5), (0, 0, 1)])
BENT = np.array([-0.3, 0.12, 0.001, -0.002, 0.0])
POINTS = arrays(np.float64, (5, 3), elements=st.floats(-10, 10))


def calibration(**changes: object) -> Calibration:
    values = {"width": 640, "height": 480, "k": K, "distortion": np.zeros(5)}
    return Calibration(**(values | changes))  # type: ignore[arg-type]


def test_projection_by_hand() -> None:
    points = np.array([(0, 0, 2.0), (0.5, -0.25, 2.0), (-1.0, 1.0, 4.0)])
    expected = [(159.5, 119.5), (159.5 + 75, 119.5 - 38.75), (159.5 - 75, 119.5 + 77.5)]
    np.testing.assert_allclose(CAMERA.project(points), expected)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"width": 0}, r"0x240 px; expected 1 to"),
        ({"height": -240}, r"320x-240 px"),
        ({"width": 70_000}, r"70000x240 px"),
        ({"fx": 0.0}, r"focal lengths are 0 and 310 px; expected .* above 0: calibrate"),
        ({"fy": float("nan")}, r"300 and nan px"),
        ({"fy": float("inf")}, r"300 and inf px"),
        ({"cx": float("nan")}, r"principal point \(nan, 119.5\)"),
        ({"pitch_rad": float("inf")}, r"pitch inf rad is not finite"),
        ({"width": float("nan")}, r"width is nan; expected a whole number"),
        ({"width": 320.5}, r"width is 320\.5; expected a whole number"),
        ({"width": "320"}, r"width is '320'; expected a number"),
        ({"height": 10**5000}, r"height is .*; expected"),
        ({"fx": None}, r"fx is None; expected a number"),
        ({"fy": 10**400}, r"fy is 1000.*; expected a number"),
        ({"cy": 1j}, r"cy is 1j; expected a number"),
        ({"focal_stddev": float("nan")}, "deviation of the camera's focal lengths is nan"),
        ({"focal_stddev": -float("inf")}, "deviation of the camera's focal lengths is -inf"),
        ({"focal_stddev": "wide"}, "focal_stddev is 'wide'; expected a number"),
        ({"focal_stddev": 1e6}, r"focal lengths is 1e\+06; expected a share of them from 0 to 100"),
    ],
)
def test_an_impossible_camera_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(CameraError, match=words):
        replace(CAMERA, **changes)
    with pytest.raises(CameraError, match="0x0 px"):
        CAMERA.scaled(0, 0)


@pytest.mark.parametrize("fov_deg", [None, "wide", float("nan"), 10**400, 180.0])
def test_a_field_of_view_is_a_number_of_degrees(fov_deg: Any) -> None:
    with pytest.raises(CameraError, match=r"field of view is .*; expected"):
        Calibration.of_fov(320, 240, fov_deg)


def test_a_size_in_another_type_of_number_becomes_whole() -> None:
    """OpenCV gives the width of a video as 320.0."""
    camera = Camera(320.0, np.uint16(240), 300, np.float32(310), 159.5, 119.5)  # type: ignore[arg-type]
    assert camera == CAMERA
    assert (type(camera.width), type(camera.height), type(camera.fx)) == (int, int, float)


def test_the_axes_of_the_two_frames() -> None:
    # Two metres ahead, 0.3 to the right of the image, 0.4 above the camera.
    np.testing.assert_allclose(
        CAMERA.reference_to_optical(np.array([-2, 0.3, 0.4])), (0.3, -0.4, 2)
    )


def test_scaling_keeps_what_is_seen_with_pixel_centres_at_whole_numbers() -> None:
    half = CAMERA.scaled(160, 120)
    assert (half.width, half.height, half.fx, half.fy) == (160, 120, 150.0, 155.0)
    # The middle of an image of 160 px lies between pixels 79 and 80, not at 159.5 / 2.
    assert (half.cx, half.cy) == (79.5, 59.5)
    # The outer corner of the first pixel is (-0.5, -0.5) at any size.
    corner = Camera(320, 240, 300, 300, -0.5, -0.5).scaled(64, 120)
    assert (corner.cx, corner.cy) == (-0.5, -0.5)
    assert corner.fx == pytest.approx(60)
    assert corner.fy == pytest.approx(150)
    assert CAMERA.with_pitch(0.2).scaled(160, 120).pitch_rad == 0.2


@given(st.integers(16, 2000), st.integers(16, 2000))
def test_scaling_back_gives_the_same_camera(width: int, height: int) -> None:
    back = CAMERA.scaled(width, height).scaled(320, 240)
    for name in ("fx", "fy", "cx", "cy"):
        assert getattr(back, name) == pytest.approx(getattr(CAMERA, name))


def test_what_is_straight_ahead_appears_above_the_middle_of_a_camera_that_looks_down() -> None:
    ahead = np.array([-2.0, 0.0, 0.0])
    camera = CAMERA.with_pitch(0.1)
    u, v = camera.project(camera.reference_to_optical(ahead))
    assert u == pytest.approx(159.5)
    assert v == pytest.approx(119.5 - 310 * np.tan(0.1))
    # On its axis lies what is ahead and below.
    below = np.array([-2 * np.cos(0.1), 0, -2 * np.sin(0.1)])
    np.testing.assert_allclose(camera.reference_to_optical(below), (0, 0, 2), atol=1e-12)
    assert CAMERA.pitch_rad == 0.0


@given(POINTS, st.floats(-1.4, 1.4))
def test_the_way_to_the_optical_frame_is_a_rotation(points: np.ndarray, pitch: float) -> None:
    camera = CAMERA.with_pitch(pitch)
    rotation = camera.reference_to_optical_rotation()
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    optical = camera.reference_to_optical(points)
    np.testing.assert_allclose(camera.optical_to_reference(optical), points, atol=1e-12)
    np.testing.assert_allclose(
        np.linalg.norm(optical, axis=1), np.linalg.norm(points, axis=1), atol=1e-12
    )


@given(st.floats(-1.4, 1.4))
def test_turning_does_not_mirror(pitch: float) -> None:
    rotation = CAMERA.with_pitch(pitch).reference_to_optical_rotation()
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_a_calibration_gives_the_camera_of_the_working_size() -> None:
    camera = calibration().camera(320, 240, pitch_rad=0.3)
    assert camera == Camera(320, 240, 300.0, 300.0, 159.5, 119.5, 0.3)


def test_an_uncalibrated_camera_is_refused() -> None:
    for call in (
        lambda c: c.camera(320, 240),
        lambda c: c.rectifier(320, 240),
    ):
        with pytest.raises(CameraError, match="not calibrated"):
            call(calibration(k=np.zeros((3, 3))))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("entry", range(9))
def test_every_entry_of_k_has_to_be_finite(entry: int, value: float) -> None:
    k = K.copy()
    k.flat[entry] = value
    with pytest.raises(CameraError, match=f"K .*not finite .*{value:g}"):
        calibration(k=k).camera(320, 240)


@pytest.mark.parametrize(
    ("entry", "value", "words"),
    [
        (0, -600.0, "fx .*-600 px; .*12.8 to 640000 px"),
        (4, 0.0, "fy .*0 px; .*9.6 to"),
        (4, 1e300, "fy .*1e"),
        (2, 1e200, "principal point"),
        (5, -1e9, "principal point"),
    ],
)
def test_a_matrix_that_no_camera_has_is_refused(entry: int, value: float, words: str) -> None:
    k = K.copy()
    k.flat[entry] = value
    with pytest.raises(CameraError, match=words):
        calibration(k=k).camera(320, 240)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_coefficients_that_are_not_finite_are_refused(value: float) -> None:
    with pytest.raises(CameraError, match=r"D .*not finite"):
        calibration(distortion=np.array([0.0, 0.0, value, 0.0, 0.0])).camera(320, 240)


@pytest.mark.parametrize(("width", "height"), [(0, 480), (640, 0), (0, 0)])
def test_a_calibration_without_a_size_is_refused(width: int, height: int) -> None:
    with pytest.raises(CameraError, match=f"{width}x{height}"):
        calibration(width=width, height=height).camera(320, 240)


def test_an_unknown_distortion_model_is_refused_with_those_that_are_known() -> None:
    with pytest.raises(CameraError, match=r"'fov' .*plumb_bob"):
        calibration(distortion_model="fov", distortion=BENT).camera(320, 240)
    # Without distortion its name does not matter: drivers leave it empty.
    straight = calibration(distortion_model="", distortion=np.zeros(0))
    assert straight.camera(640, 480).fx == 600
    assert straight.rectifier(640, 480) is None


@pytest.mark.parametrize(
    ("model", "count", "expected"),
    [
        ("plumb_bob", 3, "4 or 5"),
        ("plumb_bob", 15, "4 or 5"),
        ("rational_polynomial", 15, "4 or 5, or OpenCV's 8, 12 or 14"),
        ("equidistant", 5, "4"),
    ],
)
def test_a_wrong_count_of_coefficients_is_refused(model: str, count: int, expected: str) -> None:
    wrong = calibration(distortion_model=model, distortion=np.full(count, 0.01))
    with pytest.raises(CameraError, match=f"'{model}' .*{count} .*; expected {expected}"):
        wrong.rectifier(320, 240)


def test_a_calibration_of_another_shape_is_refused() -> None:
    wide = Calibration(640, 360, np.diag([300.0, 300.0, 1.0]), np.zeros(5))
    with pytest.raises(CameraError, match="b is for images of 640x360, but those of a are 640x480"):
        wide.check_shape(640, 480, "a", "b")
    wide.check_shape(320, 180, "a", "b")


@pytest.mark.parametrize("distortion", [np.zeros(0), np.zeros(5)])
def test_a_straight_lens_needs_no_rectifier(distortion: np.ndarray) -> None:
    straight = calibration(distortion=distortion)
    assert not straight.is_distorted
    assert straight.rectifier(320, 240) is None


@pytest.mark.parametrize(
    ("model", "distortion"),
    [
        ("plumb_bob", BENT),
        ("plumb_bob", BENT[:4]),
        ("rational_polynomial", np.array([-0.2, 0.1, 0.001, 0.001, 0, 0.1, 0.02, 0])),
        ("equidistant", np.array([-0.1, 0.02, 0.0, 0.0])),
    ],
)
@pytest.mark.parametrize("size", [(640, 480), (320, 240)])
def test_a_rectified_dot_is_where_a_pinhole_camera_sees_it(
    model: str, distortion: np.ndarray, size: tuple[int, int]
) -> None:
    bent = calibration(distortion_model=model, distortion=distortion)
    camera, rectify = bent.camera(*size), bent.rectifier(*size)
    assert rectify is not None
    grid = np.array([(x, y, 2.0) for x in (-0.6, -0.2, 0.4) for y in (-0.45, 0.0, 0.3)])
    matrix = np.array([(camera.fx, 0, camera.cx), (0, camera.fy, camera.cy), (0, 0, 1)])
    if model == "equidistant":
        seen, _ = cv2.fisheye.projectPoints(
            grid[:, None], np.zeros(3), np.zeros(3), matrix, distortion
        )
    else:
        seen, _ = cv2.projectPoints(grid, np.zeros(3), np.zeros(3), matrix, distortion)
    seen, ideal = seen.reshape(-1, 2), camera.project(grid)
    # Else the rectifier would have nothing to do.
    assert np.linalg.norm(seen - ideal, axis=1).max() > 3
    v, u = np.mgrid[: size[1], : size[0]]
    for (seen_u, seen_v), expected in zip(seen, ideal, strict=True):
        dot = 255 * np.exp(-((u - seen_u) ** 2 + (v - seen_v) ** 2) / (2 * 2.0**2))
        image = rectify(dot.round().astype(np.uint8)).astype(float)
        assert image.shape == (size[1], size[0])
        centre = np.array([(u * image).sum(), (v * image).sum()]) / image.sum()
        np.testing.assert_allclose(centre, expected, atol=0.25)


def test_what_the_lens_never_saw_repeats_the_border() -> None:
    # Positive k1 pincushions: the corners of the rectified image lie outside of the raw one.
    rectify = calibration(distortion=np.array([0.4, 0, 0, 0, 0])).rectifier(64, 48)
    assert rectify is not None
    np.testing.assert_array_equal(rectify(np.full((48, 64), 90, np.uint8)), 90)
    assert rectify(np.zeros((48, 64, 3), np.uint8)).shape == (48, 64, 3)


FILE = {
    "image_width": 640,
    "image_height": 480,
    "camera_name": "front",
    "camera_matrix": {"rows": 3, "cols": 3, "data": K.ravel().tolist()},
    "distortion_model": "plumb_bob",
    "distortion_coefficients": {"rows": 1, "cols": 5, "data": BENT.tolist()},
}


def written(folder: Path, data: object) -> Path:
    path = folder / "camera.yaml"
    path.write_text(yaml.safe_dump(data))
    return path


def test_a_calibration_file_is_read(tmp_path: Path) -> None:
    got = load_calibration(written(tmp_path, FILE))
    assert (got.width, got.height, got.distortion_model) == (640, 480, "plumb_bob")
    np.testing.assert_array_equal(got.k, K)
    np.testing.assert_array_equal(got.distortion, BENT)
    assert got.is_distorted


@pytest.mark.parametrize(
    "key",
    [
        "image_width",
        "image_height",
        "camera_matrix",
        "distortion_model",
        "distortion_coefficients",
    ],
)
def test_a_missing_key_is_named(tmp_path: Path, key: str) -> None:
    path = written(tmp_path, {k: v for k, v in FILE.items() if k != key})
    with pytest.raises(CameraError, match=f"{path}: .*'{key}'"):
        load_calibration(path)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"camera_matrix": {"rows": 3}}, "'data'"),
        ({"camera_matrix": {"data": [1.0, 2.0]}}, "expected a file of camera_cal"),
        ({"camera_matrix": {"data": ["a"] * 9}}, "expected a file of camera_cal"),
        ({"camera_matrix": 5}, "expected a file of camera_cal"),
        ({"image_width": "wide"}, "expected a file of camera_cal"),
        ({"image_width": 0}, "0x480"),
        ({"camera_matrix": {"data": [0.0] * 9}}, "not calibrated"),
        ({"distortion_model": "fov"}, "'fov'"),
        ({"distortion_coefficients": {"data": [0.1] * 3}}, "3 coefficients"),
    ],
)
def test_what_is_wrong_in_a_file_is_told_with_its_path(
    tmp_path: Path, change: dict[str, object], text: str
) -> None:
    path = written(tmp_path, FILE | change)
    with pytest.raises(CameraError, match=f"{path}: .*{text}"):
        load_calibration(path)


def test_a_file_that_is_none_of_that_kind(tmp_path: Path) -> None:
    with pytest.raises(CameraError, match=r"none\.yaml: No such file"):
        load_calibration(tmp_path / "none.yaml")
    path = written(tmp_path, [1, 2])
    with pytest.raises(CameraError, match="mapping"):
        load_calibration(path)
    path.write_text("a: [1")
    with pytest.raises(CameraError, match="YAML"):
        load_calibration(path)
    path.write_bytes(b"\xff\xfe\x80")
    with pytest.raises(CameraError, match="text file"):
        load_calibration(path)
