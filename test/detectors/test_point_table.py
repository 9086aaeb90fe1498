"""Tables of points: their rows, the camera's lens, and tables that are refused."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.image_points import POINT_INDEX
from cardbox_tracker.detectors.point_table import PointTable

K = np.array([(500.0, 0.0, 320.0), (0.0, 510.0, 240.0), (0.0, 0.0, 1.0)])
PLAIN = Calibration(640, 480, K, np.zeros(5))
NONE = np.zeros((1, 1), np.uint8)
HEADER = "stamp_ns,joint,u,v,score"
LENSES = {
    "plumb_bob": [-0.2, 0.05, 0.001, 0.002, 0.0],
    "rational_polynomial": [0.1, 0.02, 0.001, 0.001, 0.0, 0.05, 0.01, 0.0],
    "equidistant": [0.02, -0.01, 0.003, -0.001],
}


def table(folder: Path, *rows: str, header: str = HEADER) -> PointTable:
    path = folder / "points.csv"
    path.write_text("\n".join([header, *rows, ""]))
    return PointTable(path)


def test_points_are_those_of_the_stamp_at_the_working_size(tmp_path: Path) -> None:
    given = table(
        tmp_path,
        "5,nose,320,240,0.9",
        "5,left_knee,1,2,0.9",
        "5,left_wrist,nan,3,0.9",
        "5,right_wrist,3,3,0",
        "7,nose,0,0,4",
    )
    find = given.read(None, PLAIN, (320, 240))
    first, second = find(5, NONE), find(7, NONE)
    assert first is not None and second is not None
    assert find(6, NONE) is None
    # The centre of the first pixel is half a pixel inside the image.
    assert first.px[POINT_INDEX["nose"]] == pytest.approx((159.75, 119.75))
    assert first.scores.tolist() == [0.9, *[0.0] * 16]
    assert second.px[POINT_INDEX["nose"]] == pytest.approx((-0.25, -0.25))
    assert second.scores[POINT_INDEX["nose"]] == 1.0


@pytest.mark.parametrize("roll_rad", [0.0, 0.1])
@pytest.mark.parametrize("model", LENSES)
def test_points_go_where_the_lens_is_undone(tmp_path: Path, model: str, roll_rad: float) -> None:
    """A ray goes through the lens as OpenCV bends it, and comes back to the pinhole camera."""
    lens = np.array(LENSES[model])
    calibration = Calibration(640, 480, K, lens, model, roll_rad=roll_rad)
    rays = np.random.default_rng(0).uniform(-0.5, 0.5, (len(POINT_INDEX), 2))
    if model == "equidistant":
        bent = cv2.fisheye.distortPoints(rays[:, None], K, lens.reshape(4, 1))
    else:
        ahead, none = np.column_stack([rays, np.ones(len(rays))]), np.zeros(3)
        bent, _ = cv2.projectPoints(ahead, none, none, K, lens)
    rows = [
        f"5,{name},{u},{v},0.5"
        for name, (u, v) in zip(POINT_INDEX, bent.reshape(-1, 2).tolist(), strict=True)
    ]
    points = table(tmp_path, *rows).read(None, calibration, (320, 240))(5, NONE)
    assert points is not None
    c, s = np.cos(roll_rad), np.sin(roll_rad)
    level = rays @ np.array([(c, s), (-s, c)])
    np.testing.assert_allclose(
        points.px, level * (250.0, 255.0) + (159.75, 119.75), atol=0.02, rtol=0
    )


def test_a_working_image_has_there_what_the_camera_s_image_has_at_the_point() -> None:
    calibration = Calibration(640, 480, K, np.array(LENSES["plumb_bob"]), roll_rad=0.1)
    rectifier = calibration.rectifier(640, 480)
    assert rectifier is not None
    for place in ((100.0, 90.0), (500.0, 400.0), (320.0, 60.0)):
        image = np.zeros((480, 640), np.uint8)
        cv2.circle(image, tuple(map(int, place)), 5, 255, -1)
        seen = np.argwhere(rectifier(image) > 127)[:, ::-1].mean(axis=0)
        px = calibration.rectified(np.array([place]), 640, 480)[0]
        np.testing.assert_allclose(px, seen, atol=0.5)


def test_each_camera_has_its_own_rows(tmp_path: Path) -> None:
    rows = "5,nose,10,20,0.9,left", "5,nose,30,40,0.9,right"
    given = table(tmp_path, *rows, header=f"{HEADER},camera")
    for camera, column in (("left", 10.0), ("right", 30.0)):
        points = given.read(camera, PLAIN, (640, 480))(5, NONE)
        assert points is not None
        assert points.px[POINT_INDEX["nose"], 0] == pytest.approx(column)
    assert given.read("top", PLAIN, (640, 480))(5, NONE) is None


def test_a_table_of_a_spreadsheet_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    points = table(tmp_path, "5,nose,10,20,0.9", header=f"\ufeff{HEADER}").read(
        None, PLAIN, (640, 480)
    )(5, NONE)
    assert points is not None
    assert points.px[POINT_INDEX["nose"], 0] == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("header", "row", "camera", "words"),
    [
        ("stamp_ns,joint,u,v", "5,nose,1,2", None, "no column score"),
        ("", "", None, "no column stamp_ns, joint, u, v, score"),
        (HEADER, "5,nose,1,2,0.9", "left", "no column camera"),
        (HEADER.replace(",", ";"), "5;nose;1;2;0.9", None, "separated by commas"),
        (HEADER, "5,nose,one,2,0.9", None, "line 2, has a value that is no number .*one"),
        (HEADER, "5.5,nose,1,2,0.9", None, r"no number .*5\.5.*whole numbers in stamp_ns"),
        (HEADER, "5,nose,1", None, "no number"),
    ],
)
def test_a_table_that_is_none_is_refused(
    tmp_path: Path, header: str, row: str, camera: str | None, words: str
) -> None:
    with pytest.raises(CardboxError, match=words):
        table(tmp_path, row, header=header).read(camera, PLAIN, (640, 480))


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(CardboxError, match=r"cannot read .*missing\.csv"):
        PointTable(tmp_path / "missing.csv").read(None, PLAIN, (640, 480))
    binary = tmp_path / "binary.csv"
    binary.write_bytes(b"\xff\xfe\x00stamp_ns")
    with pytest.raises(CardboxError, match=r"binary\.csv is not a table in UTF-8"):
        PointTable(binary).read(None, PLAIN, (640, 480))
