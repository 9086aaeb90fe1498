"""Whether a person in an image is the one of the images before: by place, speed and clothes.

Nobody moves faster than a person runs, so a place that is farther away is somebody else's. Who was
away for longer is known by the colours of the trunk alone.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from cardbox_tracker.common.health import Verdict
from cardbox_tracker.detectors.figure import Figure
from cardbox_tracker.person.sizes import FloatArray

ALIKE = 0.6
"""Distance of colours up to which they alone tell that it is the same person; different clothes
have 0.8 to 1, those of one person 0.1 to 0.4."""
GONE_NS = 1_500_000_000
"""Time after which the last place of somebody who was not seen means nothing, ns."""

DROPPED_NS = 300_000_000
"""Time for which somebody whom a detector misses stays where they were, ns."""
KNOWN_IMAGES = 5
"""Images after which the colours of a person are known."""
OTHER = 16.0
"""Sum of squared deviations above which a figure is somebody else, see :func:`unlike`."""

# Deviation of a figure's place, in lengths of the trunk, and its growth a second.
_PLACE, _PLACE_PER_S = 0.5, 2.0
# Deviation of the colours of one person: Bhattacharyya distance of the trunk's histograms.
_COLOURS = 0.3
# Length of a trunk, m; speed of a person who runs, m/s, and error of a place, m.
_TRUNK_M, _RUN_M_PER_S, _ERROR_M = 0.5, 4.0, 0.2
# Weight of an image in the colours.
_LEARN_RATE = 0.1
# Fewest pixels whose colours count, and time without anybody after which whoever comes is new, ns.
_LEAST_PX, _EMPTY_NS = 20, 60_000_000_000


def colours_in(image: NDArray[np.uint8] | None, mask: NDArray[np.uint8]) -> FloatArray | None:
    """Return the histogram of colours, or of brightness, where ``mask`` (H, W) is not 0.

    The image is (H, W) or (H, W, 3), bgr. None without one, or if too few pixels count.
    """
    if image is None or cv2.countNonZero(mask) < _LEAST_PX:
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


def learned(known: FloatArray | None, colours: FloatArray) -> FloatArray:
    """Return the ``known`` colours of a person, if any, moved towards those in another image."""
    before = colours if known is None or len(known) != len(colours) else known
    return (1 - _LEARN_RATE) * before + _LEARN_RATE * colours


def unlike(
    before: Figure | None,
    known: FloatArray | None,
    figure: Figure | None,
    colours: FloatArray | None,
    away_ns: int,
) -> float:
    """Return how far a figure of these colours is from a person: sum of squared deviations.

    The person had the figure ``before``, ``away_ns`` ago, and has ``known`` colours; without any,
    as without images, all agree. A figure in others, or whose trunk is outside of the image, can
    only be the person where they just were: perhaps something is before the trunk.
    """
    other = ALIKE / 2
    if known is not None:
        other = 1.0 if colours is None else apart(known, colours)
    if away_ns > GONE_NS or figure is None or before is None:
        return OTHER * (other / ALIKE) ** 2
    moved, deviation = before.apart(figure), _PLACE + _PLACE_PER_S * away_ns / 1e9
    if other > ALIKE and (moved > _PLACE or away_ns > DROPPED_NS):
        return OTHER
    return (other / _COLOURS) ** 2 + (moved / deviation) ** 2


def cheapest(costs: ArrayLike) -> dict[int, int]:
    """Return the column of each row of ``costs`` (N, M) below ``OTHER``, with the least sum.

    A row without a column counts ``OTHER``.
    """
    from scipy.optimize import linear_sum_assignment

    table = np.atleast_2d(np.minimum(costs, OTHER))
    pairs = zip(*linear_sum_assignment(table), strict=True)
    return {int(row): int(column) for row, column in pairs if table[row, column] < OTHER}


class Identity:
    """The one person who is followed in the images of a camera."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Forget the person; the next one is followed."""
        self._figure: Figure | None = None
        self._colours: FloatArray | None = None
        self._seen_ns = self._anybody_ns = 0
        self._images, self._is_away = 0, False
        self._others = Verdict("other person")

    @property
    def is_doubtful(self) -> bool:
        """Whether the place goes on, but the colours have been others for some images.

        Somebody stands before the person, or the person holds a thing.
        """
        return self._others.holds

    @property
    def is_new(self) -> bool:
        """Whether nobody is followed."""
        return self._figure is None

    @property
    def is_known(self) -> bool:
        """Whether somebody has been followed for long enough to be known again."""
        return self._images >= KNOWN_IMAGES

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

    def is_same(
        self, figure: Figure, colours: FloatArray | None, now_ns: int, is_sure: bool = True
    ) -> bool:
        """Return whether this is the person, by place and trunk ``colours``, or the first one.

        Colours are learned if ``is_sure`` says that the figure is where the person is.
        """
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
        self._others.count(self.is_other(colours))
        if is_sure and colours is not None and not self._others.value:
            self._colours = learned(self._colours, colours)
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
