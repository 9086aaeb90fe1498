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
    path: str | os.PathLike[str], fps: float
) -> Iterator[Callable[[NDArray[np.uint8]], None]]:
    """Yield a function that adds an image (H, W, 3), bgr uint8, to a video.

    The first image determines the size of the video; later ones are resized to it.

    Args:
        path: file to write, .mp4 or .avi.
        fps: frames a second.

    Raises:
        CardboxError: the file cannot be written, or its suffix is not .mp4 or .avi.
    """
    name = os.fspath(path)
    if not name.endswith((".mp4", ".avi")):
        raise CardboxError(f"cannot write the video {name}; its name must end in .mp4 or .avi")
    with atomic_path(path) as temporary:
        code = cv2.VideoWriter.fourcc(*("mp4v" if name.endswith(".mp4") else "MJPG"))
        writer, size = cv2.VideoWriter(), (0, 0)

        def add(image: NDArray[np.uint8]) -> None:
            nonlocal size
            if not writer.isOpened():
                # Encoders want even sizes.
                size = image.shape[1] // 2 * 2, image.shape[0] // 2 * 2
                if not writer.open(str(temporary), code, fps, size):
                    raise CardboxError(
                        f"cannot write the video {name}; OpenCV has no encoder for it"
                    )
            fits = image.shape[1::-1] == size
            writer.write(image if fits else cv2.resize(image, size, interpolation=cv2.INTER_AREA))

        try:
            yield add
        finally:
            writer.release()
