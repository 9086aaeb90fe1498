"""Read the images of a video file."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from fractions import Fraction
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.encodings import MOST_PIXELS
from cardbox_tracker.camera.film_headers import (
    MOST_DAMAGED,
    check_times,
    codecs,
    display_matrix,
    oblong,
    placed_by,
    shown_s,
    with_square_pixels,
)
from cardbox_tracker.camera.image_headers import check_pixels
from cardbox_tracker.common.beside import results_ahead
from cardbox_tracker.common.errors import BagError, EncodingError
from cardbox_tracker.recordings.image_recording import Film, RecordedImage

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

    Images are turned and mirrored as the file asks for, as those of a phone that was held upright,
    and of several streams they are of the one that players choose. Methods raise BagError if the
    video cannot be read. The duration is the one that the file states.
    """

    _damaged, _stated_s, _end = 0, 0.0, ""
    _stream, _streams = 0, 1

    def __enter__(self) -> VideoReader:
        if not self.path.is_file():
            raise BagError(f"there is no video {self.path}; give a file in {FORMATS}")
        self._stream, self._streams = _best_stream(self.path)
        with _opened(self.path, self._stream) as (capture, next_image):
            size = (capture.get(cv2.CAP_PROP_FRAME_WIDTH), capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
            try:
                check_pixels(int(size[0]), int(size[1]), MOST_PIXELS)
            except EncodingError as error:
                raise BagError(f"cannot read the video {self.path}: {error}") from None
            # One image after the other: the position in the file is that of the first one then.
            tried = (next_image(number)[0] for number in range(MOST_DAMAGED))
            image = next((image for image in tried if image is not None), None)
            if image is None:
                raise BagError(
                    f"the video {self.path} has no image that can be decoded"
                    f"{codecs(self.path)}; expected {FORMATS}: film again, or convert it with "
                    "'ffmpeg -i INPUT -c:v libx264 OUTPUT.mp4'"
                )
            if self._given.fps is None:
                check_times(self.path, "give its images a second as --fps HZ")
            self._stored = image.shape[1], image.shape[0]
            self._set_size(*with_square_pixels(image, oblong(capture)).shape[1::-1])
            self._file_hz = _rate(capture)
            self._stated_s = _stated_s(self.path, capture)
        self._hz = self._given.fps or self._file_hz
        self.duration_s = max(0, round(self._stated_s * self._file_hz) - 1) / self._hz
        return self

    def images(self, topic: str | None = None) -> Iterator[RecordedImage]:
        """Yield images that can be decoded, with the time in the file or at the given rate."""
        first_ms, file_ns, stamp_ns = 0.0, -1, -1
        number = damaged = 0
        with _opened(self.path, self._stream) as (capture, next_image):
            shape = oblong(capture)
            for image, in_file_ms in _read(next_image):
                if image is None:
                    self._damaged = max(self._damaged, damaged := damaged + 1)
                    continue
                first_ms = in_file_ms if number == 0 else first_ms
                there_ns = round(1e6 * (in_file_ms - first_ms))
                # Damaged files state the same time for several images.
                file_ns = there_ns if there_ns > file_ns else file_ns + round(1e9 / self._file_hz)
                in_order = round(1e9 * (number + damaged) / self._hz)
                stamp_ns = file_ns if self._given.fps is None else in_order
                decoded = with_square_pixels(image, shape)
                number += 1
                yield RecordedImage(stamp_ns, "", stamp_ns, partial(np.asarray, decoded))
        last_s = max(file_ns / 1e9, 1.0 / self._file_hz)
        if 0.0 < last_s * (number + _LACKING) / max(1, number - 1) < self._stated_s:
            self._end = f"ends after {number} images and {last_s:.1f} of {self._stated_s:.1f} s"
        self.duration_s = max(0, stamp_ns) / 1e9

    def left_out(self, topic: str, used: Collection[str] = ()) -> list[str]:
        """Return which images could not be read."""
        damaged = [f"{self._damaged} that cannot be decoded"] if self._damaged else []
        if self._streams > 1:
            damaged.append("the video streams beside the one that players show")
        return damaged + (["the rest of the video, which is missing"] if self._end else [])

    @property
    def remarks(self) -> list[str]:
        """Warnings about the field of view, and about a video that is damaged or ends early."""
        found = super().remarks
        if self._damaged:
            found.append(
                f"{self._damaged} images of {self.path} are damaged and left out; the others keep "
                "their times"
            )
        if self._end:
            found.append(f"{self.path} {self._end}; it is damaged or was cut off")
        return found


Next = Callable[[int], tuple[NDArray[Any] | None, float]]
"""Returns the next image, None if it is broken, and its time in the file, ms."""


@contextmanager
def _opened(path: Path, stream: int) -> Iterator[tuple[cv2.VideoCapture, Next]]:
    # Without this, FFmpeg writes its own messages between those of this package.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    matrix = display_matrix(path, stream)
    # OpenCV reads only the first stream.
    capture: Any = _Stream(path, stream, matrix) if stream else cv2.VideoCapture(str(path))
    try:
        if not capture.isOpened():
            raise BagError(
                f"cannot read the recording {path}{codecs(path)}: expected a rosbag2, a folder of "
                f"JPEG or PNG images, or a video ({FORMATS}) that is not empty, cut off or sound "
                "alone; 'ffmpeg -i INPUT -c:v libx264 OUTPUT.mp4' converts others"
            )
        # OpenCV turns images, and does not mirror them.
        is_own = stream > 0 or np.linalg.det(matrix) < 0
        if not stream:
            capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0 if is_own else 1)
        yield capture, partial(_next, capture, matrix if is_own else None)
    finally:
        capture.release()


def _best_stream(path: Path) -> tuple[int, int]:
    """Return the number of the video stream that players choose, from 0 on, and how many are."""
    # Slow to import.
    import av

    with (
        suppress(av.FFmpegError, OSError, ValueError),
        av.open(str(path), metadata_errors="ignore") as film,
    ):
        streams, best = film.streams.video, film.streams.best("video")
        if best is not None and len(streams) > 1:
            return [stream.index for stream in streams].index(best.index), len(streams)
    return 0, 1


class _Stream:
    """A video stream that is not the first, with the methods of ``cv2.VideoCapture``."""

    def __init__(self, path: Path, number: int, matrix: NDArray[np.float64]) -> None:
        import av

        self._film = av.open(str(path), metadata_errors="ignore")
        self._stream = self._film.streams.video[number]
        self._images = self._film.decode(self._stream)
        self._turned_deg = 90 if abs(matrix[0, 1]) > abs(matrix[0, 0]) else 0
        self._time_s = 0.0

    def isOpened(self) -> bool:
        return True

    def get(self, name: int) -> float:
        stream, shape = self._stream, self._stream.sample_aspect_ratio or Fraction(1)
        rate = float(stream.average_rate or 0)
        lasts_s = float((stream.duration or 0) * (stream.time_base or 0))
        return {
            cv2.CAP_PROP_FRAME_WIDTH: stream.width,
            cv2.CAP_PROP_FRAME_HEIGHT: stream.height,
            cv2.CAP_PROP_SAR_NUM: shape.numerator,
            cv2.CAP_PROP_SAR_DEN: shape.denominator,
            cv2.CAP_PROP_ORIENTATION_META: self._turned_deg,
            cv2.CAP_PROP_FPS: rate,
            cv2.CAP_PROP_FRAME_COUNT: stream.frames or lasts_s * rate,
            cv2.CAP_PROP_PTS: self._time_s * rate,
            cv2.CAP_PROP_POS_MSEC: 1e3 * self._time_s,
        }[name]

    def read(self) -> tuple[bool, NDArray[Any] | None]:
        from av import FFmpegError

        try:
            image = next(self._images)
        except (StopIteration, FFmpegError):
            return False, None
        self._time_s = float(image.time or 0.0)
        return True, image.to_ndarray(format="bgr24")

    def release(self) -> None:
        self._film.close()


def _read(next_image: Next) -> Iterator[tuple[NDArray[Any] | None, float]]:
    """Yield images, None if broken, and their times in the file, ms; the next are decoded ahead."""
    failed = 0
    for image, time_ms in results_ahead(next_image, count()):
        if image is not None:
            yield from [(None, 0.0)] * failed
            failed = 0
            yield image, time_ms
        elif (failed := failed + 1) == MOST_DAMAGED:
            return


def _next(
    capture: cv2.VideoCapture, matrix: NDArray[np.float64] | None, _: int
) -> tuple[NDArray[Any] | None, float]:
    found, image = capture.read()
    if found and matrix is not None:
        image = placed_by(matrix, image)
    return image if found else None, capture.get(cv2.CAP_PROP_POS_MSEC)


def _stated_s(path: Path, capture: cv2.VideoCapture) -> float:
    """Return how long a film should last, from its first image on; not above 0 if unknown."""
    rate = float(capture.get(cv2.CAP_PROP_FPS)) or _USUAL_HZ
    lasts_s, shown = capture.get(cv2.CAP_PROP_FRAME_COUNT) / rate, shown_s(path)
    if shown is not None:
        return float(min(lasts_s, shown))
    # Others count from the time 0, at which their first image need not be.
    return float(lasts_s - max(0.0, capture.get(cv2.CAP_PROP_PTS)) / rate)


def _rate(capture: cv2.VideoCapture) -> float:
    stated = float(capture.get(cv2.CAP_PROP_FPS))
    return stated if 0.0 < stated <= _MOST_HZ else _USUAL_HZ
