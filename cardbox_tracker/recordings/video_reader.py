"""Read the images of a video file."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from cardbox_tracker.camera.encodings import MOST_PIXELS
from cardbox_tracker.camera.film_headers import (
    check_times,
    oblong,
    shown_s,
    with_square_pixels,
)
from cardbox_tracker.camera.image_headers import check_pixels
from cardbox_tracker.common.errors import BagError, EncodingError
from cardbox_tracker.recordings.film import Film
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.image_recording import RecordedImage

FORMATS = "MP4, MOV, AVI, MKV or WebM"
"""Common containers, for texts; any that OpenCV can read will do."""
SUFFIXES = (".mp4", ".m4v", ".mov", ".avi", ".mkv", ".webm")
"""Endings, in small or capital letters, by which videos are found in a folder."""

# Rate of a video that states none, and the largest rate that is believed, Hz.
_USUAL_HZ, _MOST_HZ = 30.0, 1000.0
# Images that a whole video may lack at its end, since containers count inexactly.
_LACKING = 2


class VideoReader(Film):
    """Context of an open video; its times count from its first image.

    Images are turned as the file asks for, as those of a phone that was held upright. Methods
    raise BagError if the video cannot be read. The duration is the one that the file states.
    """

    def __init__(self, path: Path, camera: GivenCamera) -> None:
        """Store the path and the camera; the video is opened on entry."""
        super().__init__(path, camera)
        self._count = self._last = 0

    def __enter__(self) -> VideoReader:
        """Open the video and read its first image."""
        if not self.path.is_file():
            raise BagError(f"there is no video {self.path}; give a file in {FORMATS}")
        with _opened(self.path) as capture:
            size = (capture.get(cv2.CAP_PROP_FRAME_WIDTH), capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
            try:
                check_pixels(int(size[0]), int(size[1]), MOST_PIXELS)
            except EncodingError as error:
                raise BagError(f"cannot read the video {self.path}: {error}") from None
            found, image = capture.read()
            if not found:
                raise BagError(
                    f"the video {self.path} has no image that can be decoded; expected {FORMATS}: "
                    "film again, or convert it with 'ffmpeg -i INPUT OUTPUT.mp4'"
                )
            if self._given.fps is None:
                check_times(self.path, "give its images a second as --fps HZ")
            self._stored = image.shape[1], image.shape[0]
            self._set_size(*with_square_pixels(image, oblong(capture)).shape[1::-1])
            self._hz = self._given.fps or _rate(capture)
            self._count = max(0, _count(self.path, capture))
        self.duration_s = max(0, self._count - 1) / self._hz
        return self

    def images(self, topic: str | None = None) -> Iterator[RecordedImage]:
        """Yield the images in order, with the time in the file or at the given rate."""
        period_ns = 1e9 / self._hz
        first_ms, stamp_ns = 0.0, -1
        with _opened(self.path) as capture:
            number, shape = 0, oblong(capture)
            while (read := capture.read())[0]:
                if self._given.fps is None:
                    in_file_ms = capture.get(cv2.CAP_PROP_POS_MSEC)
                    first_ms = in_file_ms if number == 0 else first_ms
                    there_ns = round(1e6 * (in_file_ms - first_ms))
                    # Damaged files state the same time for several images.
                    stamp_ns = there_ns if there_ns > stamp_ns else stamp_ns + round(period_ns)
                else:
                    stamp_ns = round(number * period_ns)
                decoded = with_square_pixels(read[1], shape)
                number += 1
                yield RecordedImage(stamp_ns, "", stamp_ns, partial(np.asarray, decoded))
        self._last = number
        self.duration_s = max(0, stamp_ns) / 1e9

    @property
    def remarks(self) -> list[str]:
        """Warnings about the field of view, and about a video that ends early."""
        found = super().remarks
        if 0 < self._last < self._count - _LACKING:
            found.append(
                f"{self.path} ends after {self._last} of {self._count} images; it is damaged or "
                "was cut off"
            )
        return found


@contextmanager
def _opened(path: Path) -> Iterator[cv2.VideoCapture]:
    # Without this, FFmpeg writes its own messages between those of this package.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    capture = cv2.VideoCapture(str(path))
    try:
        if not capture.isOpened():
            raise BagError(
                f"cannot read the recording {path}: expected a rosbag2, a folder of JPEG or PNG "
                f"images, or a video ({FORMATS}) that is not empty or cut off; 'ffmpeg -i INPUT "
                "OUTPUT.mp4' converts others"
            )
        capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 1)
        yield capture
    finally:
        capture.release()


def _count(path: Path, capture: cv2.VideoCapture) -> int:
    """Return how many images a film should have, from its first one on; negative if unknown."""
    count, shown = int(capture.get(cv2.CAP_PROP_FRAME_COUNT)), shown_s(path)
    if shown is not None:
        return min(count, round(shown * _rate(capture)))
    # Others count from the time 0, at which their first image need not be.
    return count - max(0, int(capture.get(cv2.CAP_PROP_PTS)))


def _rate(capture: cv2.VideoCapture) -> float:
    stated = float(capture.get(cv2.CAP_PROP_FPS))
    return stated if 0.0 < stated <= _MOST_HZ else _USUAL_HZ
