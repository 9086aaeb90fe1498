"""Writes videos, and the overlay video of ``cardbox track --video``."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2

from cardbox_tracker.applications.drawing.overlay import ImageArray, draw_camera_overlay
from cardbox_tracker.common.errors import BagError, CardboxError
from cardbox_tracker.common.files import atomic_path
from cardbox_tracker.recordings.recording import Recording
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.recordings.track import Observer
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.tracker import Tracker

# Rate of a video of a single image.
_USUAL_HZ = 15.0


@contextmanager
def video_file(path: str | os.PathLike[str], fps: float) -> Iterator[Callable[[ImageArray], None]]:
    """Yield a function that adds an image (H, W, 3), bgr uint8, to a video.

    The first image determines the size of the video; later ones are resized to it. The file
    appears on exit, and after an error there is none.

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

        def add(image: ImageArray) -> None:
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


@contextmanager
def overlay_video(path: Path, recording: Recording) -> Iterator[Observer]:
    """Context of an observer that draws each estimate over the image of the first camera.

    The video has the rate, the size and the aspect ratio of the recorded images; small images are
    enlarged to at least 640 px along the longer side.

    Raises:
        CardboxError: the file cannot be written, or its suffix is not .mp4 or .avi.
    """
    try:
        rate_hz = round(1e9 / max(1, recording.first.period_ns()), 2)
    except BagError:
        rate_hz = _USUAL_HZ
    with video_file(path, rate_hz) as add:

        def observe(frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
            picture = recording.first.full_picture(frame)
            add(draw_camera_overlay(picture, 0, estimate, tracker))

        yield observe
