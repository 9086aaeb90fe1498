"""Cuts of a film: most of the image changes at once, and no motion of the camera explains it.

Of neighbouring images, reduced to a few pixels, most of the grey values differ, and the middle of
one is found nowhere in the other (normalized cross-correlation, which does not depend on the
light). After a flash or a damaged image, the next one agrees with the one before it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

import cv2
import numpy as np

from cardbox_tracker.camera.encodings import brightness_of
from cardbox_tracker.terms.term import Image

T = TypeVar("T")

# Width and height of the reduced images, and the margins by which the middle may move between
# neighbours: a sixth of the image, more than a quick pan.
_SIZE, _MARGIN = (64, 48), (8, 11)
# Difference of grey values that noise and light rarely reach, and what is most of the image.
_DIFFERS, _MOST = 12, 0.5
# Correlation of images of the same place where most grey values differ, by light or motion; those
# of different places rarely have it.
_ALIKE = 0.6
# Cameras that take turns: images that are judged, the share of them that alternate, the correlation
# of images of one camera in other light, and the share that changes between two of its images.
_TURNS, _MOST_TURNS, _SAME, _STILL = 20, 0.8, 0.9, 0.1


def with_cuts(
    items: Iterable[T], image_of: Callable[[T], Image], turns: Turns | None = None
) -> Iterator[tuple[T, bool]]:
    """Yield items of a film with whether it is cut before their images; one is read in advance.

    The images are (H, W) grey or (H, W, 3) bgr; ``turns`` sees them, too.
    """
    held: tuple[T, Image] | None = None
    before: Image | None = None
    for item in items:
        after = _reduced(image_of(item))
        if turns is not None:
            turns.see(after)
        if held is not None:
            one, now = held
            is_other = before is not None and _is_other(before, now)
            is_cut = is_other and before is not None and _is_other(before, after)
            yield one, is_cut
            before = before if is_other and not is_cut else now
        held = item, after
    if held is not None:
        yield held[0], False


class Turns:
    """Two cameras on one topic that take turns: every second image shows the same, and no other.

    Light that changes from image to image leaves the grey values alike.

    Attributes:
        are_seen: whether the last images show this.
    """

    def __init__(self) -> None:
        """Begin before the first image."""
        self.are_seen = False
        self._last = deque[Image](maxlen=2)
        self._alternate = deque[bool](maxlen=_TURNS)

    def see(self, image: Image) -> bool:
        """Take the next image, (H, W) grey or (H, W, 3) bgr; return whether cameras take turns."""
        now = image if image.shape == _SIZE[::-1] else _reduced(image)
        if len(self._last) == self._last.maxlen:
            again, before = self._last
            is_other = _changed(now, before) > _MOST and _correlation(now, before) < _SAME
            self._alternate.append(is_other and _changed(now, again) < _STILL)
        self._last.append(now)
        self.are_seen = sum(self._alternate) > _MOST_TURNS * _TURNS
        return self.are_seen


def _reduced(image: Image) -> Image:
    reduced = cv2.resize(brightness_of(image), _SIZE, interpolation=cv2.INTER_AREA)
    return np.asarray(reduced, np.uint8)


def _is_other(one: Image, other: Image) -> bool:
    """Return whether two reduced images do not show the same place."""
    if _changed(one, other) <= _MOST:
        return False
    down, across = _MARGIN
    return _correlation(other, one[down:-down, across:-across]) < _ALIKE


def _changed(one: Image, other: Image) -> float:
    return float(np.count_nonzero(cv2.absdiff(one, other) > _DIFFERS)) / one.size


def _correlation(image: Image, part: Image) -> float:
    return float(cv2.matchTemplate(image, part, cv2.TM_CCOEFF_NORMED).max())
