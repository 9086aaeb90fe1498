"""Read a folder of images as a recording."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.errors import BagError, EncodingError
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.image_recording import RecordedImage, working_size
from cardbox_tracker.vision.camera import Calibration
from cardbox_tracker.vision.encodings import decode_compressed

SUFFIXES = (".jpg", ".jpeg", ".png")
"""Endings of the images, in small or capital letters."""
FPS = 30.0
"""Images a second unless another rate is given."""


def image_files(folder: Path) -> list[Path]:
    """Return the images of a folder, ordered by name; numbers in names count as numbers."""
    files = (path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    return sorted((path for path in files if path.is_file()), key=_by_number)


def _by_number(path: Path) -> list[tuple[int, str]]:
    parts = re.findall(r"\d+|\D+", path.name)
    return [(int(part) if part.isdecimal() else -1, part) for part in parts]


class ImageFolder:
    """Context of an open folder of images of one camera; its times count from the first one.

    Images are turned as their EXIF data ask for. Methods raise BagError if the folder cannot be
    read.

    Attributes:
        path: the folder.
        working_size: see ``ImageRecording``.
        duration_s: seconds from the first to the last image.
    """

    start_ns = 0

    def __init__(self, path: Path, camera: GivenCamera) -> None:
        """Store the path and the camera; the folder is read on entry."""
        self.path, self._given = path, camera
        self.working_size, self.duration_s = (0, 0), 0.0
        self._files: list[Path] = []
        self._size = (0, 0)

    def __enter__(self) -> ImageFolder:
        """Read the names of the images, and the size of the first one that can be decoded."""
        self._files = image_files(self.path)
        for file in self._files:
            with suppress(EncodingError):
                height, width = _image(file).shape[:2]
                self._size = width, height
                break
        else:
            raise BagError(
                f"{self.path} has no JPEG or PNG image that can be decoded; give a folder of the "
                "images of one camera"
            )
        self.working_size = working_size(*self._size)
        self.duration_s = (len(self._files) - 1) / (self._given.fps or FPS)
        return self

    def __exit__(self, *_: object) -> None:
        """Close the folder, which is only open while its names are read."""

    def image_topic(self, camera: str | None = None) -> str:
        """Return the name of the folder; there is only one camera."""
        if camera is not None:
            raise BagError(f"{self.path} is of one camera, and {camera!r} is none; omit --cameras")
        return self.path.name

    def images(self, topic: str | None = None) -> Iterator[RecordedImage]:
        """Yield the images in order, at the given rate."""
        for number, file in enumerate(self._files):
            stamp_ns = round(1e9 * number / (self._given.fps or FPS))
            yield RecordedImage(stamp_ns, "", stamp_ns, partial(_image, file, self._size))

    def calibration(self, camera: str | None = None) -> Calibration:
        """Return the given calibration.

        Raises:
            CameraError: none is given, or it does not fit the images.
        """
        self.image_topic(camera)
        return self._given.calibrated(self.path, *self._size)

    @property
    def remarks(self) -> list[str]:
        """Warnings about the field of view."""
        return self._given.remarks(*self._size)


def _image(file: Path, size: tuple[int, int] | None = None) -> NDArray[np.uint8]:
    """Return an image (H, W) or (H, W, 3), which must have ``size`` (width, height), px."""
    try:
        image = decode_compressed(file.read_bytes())
    except OSError as error:
        raise EncodingError(f"{file.name}: {error.strerror}") from None
    except EncodingError as error:
        raise EncodingError(f"{file.name}: {error}") from None
    found = image.shape[1], image.shape[0]
    if size is not None and found != size:
        raise EncodingError(
            f"{file.name} has {found[0]}x{found[1]} px; expected the {size[0]}x{size[1]} px of the "
            "first image"
        )
    return image
