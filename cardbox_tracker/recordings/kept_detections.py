"""Detections in the images of one camera, which a second pass need not find again.

A recording is read twice: the scene is measured before the first image is tracked. The networks
take most of the time, so what they find is kept in a temporary file, with masks of one bit a pixel.
"""

from __future__ import annotations

import pickle
import weakref
import zlib
from tempfile import SpooledTemporaryFile

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.detectors.detector import PersonDetector
from cardbox_tracker.detectors.pose_network import Detection

# Bytes that are kept in memory: some ten minutes of a film.
_IN_MEMORY = 64 * 1024 * 1024


class KeptDetections:
    """The detector of one camera."""

    def __init__(self, detector: PersonDetector, finds_people: bool) -> None:
        """Use a detector for the images of a recording, of one person or of all people."""
        self.detector, self._finds_people = detector, finds_people
        self._span: tuple[float, float] | None = None
        self._is_whole = False
        self._places: dict[int, int] = {}
        self._file = SpooledTemporaryFile(_IN_MEMORY)  # noqa: SIM115
        weakref.finalize(self, self._file.close)

    def start(self, start_s: float, end_s: float) -> None:
        """Begin a pass over the images of a span, seconds from the start of the recording."""
        if self._is_whole and self._span == (start_s, end_s):
            return
        # Detections depend on the images before, so those of another span do not count.
        self.detector.restart()
        self._span, self._is_whole = (start_s, end_s), False
        self._places.clear()
        self._file.seek(0)
        self._file.truncate()

    def end(self) -> None:
        """End a pass in which all images of the span were seen."""
        self._is_whole = True

    def __call__(self, number: int, stamp_ns: int, image: NDArray[np.uint8]) -> list[Detection]:
        """Return the people in an image (H, W) or (H, W, 3), bgr, of a number in the recording."""
        if number in self._places:
            self._file.seek(self._places[number])
            return [_unpacked(*one) for one in pickle.load(self._file)]
        if self._finds_people:
            found = self.detector.all_in(stamp_ns, image)
        else:
            person = self.detector(image, stamp_ns)
            found = [] if person is None else [person]
        self._file.seek(0, 2)
        self._places[number] = self._file.tell()
        pickle.dump([_packed(one) for one in found], self._file)
        return found


def _packed(found: Detection) -> tuple[Detection, tuple[int, ...], bytes]:
    bits = zlib.compress(np.packbits(found.silhouette() > 0).tobytes(), 1)
    return found._replace(mask=np.zeros(0, np.uint8)), found.mask.shape, bits


def _unpacked(found: Detection, shape: tuple[int, ...], bits: bytes) -> Detection:
    flat = np.unpackbits(np.frombuffer(zlib.decompress(bits), np.uint8), count=int(np.prod(shape)))
    return found._replace(mask=255 * flat.reshape(shape))
