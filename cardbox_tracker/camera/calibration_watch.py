"""Follows lasting changes of a camera's calibration and ignores brief or invalid ones.

A single wrong CameraInfo, or a second camera on the same topic, must not discard the background
that was learned with the right one. Images that stay the same prove a lasting change wrong.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.camera.camera_info import calibration_from_info, info_content, info_remark
from cardbox_tracker.camera.zoom import ZoomWitness
from cardbox_tracker.common.errors import CameraError
from cardbox_tracker.common.health import WATCHES

LASTING = round(WATCHES["other calibration"].limit) + 1
"""A change is accepted after this many equal calibrations in a row."""

# A remark is removed after this many valid calibrations.
_REMEMBERED = 150


class CalibrationWatch:
    """Selects the calibration of the camera from the CameraInfo messages that arrive.

    Attributes:
        images: takes the camera's images, if there are any, which may contradict a change.
        current: calibration in use; None before the first valid one.
        seen: True once any CameraInfo arrived, valid or not.
        ignored: number of messages that were ignored.
        remark: description of a recently ignored message; empty if there is none.
        doubt: what is unusual about the calibration in use; empty if nothing is.
    """

    def __init__(self, topic: str, image_topic: str, roll_rad: float = 0.0) -> None:
        """Watch the calibrations on ``topic``, which belong to the images on ``image_topic``."""
        self._roll_rad = roll_rad
        self.images = ZoomWitness()
        self.current: Calibration | None = None
        self.seen = False
        self.ignored = 0
        self.remark = self.doubt = ""
        self._topic = topic
        self._image_topic = image_topic
        self._other: Calibration | None = None
        self._content: tuple[Any, ...] = ()
        self._count = 0
        self._is_contradicted = False
        self._good = 0

    def see(self, message: Any) -> bool:
        """Process a sensor_msgs/CameraInfo; return whether the calibration in use has changed.

        Raises CameraError if the message is invalid and no valid one has arrived yet.
        """
        self.seen, content = True, info_content(message)
        if self.current is not None and content == self._content:
            self._back_to_good()
            return False
        try:
            calibration = calibration_from_info(message, self._image_topic, self._topic)
            calibration = replace(calibration, roll_rad=self._roll_rad)
            self._check(calibration)
        except CameraError as error:
            self._other = None
            if self.current is None:
                raise
            self._ignore(
                f"an invalid CameraInfo on {self._topic} is ignored, the one before is used: "
                f"{error}"
            )
            return False
        if self.current is not None and self.current.is_same(calibration):
            self._content = content
            self._back_to_good()
            return False
        is_resized = self.current is not None and self.current.is_resized(calibration)
        if self.current is not None and not is_resized and not self._lasts(calibration):
            name = "wrong calibration" if self._is_contradicted else "other calibration"
            given = {"topic": self._topic, "image_topic": self._image_topic, "lasting": LASTING}
            given |= {"other": calibration, "current": self.current}
            self._ignore(WATCHES[name].words.format(**given))
            return False
        self.current, self._other, self._count = calibration, None, 0
        self._content = content
        self.remark, self.doubt = "", info_remark(message, self._topic, self._image_topic)
        return True

    def _check(self, calibration: Calibration) -> None:
        try:
            calibration.camera(calibration.width, calibration.height)
        except CameraError as error:
            raise CameraError(
                f"{self._topic}, of the images on {self._image_topic}: {error}"
            ) from None

    def _lasts(self, calibration: Calibration) -> bool:
        if self._other is None or not self._other.is_same(calibration):
            self._other, self._count, self._is_contradicted = calibration, 0, False
            self.images.mark()
        self._count += 1
        if self._count % LASTING:
            return False
        assert self.current is not None
        self._is_contradicted = self.images.contradicts(self.current, calibration)
        return not self._is_contradicted

    def _ignore(self, remark: str) -> None:
        self.ignored += 1
        self.remark, self._good = remark, 0

    def _back_to_good(self) -> None:
        self._other, self._count = None, 0
        self._good += 1
        if self._good % LASTING == 1:
            self.images.remember()
        if self._good >= _REMEMBERED:
            self.remark = ""
