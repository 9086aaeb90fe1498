"""One image of a recording, and what videos and folders of images share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.common.errors import BagError, quoted
from cardbox_tracker.recordings.given_camera import GivenCamera


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


class Film:
    """Base of videos and folders of images: one camera that the user describes.

    Times count from the first image.

    Attributes:
        path: the file or folder.
        duration_s: seconds from the first to the last image.
    """

    start_ns = 0

    def __init__(self, path: Path, camera: GivenCamera) -> None:
        self.path, self._given = path, camera
        # The one that may tell the field of view.
        self._file = path
        self.duration_s = 0.0
        self._size = self._stored = (0, 0)

    def _set_size(self, width: int, height: int) -> None:
        """Store the size of the images, px."""
        self._stored = self._stored if any(self._stored) else (width, height)
        self._size = width, height

    def __exit__(self, *_: object) -> None:
        """Do nothing: files are only open while they are read."""

    def image_topic(self, camera: str | None = None) -> str:
        """Return the name of the file or folder; raise BagError if a camera is named."""
        if camera is not None:
            raise BagError(
                f"{self.path} is of one camera, and {quoted(camera)} is none; omit --cameras"
            )
        return self.path.name

    def calibration(self, camera: str | None = None) -> Calibration:
        """Return the given calibration, or what the file tells, or that of a usual camera.

        Raises BagError if a camera is named, CameraError if the calibration does not fit the
        images.
        """
        self.image_topic(camera)
        return self._given.calibrated(self.path, *self._size, stored=self._stored, file=self._file)

    @property
    def remarks(self) -> list[str]:
        """Warnings about the field of view."""
        return self._given.remarks(self._file, *self._size)
