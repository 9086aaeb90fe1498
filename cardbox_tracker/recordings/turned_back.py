"""A recording of a camera that turns, as one of a camera that stands still and sees more.

Each image is turned back by its rotation into the view of the first one, before what all images
show of the background. Whatever follows, such as detector, scene and tracker, has still images.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Calibration
from cardbox_tracker.detectors.person_choice import PersonChoice
from cardbox_tracker.detectors.pose_network import Detection
from cardbox_tracker.measuring.camera_turns import CameraTurns
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.recordings.image_recording import RecordedImage
from cardbox_tracker.recordings.open_images import ImageRecording

Image = NDArray[np.uint8]
Size = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Turned:
    """How the camera of a recording turns, found in level images of ``size`` with a ``lens``."""

    found: CameraTurns
    size: Size  #: width and height, px
    lens: Calibration

    @property
    def remark(self) -> str:
        """What was found, and what became of the images."""
        found = self.found
        lost = f"; how it turns is not known in {found.unknown} images" if found.unknown else ""
        return (
            f"the camera turns by up to {math.degrees(found.largest_rad):.0f} degrees: the images "
            f"are turned back into the view of the first one, in which results are{lost}"
        )

    def back(self, bag: ImageRecording) -> ImageRecording:
        """Return a recording with its images turned back."""
        return cast("ImageRecording", TurnedBack(bag, self))

    def corner_px(self, size: Size) -> FloatArray:
        """Return column and row (2,) at which turned images begin in a level image of a size."""
        return (np.array(self.found.corner_px) - 0.5) * np.divide(size, self.size) + 0.5

    def placed(self, choice: PersonChoice) -> PersonChoice:
        """Return a choice by a place in the first image for turned images."""
        level = self.lens.level_size(self.lens.width, self.lens.height)
        placed = self.lens.rectified(np.array([choice.place]), *level)[0]
        column, row = placed - self.corner_px(level)
        return replace(choice, place=(float(column), float(row)))


class TurnedBack:
    """A recording with its images turned back; all else is as in the recording."""

    def __init__(self, bag: ImageRecording, turned: Turned) -> None:
        """Take a recording, which need not be open yet."""
        self._bag, self._turned, self._lens = bag, turned, turned.lens
        self._rectifier = cache(turned.lens.rectifier)
        self._sides: Size = turned.found.background.shape[1::-1]
        self._room = cache(lambda size: cv2.resize(turned.found.background, size))

    def __getattr__(self, name: str) -> Any:
        """Return what else the recording has."""
        return getattr(self._bag, name)

    def __enter__(self) -> TurnedBack:
        self._bag.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self._bag.__exit__(*error)

    def calibration(self, camera: str | None = None) -> Calibration:
        """Return the ideal lens of the turned images.

        Roll and focal length that were found since are beside those of the rotations.
        """
        now, lens = self._bag.calibration(camera), self._lens
        size = lens.level_size(lens.width, lens.height)
        k = lens.camera(*size).k
        k[:2, 2] -= self._turned.corner_px(size)
        k[[0, 1], [0, 1]] *= now.k[0, 0] / lens.k[0, 0]
        roll_rad = now.roll_rad - lens.roll_rad
        return Calibration(
            *(*self._canvas(size), k, np.zeros(5)),
            frame_id=now.frame_id,
            roll_rad=-roll_rad if lens.is_mirrored else roll_rad,
            focal_stddev=now.focal_stddev,
            views=float(np.prod(self._sides) / np.prod(self._turned.size)),
        )

    def images(self, topic: str | None = None) -> Iterator[RecordedImage]:
        """Yield images turned back; those whose rotation is not known show the background alone."""
        for image in self._bag.images(topic or self._bag.image_topic()):
            yield replace(image, _decode=partial(self._decode, image))

    def detected(
        self, detect: Callable[[Image], list[Detection]], stamp_ns: int, image: Image
    ) -> list[Detection]:
        """Return whom ``detect`` finds in a small turned image, which it sees as it was recorded.

        Away from the axis of the first view, turned images stretch people as networks have seen
        none. In an image whose rotation is not known there is nobody.
        """
        if stamp_ns not in self._turned.found.rotations:
            return []
        there: Size = (image.shape[1], image.shape[0])
        across, down = np.divide(there, self._sides)
        scale = np.array([(across, 0, (across - 1) / 2), (0, down, (down - 1) / 2), (0, 0, 1)])
        matrix = scale @ self._matrix(stamp_ns, self._turned.size)
        back = cv2.WARP_INVERSE_MAP | cv2.INTER_LINEAR
        seen = np.asarray(cv2.warpPerspective(image, matrix, self._turned.size, flags=back))
        return [
            one._replace(
                points_px=cv2.perspectiveTransform(one.points_px[None], matrix)[0],
                mask=np.asarray(cv2.warpPerspective(one.mask, matrix, there), np.uint8),
            )
            for one in detect(seen.astype(np.uint8))
        ]

    def unseen(self, stamp_ns: int) -> Image:
        """Return the pixels (H, W) of a small turned image, 255 where the camera did not look."""
        seen = np.full(self._turned.size[::-1], 255, np.uint8)
        matrix = self._matrix(stamp_ns, self._turned.size)
        return np.asarray(255 - cv2.warpPerspective(seen, matrix, self._sides), np.uint8)

    def _decode(self, image: RecordedImage) -> Image:
        sent = image.as_sent
        size = self._lens.level_size(sent.shape[1], sent.shape[0])
        drawn = np.array(self._room(self._canvas(size)), np.uint8)
        rectifier = self._rectifier(*size)
        level = sent if rectifier is None else rectifier(sent)
        matrix, border = self._matrix(image.stamp_ns, size), cv2.BORDER_TRANSPARENT
        cv2.warpPerspective(level, matrix, self._canvas(size), dst=drawn, borderMode=border)
        return drawn

    def _canvas(self, size: Size) -> Size:
        """Return width and height of turned images, px, for level images of a size."""
        # Videos need even sides.
        wide, high = 2 * np.rint(np.divide(size, self._turned.size) * self._sides / 2).astype(int)
        return int(wide), int(high)

    def _matrix(self, stamp_ns: int, size: Size) -> FloatArray:
        """Return the matrix (3, 3) from level to turned pixels of an image."""
        k = self._lens.camera(*size).k
        there = k.copy()
        there[:2, 2] -= self._turned.corner_px(size)
        turn = self._turned.found.rotations.get(stamp_ns)
        if turn is None:
            # Beside all that is drawn.
            there[0, 2] -= 1e6
            turn = np.eye(3)
        return np.asarray(there @ turn.T @ np.linalg.inv(k))
