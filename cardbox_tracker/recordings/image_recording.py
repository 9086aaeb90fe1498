"""A recording as a source of images: a bag, a video or a folder of images."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from math import sqrt
from pathlib import Path
from types import TracebackType
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Calibration

WORKING_SIZE = (320, 240)
"""Working size (width, height), px, of bags, whatever the aspect ratio of their images."""
# The kernels draw rows of pixels fastest if their number is a multiple of this.
_MULTIPLE_PX = 8


def working_size(width: int, height: int) -> tuple[int, int]:
    """Return the working size for images of ``width`` x ``height`` px.

    It has their aspect ratio, as nearly as multiples of 8 px allow, and about as many pixels as
    ``WORKING_SIZE``, which it is for 4:3.
    """
    pixels, aspect = WORKING_SIZE[0] * WORKING_SIZE[1], width / height
    sides = sqrt(pixels * aspect), sqrt(pixels / aspect)
    across, down = (max(1, round(side / _MULTIPLE_PX)) * _MULTIPLE_PX for side in sides)
    return across, down


@dataclass(frozen=True)
class RecordedImage:
    """One image of a recording, decoded by its properties."""

    stamp_ns: int  #: stamp of the image; of a video, ns from its first image
    frame_id: str  #: name of the camera's optical frame
    time_ns: int  #: recording time
    _decode: Callable[[], NDArray[np.uint8]]
    name: str = ""  #: name of its file, if it is one

    @property
    def as_sent(self) -> NDArray[np.uint8]:
        """BGR (H, W, 3) of a colour camera, else brightness (H, W), uint8; or EncodingError."""
        return self._decode()


class ImageRecording(Protocol):
    """Context of an open recording of one or several cameras.

    Methods raise BagError if the recording cannot be read, or has no such camera. A camera is
    named by its namespace; None is the only one.
    """

    @property
    def path(self) -> Path:
        """The file or folder."""

    @property
    def start_ns(self) -> int:
        """Time of the first message or image."""

    @property
    def duration_s(self) -> float:
        """Seconds from the first to the last message or image."""

    @property
    def working_size(self) -> tuple[int, int]:
        """Size (width, height), px, at which the images are used."""

    @property
    def remarks(self) -> Sequence[str]:
        """Warnings about what was read so far."""

    def left_out(self, topic: str, used: Collection[str] = ()) -> list[str]:
        """Return what of these images was not used, and why; topics in ``used`` are no reason."""

    def __enter__(self) -> ImageRecording:
        """Open the recording."""

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the recording."""

    def image_topic(self, camera: str | None = None) -> str:
        """Return the name of a camera's images."""

    def images(self, topic: str | None = None) -> Iterator[RecordedImage]:
        """Yield the images of that name, in order."""

    def calibration(self, camera: str | None = None) -> Calibration:
        """Return the calibration of a camera; raise CameraError if there is none."""
