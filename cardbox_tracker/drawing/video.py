"""Writes a video file completely or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.files import atomic_path


@contextmanager
def video_file(
    path: str | os.PathLike[str], size: tuple[int, int], fps: float
) -> Iterator[Callable[[NDArray[np.uint8]], object]]:
    """Yield a function that adds an image (H, W, 3), bgr uint8, to a video.

    Args:
        path: file to write, .mp4 or .avi.
        size: (width, height) of the images, px.
        fps: frames a second.

    Raises:
        CardboxError: the file cannot be written, or its suffix is not .mp4 or .avi.
    """
    name = os.fspath(path)
    if not name.endswith((".mp4", ".avi")):
        raise CardboxError(f"cannot write the video {name}; its name must end in .mp4 or .avi")
    with atomic_path(path) as temporary:
        code = cv2.VideoWriter.fourcc(*("mp4v" if name.endswith(".mp4") else "MJPG"))
        writer = cv2.VideoWriter(str(temporary), code, fps, size)
        if not writer.isOpened():
            raise CardboxError(f"cannot write the video {name}; OpenCV has no encoder for it")
        try:
            yield writer.write
        finally:
            writer.release()
