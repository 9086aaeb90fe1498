"""What a camera offers is told, and its exposure is fixed where it lets itself be."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import pytest

from cardbox_tracker.camera import camera_device
from cardbox_tracker.camera.camera_device import describe_capture, describe_devices, lock_exposure


class Capture:
    """A device of two sizes, as OpenCV shows it; it refuses what is not in ``allowed``."""

    def __init__(self, *allowed: int) -> None:
        self.allowed = {cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT, *allowed}
        self.values: dict[int, float] = {
            cv2.CAP_PROP_FRAME_WIDTH: 640,
            cv2.CAP_PROP_FRAME_HEIGHT: 480,
            cv2.CAP_PROP_AUTO_EXPOSURE: 3,
            cv2.CAP_PROP_EXPOSURE: 157,
            cv2.CAP_PROP_AUTO_WB: 1,
        }
        self.released = False

    def set(self, prop: int, value: float) -> bool:
        if prop in self.allowed:
            self.values[prop] = value
        return prop in self.allowed

    def get(self, prop: int) -> float:
        """The nearest size the device has, and the rate that goes with it."""
        large = self.values[cv2.CAP_PROP_FRAME_WIDTH] > 700
        sizes = {cv2.CAP_PROP_FRAME_WIDTH: (640, 1280), cv2.CAP_PROP_FRAME_HEIGHT: (480, 720)}
        if prop in sizes:
            return sizes[prop][large]
        return (30.0, 10.0)[large] if prop == cv2.CAP_PROP_FPS else self.values[prop]

    def release(self) -> None:
        self.released = True


MANUAL = (cv2.CAP_PROP_AUTO_EXPOSURE, cv2.CAP_PROP_EXPOSURE, cv2.CAP_PROP_AUTO_WB)


def test_exposure_is_fixed_at_its_present_value() -> None:
    capture: Any = Capture(*MANUAL)
    assert lock_exposure(capture) == {"exposure": True, "white balance": True}
    assert capture.values[cv2.CAP_PROP_AUTO_EXPOSURE] == 1
    assert capture.values[cv2.CAP_PROP_EXPOSURE] == 157
    assert capture.values[cv2.CAP_PROP_AUTO_WB] == 0


def test_what_the_device_refuses_is_told() -> None:
    capture: Any = Capture(cv2.CAP_PROP_AUTO_WB)
    assert lock_exposure(capture) == {"exposure": False, "white balance": True}


def test_sizes_rates_and_controls_are_listed_and_left_automatic() -> None:
    capture: Any = Capture(*MANUAL)
    text = describe_capture(capture)
    assert "640x480 at 30 Hz, 1280x720 at 10 Hz" in text
    assert text.count("640x480") == 1
    assert "exposure can be" in text
    assert capture.values[cv2.CAP_PROP_AUTO_EXPOSURE] == 3
    assert capture.values[cv2.CAP_PROP_AUTO_WB] == 1
    assert "exposure cannot" in describe_capture(Capture())  # type: ignore[arg-type]


def test_every_device_has_a_line_with_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number in (0, 2, 10):
        (tmp_path / f"video{number}").touch()
    (tmp_path / "names" / "video2").mkdir(parents=True)
    (tmp_path / "names" / "video2" / "name").write_text("A Webcam\n")
    captures: list[Capture] = []

    def open_device(name: str) -> Capture:
        if name.endswith("video10"):
            raise camera_device.CameraError("in use")
        captures.append(Capture(*MANUAL))
        return captures[-1]

    monkeypatch.setattr(camera_device, "open_device", open_device)
    lines = describe_devices(tmp_path, tmp_path / "names").splitlines()
    assert [line.split(":")[0].split("/")[-1] for line in lines] == [
        "video0",
        "video2 (A Webcam)",
        "video10",
    ]
    assert "640x480" in lines[1] and "in use" in lines[2]
    assert all(capture.released for capture in captures)


def test_no_device_is_told(tmp_path: Path) -> None:
    assert "no camera" in describe_devices(tmp_path, tmp_path)
