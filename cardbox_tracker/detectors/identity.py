"""Whether a person in an image is the one of the images before: by place, speed and clothes.

Nobody moves faster than a person runs, so a place that is farther away is somebody else's. Who was
away for longer is known by the colours of the trunk alone.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.detectors.figure import Figure
from cardbox_tracker.person.sizes import FloatArray

ALIKE = 0.6
"""Distance of colours up to which they alone tell that it is the same person; different clothes
have 0.8 to 1, those of one person 0.1 to 0.4."""
GONE_NS = 1_500_000_000
"""Time after which the last place of somebody who was not seen means nothing, ns."""

# Length of a trunk, m; speed of a person who runs, m/s, and error of a place, m.
_TRUNK_M, _RUN_M_PER_S, _ERROR_M = 0.5, 4.0, 0.2
# Weight of an image in the colours, images after which they are known, and those in a row with
# other colours that nothing that is held before the trunk explains for so short a time.
_LEARN_RATE, _KNOWN_IMAGES, _OTHER_IMAGES = 0.1, 5, 3
# Fewest pixels whose colours count, and time without anybody after which whoever comes is new, ns.
_LEAST_PX, _EMPTY_NS = 20, 60_000_000_000


def colours_in(image: NDArray[np.uint8], mask: NDArray[np.uint8]) -> FloatArray | None:
    """Return the histogram of (H, W) or bgr where ``mask`` is not 0; None of too few pixels."""
    if cv2.countNonZero(mask) < _LEAST_PX:
        return None
    left, top, width, height = cv2.boundingRect(mask)
    there = np.s_[top : top + height, left : left + width]
    image, mask = np.ascontiguousarray(image[there]), np.ascontiguousarray(mask[there])
    if image.ndim == 2:
        found = cv2.calcHist([image], [0], mask, [16], [0, 256])
    else:
        lab = cv2.cvtColor(image, cv2.COLOR_BGR2LAB)
        found = cv2.calcHist([lab], [0, 1, 2], mask, [4, 16, 16], [0, 256] * 3)
    histogram: FloatArray = np.asarray(found, np.float64).ravel()
    histogram /= max(float(histogram.sum()), 1.0)
    return histogram


def apart(one: FloatArray, other: FloatArray) -> float:
    """Return the Bhattacharyya distance of two histograms, 0 to 1 (Hellinger)."""
    if len(one) != len(other):
        return 1.0
    return float(np.sqrt(max(1.0 - np.sqrt(one * other).sum(), 0.0)))


class Identity:
    """The one person who is followed in the images of a camera.

    Attributes:
        is_doubtful: whether the place goes on, but the colours have been others for some images, as
            those of somebody who stands before the person, or of a thing that the person holds.
    """

    def __init__(self) -> None:
        """Begin without a person."""
        self.forget()

    def forget(self) -> None:
        """Forget the person; the next one is followed."""
        self._figure: Figure | None = None
        self._colours: FloatArray | None = None
        self._seen_ns = self._anybody_ns = 0
        self._images = self._others = 0
        self._is_away = self.is_doubtful = False

    @property
    def is_new(self) -> bool:
        """Whether nobody is followed."""
        return self._figure is None

    @property
    def is_known(self) -> bool:
        """Whether somebody has been followed for long enough to be known again."""
        return self._images >= _KNOWN_IMAGES

    def is_other(self, colours: FloatArray | None) -> bool:
        """Return whether colours are not those of the person; unknown ones may be."""
        return (
            colours is not None
            and self._colours is not None
            and self.is_known
            and apart(self._colours, colours) > ALIKE
        )

    def lose(self) -> None:
        """Compare the next place with the colours, too, because there are several people."""
        self._is_away = self._is_away or self._figure is not None

    def nobody(self, now_ns: int) -> None:
        """Take notice of an image, at a time, in which nobody is seen."""
        if self._figure is not None and now_ns - self._anybody_ns > _EMPTY_NS:
            self.forget()

    def is_same(self, figure: Figure, colours: FloatArray | None, now_ns: int) -> bool:
        """Return whether this is the person, by place and trunk ``colours``, or the first one."""
        self.nobody(now_ns)
        self._anybody_ns = now_ns
        away_ns = abs(now_ns - self._seen_ns)
        if not np.isfinite(figure.trunk_px):
            # A head or an arm alone tells nothing.
            return not self._is_away
        if self._figure is None or (not self.is_known and away_ns > GONE_NS):
            self.forget()
            self._anybody_ns = now_ns
        elif not self._can_be(figure, colours, away_ns):
            self._is_away = True
            return False
        self._figure, self._seen_ns, self._is_away = figure, now_ns, False
        self._images += 1
        self._others = self._others + 1 if self.is_other(colours) else 0
        self.is_doubtful = self._others >= _OTHER_IMAGES
        if colours is not None and not self._others:
            before = self._colours
            if before is None or len(before) != len(colours):
                before = colours
            self._colours = (1 - _LEARN_RATE) * before + _LEARN_RATE * colours
        return True

    def _can_be(self, figure: Figure, colours: FloatArray | None, away_ns: int) -> bool:
        assert self._figure is not None
        if away_ns > GONE_NS:
            return not self.is_other(colours)
        trunk_px = max(figure.trunk_px, self._figure.trunk_px)
        moved_px = float(np.linalg.norm(figure.middle_px - self._figure.middle_px))
        reach_m = _ERROR_M + _RUN_M_PER_S * away_ns / 1e9
        is_near = moved_px * _TRUNK_M <= reach_m * trunk_px
        return is_near and not (self._is_away and self.is_other(colours))
