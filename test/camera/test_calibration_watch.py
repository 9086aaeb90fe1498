"""A good calibration is kept whatever arrives; a change that lasts is followed."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from cardbox_tracker.camera.calibration_watch import LASTING, CalibrationWatch
from cardbox_tracker.common.errors import CameraError


def info(focal_px: float = 330.0, frame: str = "camera", **changes: Any) -> Any:
    values = {
        "width": 320,
        "height": 240,
        "k": [focal_px, 0, 159.5, 0, focal_px, 119.5, 0, 0, 1],
        "p": [0.0] * 12,
        "d": [0.0] * 5,
        "distortion_model": "plumb_bob",
        "roi": SimpleNamespace(x_offset=0, y_offset=0, width=0, height=0),
        "binning_x": 0,
        "binning_y": 0,
        "header": SimpleNamespace(frame_id=frame),
    }
    return SimpleNamespace(**(values | changes))


WRONG = {
    "uncalibrated": info(0.0),
    "not a number": info(float("nan")),
    "no size": info(width=0),
    "unknown lens": info(d=[0.1] * 5, distortion_model="fancy"),
    "distortion not a number": info(d=[float("nan")] * 5),
}


@pytest.fixture
def watch() -> CalibrationWatch:
    made = CalibrationWatch("/camera_info", "/image_raw")
    assert made.see(info())
    assert not made.see(info(frame="another name"))
    return made


def test_one_wrong_message_is_ignored_and_said(watch: CalibrationWatch) -> None:
    assert not watch.see(info(331.0))
    assert watch.current is not None and watch.current.k[0, 0] == 330
    assert watch.ignored == 1
    assert "f 331 px" in watch.remark and "f 330 px" in watch.remark
    assert "ros2 topic info --verbose /camera_info" in watch.remark
    for _ in range(200):
        assert not watch.see(info())
    assert watch.remark == "" and watch.ignored == 1


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"width": 640, "height": 480, "binning_x": 2, "binning_y": 2}, "of about 320x240"),
        ({"k": [330, 0, 319.5, 0, 330, 239.5, 0, 0, 1]}, "of about 640x480"),
        ({"k": [20, 0, 159.5, 0, 20, 119.5, 0, 0, 1]}, "166 degrees across"),
        ({"k": [330, 0, 159.5, 0, 247, 119.5, 0, 0, 1]}, "330 and 247 px differ"),
        ({"k": [0.0] * 9, "p": [330, 0, 159.5, 9, 0, 330, 119.5, 0, 0, 0, 1, 0]}, "P is used"),
        ({"k": [330, 0, 140.0, 0, 310, 110.0, 0, 0, 1]}, ""),
    ],
)
def test_what_is_unusual_is_told_and_used(changes: dict[str, Any], words: str) -> None:
    made = CalibrationWatch("/camera_info", "/image_raw")
    assert made.see(info(**changes))
    assert words in made.doubt and bool(made.doubt) == bool(words)
    if "P" in words:
        assert made.current is not None and made.current.k[0, 0] == 330


def test_two_cameras_in_turn_do_not_drive_out_the_first(watch: CalibrationWatch) -> None:
    for _ in range(5 * LASTING):
        assert not watch.see(info(331.0))
        assert not watch.see(info())
    assert watch.current is not None and watch.current.k[0, 0] == 330


def test_a_change_that_lasts_is_followed_once(watch: CalibrationWatch) -> None:
    new = info(660.0, width=640, height=480)
    assert [watch.see(new) for _ in range(LASTING + 5)] == [False] * (LASTING - 1) + [
        True,
        *[False] * 5,
    ]
    assert watch.current is not None and watch.current.width == 640
    assert watch.remark == ""


@pytest.mark.parametrize("centre", [(319.5, 239.5), (319.0, 239.0)])
def test_another_size_of_the_same_lens_is_followed_at_once(
    watch: CalibrationWatch, centre: tuple[float, float]
) -> None:
    before = watch.current
    k = [660.0, 0, centre[0], 0, 660.0, centre[1], 0, 0, 1]
    assert watch.see(info(width=640, height=480, k=k)) and watch.remark == ""
    assert watch.current is not None and watch.current.width == 640
    assert before is not None and before.is_resized(watch.current)
    assert not before.is_resized(before)


@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_an_invalid_message_never_replaces_a_good_one(watch: CalibrationWatch, wrong: Any) -> None:
    for _ in range(2 * LASTING):
        assert not watch.see(wrong)
    assert watch.current is not None and watch.current.k[0, 0] == 330
    assert "an invalid CameraInfo on /camera_info is ignored" in watch.remark


@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_an_invalid_first_message_is_an_error(wrong: Any) -> None:
    watch = CalibrationWatch("/camera_info", "/image_raw")
    assert not watch.seen
    with pytest.raises(CameraError, match="/image_raw"):
        watch.see(wrong)
    assert watch.seen and watch.current is None
    assert watch.see(info())
