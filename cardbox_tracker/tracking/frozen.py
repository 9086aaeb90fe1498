"""Detection of a camera that shows the same image again and again while the others go on.

Sensors are noisy, so equal images come from a driver or a network that repeats the last one. They
do no harm while the person stands still, and none if every second image is a repetition.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.tracking.observation import Observation

# Repetitions that count, and those that do so although the other silhouettes hardly changed.
_LEAST, _SURE = 2, 15
# Change of another camera's silhouette since the first of the equal images, as a share of its area.
_MOVED = 0.08


class FrozenCameras:
    """Compares each camera's images with those before.

    Attributes:
        left_out: number of images of each camera that were not used.
    """

    def __init__(self, count: int) -> None:
        """Begin without images of ``count`` cameras."""
        self.left_out = [0] * count
        self._last: list[NDArray[Any] | None] = [None] * count
        self._repeated = [0] * count
        # The silhouettes of all cameras when each one's last image was new.
        self._then: list[list[NDArray[Any] | None]] = [[None] * count for _ in range(count)]

    def without(self, observations: Sequence[Observation | None]) -> list[Observation | None]:
        """Return the observations of one time, None in place of those of frozen cameras."""
        count = len(self.left_out)
        seen = [*observations, *[None] * (count - len(observations))]
        now = [None if one is None else one.silhouette for one in seen]
        kept = [None if mask is None else np.array(mask) for mask in now]
        for number, one in enumerate(seen):
            mask = now[number]
            shown = None if one is None else one.image
            if shown is None and mask is not None and mask.any():
                # Without an image, only a person shows that a camera goes on.
                shown = mask
            if shown is None:
                self._repeated[number] = 0
                continue
            last = self._last[number]
            if last is not None and np.array_equal(last, shown):
                self._repeated[number] += 1
                continue
            self._last[number], self._repeated[number] = np.array(shown), 0
            self._then[number] = kept
        frozen = [self._is_frozen(number, kept) for number in range(count)]
        self.left_out = [n + is_out for n, is_out in zip(self.left_out, frozen, strict=True)]
        return [None if is_out else one for one, is_out in zip(seen, frozen, strict=True)]

    def _is_frozen(self, number: int, now: Sequence[NDArray[Any] | None]) -> bool:
        if self._repeated[number] < _LEAST:
            return False
        moved = max(
            _change(before, there)
            for other, (before, there) in enumerate(zip(self._then[number], now, strict=True))
            if other != number
        )
        return moved > (0.0 if self._repeated[number] >= _SURE else _MOVED)

    def remarks(self) -> list[str]:
        """Return a warning for each camera that was frozen."""
        return [
            f"camera {number} of {len(self.left_out)} shows the same image again and again while "
            f"the others go on: {count} of its images are not used. Is its driver or its "
            "connection stuck?"
            for number, count in enumerate(self.left_out, 1)
            if count
        ]


def _change(before: NDArray[Any] | None, now: NDArray[Any] | None) -> float:
    """Return the share of a silhouette that changed; 0 if one is missing."""
    if before is None or now is None or before.shape != now.shape:
        return 0.0
    changed, area = np.count_nonzero(before != now), np.count_nonzero(before)
    return float(changed) / max(float(area), 1.0)
