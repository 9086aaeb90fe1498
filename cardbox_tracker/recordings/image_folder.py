"""Read a folder of images as a recording."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.encodings import MOST_PIXELS, Levels, decode_compressed
from cardbox_tracker.common.errors import BagError, EncodingError, quoted
from cardbox_tracker.common.files import UnreadableFileError, read_regular
from cardbox_tracker.recordings.image_recording import Film, RecordedImage

SUFFIXES = (".jpg", ".jpeg", ".png")
"""Endings of the images, in small or capital letters."""
FPS = 30.0
"""Images a second unless another rate is given."""
# More than the largest image needs without compression.
_MOST_BYTES = 4 * MOST_PIXELS


def image_files(folder: Path) -> list[Path]:
    """Return the images of a folder by name, numbers as numbers, without hidden files."""
    files = (path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    seen = (path for path in files if path.is_file() and not path.name.startswith("."))
    return sorted(seen, key=_by_number)


def _by_number(path: Path) -> list[tuple[int, str]]:
    parts = re.findall(r"\d+|\D+", path.name)
    return [(int(part) if part.isdecimal() else -1, part) for part in parts]


def _numbered(files: Sequence[Path]) -> list[int]:
    """Return places from 0 by numbers that mostly grow by one step, else the order of names."""
    parts = [_by_number(path) for path in files]
    if len({len(part) for part in parts}) == 1:
        varying = [column for column in zip(*parts, strict=True) if len(set(column)) > 1]
        if len(varying) == 1:
            numbers = [number for number, _ in varying[0]]
            (step, times), *_ = Counter(b - a for a, b in pairwise(numbers)).most_common()
            places = [(number - numbers[0]) / max(1, step) for number in numbers]
            is_even = all(place.is_integer() for place in places)
            if is_even and len(set(places)) == len(files) and 2 * times >= len(files) - 1:
                return [int(place) for place in places]
    return [*range(len(files))]


class ImageFolder(Film):
    """Context of an open folder of images of one camera; its times count from the first one.

    Images are turned as their EXIF data ask for. Methods raise BagError if the folder cannot be
    read.
    """

    def __enter__(self) -> ImageFolder:
        """Read the names of the images, and the size of the first one that can be decoded."""
        self._files = image_files(self.path)
        self._places, self._levels = _numbered(self._files), Levels()
        reason = ""
        for file in self._files:
            try:
                height, width = self._image(file).shape[:2]
            except EncodingError as error:
                reason = reason or f" ({error})"
                continue
            self._set_size(width, height)
            self._file = file
            break
        else:
            raise BagError(
                f"{self.path} has no JPEG or PNG image that can be decoded{reason}; give a folder "
                "of the images of one camera"
            )
        self.duration_s = self._places[-1] / (self._given.fps or FPS)
        return self

    def left_out(self, topic: str, used: Collection[str] = ()) -> list[str]:
        """Return the files that are no images."""
        names = sorted(path.name for path in self.path.iterdir() if path.is_file())
        hidden = [name for name in names if name.startswith(".")]
        others = [name for name in names if name not in {path.name for path in self._files}]
        others = [name for name in others if name not in hidden]
        gaps = zip(self._files, self._places, self._places[1:], strict=False)
        before = [file.name for file, place, later in gaps if later > place + 1]
        lacking = self._places[-1] + 1 - len(self._files)
        missing = [f"{lacking} that the numbering lacks (after {', '.join(before[:3])})"]
        return [
            f"{len(files)} {kind} ({files[0]})"
            for kind, files in (("hidden files", hidden), ("files of other kinds", others))
            if files
        ] + (missing if lacking else [])

    def images(self, topic: str | None = None) -> Iterator[RecordedImage]:
        """Yield the images in order, at the given rate; missing numbers leave gaps."""
        for place, file in zip(self._places, self._files, strict=True):
            stamp_ns = round(1e9 * place / (self._given.fps or FPS))
            decode = partial(self._image, file, self._size)
            yield RecordedImage(stamp_ns, "", stamp_ns, decode, file.name)

    def _image(self, file: Path, size: tuple[int, int] | None = None) -> NDArray[np.uint8]:
        """Return an image (H, W) or (H, W, 3), which must have ``size`` (width, height), px."""
        try:
            image = decode_compressed(read_regular(file, _MOST_BYTES), levels=self._levels)
        except (EncodingError, UnreadableFileError) as error:
            raise EncodingError(f"{file.name}: {error}") from None
        found = image.shape[1], image.shape[0]
        if size is not None and found != size:
            raise EncodingError(
                f"{file.name} has {found[0]}x{found[1]} px; expected the {size[0]}x{size[1]} px of "
                "the first image"
            )
        return image

    @property
    def remarks(self) -> list[str]:
        """Remarks on the field of view, on the range of images of 16 bits, and on other cameras."""
        series = Counter(re.sub(r"\d+", "", path.stem) for path in self._files)
        found = [*super().remarks, *([self._levels.text] if self._levels.text else [])]
        # Names without numbers in common are names of single images.
        if len(series) > 1 and len(set(series.values())) == 1 < min(series.values()):
            found.append(
                f"{self.path} has {len(series)} series of images, {quoted(', '.join(series))}, and "
                "uses one after the other as those of one camera; give each camera its own folder"
            )
        return found
