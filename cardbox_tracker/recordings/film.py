"""Base of the recordings of one camera that do not describe it: videos and folders of images."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.common.errors import BagError
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.image_recording import working_size


class Film:
    """Images of one camera that the user describes; their times count from the first one.

    Attributes:
        path: the file or folder.
        working_size: see ``ImageRecording``.
        duration_s: seconds from the first to the last image.
    """

    start_ns = 0

    def __init__(self, path: Path, camera: GivenCamera) -> None:
        """Store the path and the camera; the recording is read on entry."""
        self.path, self._given = path, camera
        self.working_size, self.duration_s = (0, 0), 0.0
        self._size = self._stored = (0, 0)

    def _set_size(self, width: int, height: int) -> None:
        """Store the size of the images, px, and the working size that follows from it."""
        self._stored = self._stored if any(self._stored) else (width, height)
        self._size, self.working_size = (width, height), working_size(width, height)

    def __exit__(self, *_: object) -> None:
        """Do nothing: files are only open while they are read."""

    def image_topic(self, camera: str | None = None) -> str:
        """Return the name of the file or folder; raise BagError if a camera is named."""
        if camera is not None:
            raise BagError(f"{self.path} is of one camera, and {camera!r} is none; omit --cameras")
        return self.path.name

    def calibration(self, camera: str | None = None) -> Calibration:
        """Return the given calibration, or what the file tells, or that of a usual camera.

        Raises BagError if a camera is named, CameraError if the calibration does not fit the
        images.
        """
        self.image_topic(camera)
        return self._given.calibrated(self.path, *self._size, stored=self._stored, file=self._file)

    def left_out(self, topic: str, used: Collection[str] = ()) -> list[str]:
        """Return what is no image; see ``ImageRecording``."""
        return []

    @property
    def remarks(self) -> list[str]:
        """Warnings about the field of view."""
        return self._given.remarks(self._file, *self._size)

    @property
    def _file(self) -> Path:
        """The file that may tell the field of view."""
        return self.path
