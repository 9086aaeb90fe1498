"""Writes videos, and the overlay video of ``cardbox track --video``."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np

from cardbox_tracker.applications.drawing.overlay import (
    ImageArray,
    draw_overlay,
    readable_scale,
    with_hidden_faces,
)
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.beside import done_beside
from cardbox_tracker.common.errors import BagError, CardboxError
from cardbox_tracker.common.files import atomic_path
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.recordings.recording import Recording
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.recordings.track import Observer
from cardbox_tracker.tracking.estimate import Estimate

# Rate of a video of a single image.
_USUAL_HZ = 15.0
# It takes half of the time of superfast with crf 23, and files are 1.1 to 1.6 times as large.
_H264 = {"preset": "ultrafast", "crf": "25"}


@contextmanager
def video_file(path: str | os.PathLike[str], fps: float) -> Iterator[Callable[[ImageArray], None]]:
    """Yield a function that adds an image (H, W, 3), bgr uint8, to a video.

    The first image determines the size; later ones are resized to it. The file appears on exit, and
    after an error there is none. Raises CardboxError if it cannot be written, or its suffix is not
    .mp4.
    """
    name = os.fspath(path)
    if not name.endswith(".mp4"):
        raise CardboxError(f"cannot write the video {name}; its name must end in .mp4")
    with atomic_path(path) as temporary, ExitStack() as stack:
        write, size = None, (0, 0)

        def add(image: ImageArray) -> None:
            nonlocal write, size
            try:
                if write is None:
                    # Encoders want even sizes.
                    size = image.shape[1] // 2 * 2, image.shape[0] // 2 * 2
                    write = stack.enter_context(_encoder(temporary, fps, size))
                fits = image.shape[1::-1] == size
                fitting = image if fits else cv2.resize(image, size, interpolation=cv2.INTER_AREA)
                write(np.asarray(fitting, np.uint8))
            except (OSError, ValueError) as error:
                raise CardboxError(
                    f"cannot write the video {name}: {error}; give another name or folder"
                ) from None

        yield add


@contextmanager
def _encoder(
    path: Path, fps: float, size: tuple[int, int]
) -> Iterator[Callable[[ImageArray], object]]:
    """Yield a function that adds an image of ``size`` to a file, as H.264, which OpenCV lacks."""
    # It takes 0.1 s to import.
    import av

    with av.open(str(path), "w", options={"movflags": "faststart"}) as container:
        stream = container.add_stream("h264", Fraction(fps).limit_denominator(1000), _H264)
        stream.width, stream.height = size
        yield lambda image: container.mux(stream.encode(av.VideoFrame.from_ndarray(image, "bgr24")))
        container.mux(stream.encode())


@contextmanager
def overlay_video(
    path: Path, recording: Recording, hides_heads: bool = False
) -> Iterator[Observer]:
    """Context of an observer that draws each estimate over the image of the first camera.

    Another thread draws and encodes. The video has the rate, size and aspect ratio of the recorded
    images; small ones are enlarged to at least 640 px along the longer side. Raises as
    :func:`video_file`.
    """
    try:
        rate_hz = round(1e9 / max(1, recording.first.period_ns()), 2)
    except BagError:
        rate_hz = _USUAL_HZ
    drawn: dict[int, ImageArray] = {}
    with video_file(path, rate_hz) as add:

        def draw(frame: RecordedFrame, estimate: Estimate, body: BodyModel, camera: Camera) -> None:
            # Several people are drawn one after the other into the same picture.
            if frame.stamp_ns not in drawn:
                finish()
                picture = recording.first.full_picture(frame)
                if hides_heads:
                    picture = with_hidden_faces(picture, camera, frame.everyone)
                drawn[frame.stamp_ns] = picture
            picture = drawn[frame.stamp_ns]
            scale = readable_scale(picture)
            given = body, camera, estimate, scale, hides_heads
            drawn[frame.stamp_ns] = draw_overlay(picture, *given)

        def finish() -> None:
            for picture in drawn.values():
                add(picture)
            drawn.clear()

        with done_beside(draw) as submit:
            # The next image may change what the tracker knows of the person.
            yield lambda frame, estimate, tracker: submit(
                frame, estimate, tracker.body, tracker.camera
            )
        finish()
