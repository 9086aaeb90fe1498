"""The node ``camera`` publishes a V4L2 device or a video file as Image and CameraInfo."""

from __future__ import annotations

import argparse
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from cardbox_tracker.camera.calibration_file import load_calibration
from cardbox_tracker.camera.camera import OPTICAL_FRAME, Calibration
from cardbox_tracker.camera.camera_device import (
    describe_devices,
    lock_exposure,
    open_device,
    open_video,
)
from cardbox_tracker.camera.camera_info import LEAST_FOV_DEG
from cardbox_tracker.camera.film_headers import (
    MOST_DAMAGED,
    check_times,
    oblong,
    with_square_pixels,
)
from cardbox_tracker.common.files import user_path
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.command_line import node_help
from cardbox_tracker.ros.runtime.node import CardboxNode, own_arguments, run_node
from cardbox_tracker.ros.runtime.parameter_fields import NodeParameters, at_start, parameter
from cardbox_tracker.ros.runtime.parameters import LiveParameters

_RETRY_S = 1.0
_SETTLE_S = 0.5
_USUAL_HZ = 15.0


@dataclass(frozen=True)
class CameraParameters(NodeParameters):
    """Publish a V4L2 device or a video file."""

    device: str = at_start("/dev/video0", "V4L2 device; unused if a file is given")
    file: str = at_start("", "video file to play instead of a device")
    loop: bool = parameter(False, "play the file again and again", effect="end of the file")
    width: int = at_start(640, "width to ask the device for", unit="px", limits=(32, 8192))
    height: int = at_start(480, "height to ask the device for", unit="px", limits=(32, 8192))
    rate_hz: float = at_start(
        0.0,
        "images a second; 0: the file's own rate, and 15 of a device",
        unit="Hz",
        limits=(0.0, 240.0),
    )
    encoding: str = parameter(
        "mono8",
        "mono8 suffices for the tracker and has a third of the bytes; bgr8 for colour",
        choices=("mono8", "bgr8"),
    )
    frame_id: str = parameter(OPTICAL_FRAME, "name of the camera's optical frame")
    calibration_file: str = at_start(
        "", "file of camera_calibration, OpenCV's FileStorage or Kalibr"
    )
    horizontal_fov_deg: float = at_start(
        0.0,
        "without a calibration file: assume an ideal lens of this field of view; 0: publish the "
        "camera as uncalibrated",
        unit="deg",
        limits=(0.0, 170.0),
    )
    settle_s: float = at_start(
        2.0,
        "time for the automatic exposure before it is locked, so that the background is constant",
        unit="s",
        limits=(0.0, 60.0),
    )
    lock_exposure: bool = at_start(
        True, "switch exposure and white balance to manual where the device allows"
    )

    def check(self) -> None:
        """Raise ValueError if values contradict each other."""
        if 0.0 < self.horizontal_fov_deg < LEAST_FOV_DEG:
            raise ValueError(
                f"horizontal_fov_deg is {self.horizontal_fov_deg:g}; expected degrees, "
                f"{LEAST_FOV_DEG:g} or more"
            )
        if not self.device and not self.file:
            raise ValueError("device and file are both empty; give one, such as /dev/video0")


class CameraNode(CardboxNode):
    """Reads images in a separate thread and publishes each with its calibration."""

    def __init__(self, **options: Any) -> None:
        super().__init__("camera", **options)
        self.parameters = LiveParameters(self, CameraParameters)
        settings = self.parameters.value
        self._images = self.advertise(Image, "image_raw", qos.CAMERA)
        self._infos = self.advertise(CameraInfo, "camera_info", qos.CAMERA)
        self._capture = open_video(settings.file) if settings.file else self._open_device()
        self._period_s, self._oblong = 0.0, 1.0
        if settings.file:
            if not settings.rate_hz:
                check_times(Path(settings.file).expanduser(), "set the parameter rate_hz")
            rate_hz = settings.rate_hz or self._capture.get(cv2.CAP_PROP_FPS)
            self._period_s = 1.0 / (rate_hz if 0 < rate_hz < 1000 else _USUAL_HZ)
            self._oblong = oblong(self._capture)
        self._calibration = (
            load_calibration(user_path(settings.calibration_file))
            if settings.calibration_file
            else None
        )
        if self._calibration is None and settings.horizontal_fov_deg <= 0:
            self.diagnostics.warn(
                "the images have no calibration (K is all zero), so nobody can be measured in "
                "them: give calibration_file, or for a first look the lens's field of view, such "
                "as horizontal_fov_deg:=60.0"
            )
        self._locked = bool(settings.file) or not settings.lock_exposure
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._read, name="camera", daemon=True)
        self._thread.start()

    def _open_device(self) -> cv2.VideoCapture:
        settings = self.parameters.value
        capture = open_device(settings.device)
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, settings.width)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, settings.height)
        capture.set(cv2.CAP_PROP_FPS, settings.rate_hz or _USUAL_HZ)
        return capture

    def _read(self) -> None:
        """Read and publish images at the rate; a file stops or starts over at its end."""
        if self.parameters.value.file:
            self._wait_for_listener()
        started_s = due_s = time.monotonic()
        failed = 0
        while not self._stop.is_set():
            settings = self.parameters.value
            ok, image = self._capture.read()
            if not ok:
                failed += 1
                if not settings.file:
                    self.diagnostics.problem(
                        f"{settings.device} delivers no image; is it plugged in, and used by no "
                        "other program? ('fuser -v' tells)"
                    )
                    self._stop.wait(_RETRY_S)
                elif failed >= MOST_DAMAGED:
                    if not (settings.loop and self._capture.set(cv2.CAP_PROP_POS_FRAMES, 0)):
                        self.diagnostics.wait_for(
                            f"a restart: {settings.file} has been played to its end"
                        )
                        return
                    failed = 0
                continue
            if not self._locked and time.monotonic() - started_s >= settings.settle_s:
                self._lock_exposure()
            if settings.file:
                # Damaged images take their time, too.
                due_s = max(
                    due_s + (1 + failed) * self._period_s, time.monotonic() - self._period_s
                )
                self._stop.wait(max(due_s - time.monotonic(), 0.0))
            failed = 0
            try:
                self._publish(np.asarray(image, dtype=np.uint8), settings)
            except Exception as error:
                if not self._stop.is_set():
                    self.diagnostics.problem(f"cannot publish the image: {error!r}")

    def _wait_for_listener(self) -> None:
        """Wait for a subscriber, so that it gets a video from the beginning."""
        while not self._stop.is_set():
            if self._images.get_subscription_count():
                # DDS matches the subscriber of the CameraInfo separately.
                self._stop.wait(_SETTLE_S)
                return
            self.diagnostics.wait_for(f"a subscriber of {self._images.topic_name} to begin")
            self._stop.wait(_SETTLE_S / 10)

    def _publish(self, image: conversions.ImageArray, settings: CameraParameters) -> None:
        header = Header(frame_id=settings.frame_id, stamp=self.get_clock().now().to_msg())
        if settings.encoding == "mono8" and image.ndim == 3:
            image = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        elif settings.encoding == "bgr8" and image.ndim == 2:
            image = np.asarray(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
        if self._calibration is None:
            image = with_square_pixels(image, self._oblong)
        height, width = image.shape[:2]
        calibration, fov_deg = self._calibration, settings.horizontal_fov_deg
        if calibration is None and fov_deg > 0:
            calibration = Calibration.of_fov(width, height, fov_deg)
        elif calibration is None:
            # A zero K stands for an uncalibrated camera.
            calibration = Calibration(width, height, np.zeros((3, 3)), np.zeros(5))
        self._infos.publish(conversions.calibration_message(header, calibration))
        self._images.publish(conversions.image_message(header, image, settings.encoding))
        self.diagnostics.input.add(conversions.stamp_ns(header.stamp))
        self.diagnostics.working()

    def _lock_exposure(self) -> None:
        self._locked = True
        for what, done in lock_exposure(self._capture).items():
            if done:
                self.get_logger().info(f"{what} is manual now")
            else:
                self.diagnostics.warn(
                    f"the device does not allow a manual {what}; if the background drifts, look "
                    "for a control in 'v4l2-ctl --list-ctrls'"
                )

    def close(self) -> None:
        """Stop reading and release the device."""
        self._stop.set()
        self._thread.join(timeout=2.0)
        self._capture.release()


def main(args: list[str] | None = None) -> int:
    """Run the node; the exit code is 0 unless it could not start."""
    command_line = list(sys.argv) if args is None else ["camera", *args]
    parser = argparse.ArgumentParser(
        prog="camera",
        description="Publish a V4L2 device or a video file.",
        **node_help(
            "camera", CameraParameters, "Everything else is a ROS argument: -p device:=/dev/video0."
        ),
    )
    parser.add_argument("--list", action="store_true", help="list devices and modes, and exit")
    if parser.parse_args(own_arguments(command_line)).list:
        print(describe_devices())
        return 0
    return run_node(CameraNode, command_line)
