"""Degrades exact silhouettes as background subtraction and person detectors do.

Each recording draws its faults once; what they do to an image then varies slowly over time, as in
real recordings.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.uint8]

_ON = 255
# Time constants of the outline's noise and of a hole, s.
_NOISE_S, _HOLE_S = 1.1, 0.32
# Blur as a multiple of the outline's noise, and largest change of a blurred mask.
_WIDE, _MOST = 2.0, np.float32(0.45)


@dataclass(frozen=True)
class Faults:
    """Faults of the silhouettes of one recording; lengths are shares of the image's height.

    Attributes:
        rounding: radius of the rounding, as masks of small networks have it.
        growth: how far the outline is outside of the true one; negative inside.
        raggedness: standard deviation of the outline's noise.
        holes: mean number of holes in an image.
        hole: radius of a hole.
        shadow: extent of a strip of shadow beside the person; 0 without.
        chair: height of the back of a chair that is taken for the person; 0 without.
        specks: mean number of foreign specks in an image.
        missing: chance that an image has no silhouette.
    """

    rounding: float = 0.0
    growth: float = 0.0
    raggedness: float = 0.0
    holes: float = 0.0
    hole: float = 0.02
    shadow: float = 0.0
    chair: float = 0.0
    specks: float = 0.0
    missing: float = 0.0


def draw_faults(rng: np.random.Generator) -> Faults:
    """Draw the faults of a recording: from nearly clean to poor."""
    if rng.random() < 0.25:
        return Faults(raggedness=rng.uniform(0.0, 0.003))
    is_detector = rng.random() < 0.4
    return Faults(
        rounding=rng.uniform(0.008, 0.03) if is_detector else rng.uniform(0.0, 0.006),
        growth=rng.normal(0.0, 0.006 if is_detector else 0.003),
        raggedness=rng.uniform(0.0, 0.006),
        holes=0.0 if is_detector else rng.choice([0.0, 0.0, 0.3, 1.5]),
        hole=rng.uniform(0.01, 0.04),
        shadow=rng.uniform(0.0, 0.12) if rng.random() < 0.2 else 0.0,
        chair=rng.uniform(0.1, 0.3) if rng.random() < 0.1 else 0.0,
        specks=rng.choice([0.0, 0.0, 0.5]),
        missing=rng.choice([0.0, 0.0, 0.01]),
    )


class Degrader:
    """Applies :class:`Faults` to the silhouettes of a recording, in order."""

    def __init__(self, faults: Faults, rng: np.random.Generator, fps: float = 30.0) -> None:
        """Begin a recording of ``fps`` images per second; all noise comes from ``rng``."""
        self._noise_kept, self._hole_kept = np.exp(-1.0 / (fps * np.array([_NOISE_S, _HOLE_S])))
        self._faults, self._rng = faults, rng
        self._coarse: NDArray[np.float32] | None = None
        count = rng.poisson(faults.holes) if faults.holes else 0
        self._hole_places = [(rng.random(), rng.random()) for _ in range(count)]
        self._side = rng.choice([-1.0, 1.0])

    def __call__(self, mask: NDArray[np.bool_]) -> Mask | None:
        """Return the degraded silhouette (H, W), 0 or 255; None if the image has none."""
        faults, rng = self._faults, self._rng
        if rng.random() < faults.missing:
            return None
        height = len(mask)
        seen = np.where(mask, np.float32(1.0), np.float32(0.0))
        seen = self._with_shadow(seen)
        seen = self._with_chair(seen)
        seen = self._with_holes(seen)
        threshold = 0.5
        blur = max(faults.rounding, _WIDE * faults.raggedness, _WIDE * abs(faults.growth)) * height
        if blur > 0.05:
            seen = np.asarray(cv2.GaussianBlur(seen, (0, 0), blur), np.float32)
            # Near a straight edge the blurred step has this slope.
            slope = 1.0 / (blur * np.sqrt(2.0 * np.pi))
            noise = self._noise(mask.shape) * faults.raggedness
            moved = np.float32(slope * height) * (noise + np.float32(faults.growth))
            # Far from the outline nothing changes.
            seen = seen + np.clip(moved, -_MOST, _MOST)
        result = np.where(seen > threshold, _ON, 0).astype(np.uint8)
        for _ in range(rng.poisson(faults.specks)):
            place = int(rng.integers(0, mask.shape[1])), int(rng.integers(0, height))
            cv2.circle(result, place, int(rng.integers(1, 5)), _ON, -1)
        return result

    def _noise(self, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """Return noise (H, W) of unit deviation that is smooth in space and slow in time."""
        small = shape[0] // 12 + 2, shape[1] // 12 + 2
        fresh = self._rng.standard_normal(small, dtype=np.float32)
        if self._coarse is None:
            self._coarse = fresh
        else:
            kept = np.float32(self._noise_kept)
            self._coarse = kept * self._coarse + np.sqrt(1 - kept * kept) * fresh
        size = (shape[1], shape[0])
        return np.asarray(cv2.resize(self._coarse, size, interpolation=cv2.INTER_CUBIC), np.float32)

    def _with_shadow(self, seen: NDArray[np.float32]) -> NDArray[np.float32]:
        if self._faults.shadow == 0.0:
            return seen
        moved = self._side * self._faults.shadow * len(seen)
        move = np.array([(1.0, 0.0, moved), (0.0, 1.0, 0.3 * abs(moved))])
        size = (seen.shape[1], seen.shape[0])
        cast = cv2.warpAffine(seen, move, size)
        # The light fades the upper part of the shadow.
        first = int(0.5 * len(seen))
        cast[:first] = 0.0
        return np.asarray(np.maximum(seen, cast), np.float32)

    def _with_chair(self, seen: NDArray[np.float32]) -> NDArray[np.float32]:
        if self._faults.chair == 0.0:
            return seen
        columns = np.flatnonzero(seen.any(axis=0))
        if len(columns) == 0:
            return seen
        height = len(seen)
        middle = int(np.median(columns)) + int(self._side * 0.08 * height)
        tall = int(self._faults.chair * height)
        seen = seen.copy()
        cv2.rectangle(
            seen, (middle - tall // 2, height - tall), (middle + tall // 2, height), 1.0, -1
        )
        return seen

    def _with_holes(self, seen: NDArray[np.float32]) -> NDArray[np.float32]:
        if self._faults.holes == 0.0:
            return seen
        rng = self._rng
        # Holes stay for some time, because colours that are like the wall's do.
        self._hole_places = [one for one in self._hole_places if rng.random() < self._hole_kept]
        # As many come as go, so that the mean number remains.
        for _ in range(rng.poisson((1.0 - self._hole_kept) * self._faults.holes)):
            self._hole_places.append((rng.random(), rng.random()))
        rows = np.nonzero(seen)[0]
        if len(rows) == 0:
            return seen
        seen = seen.copy()
        for across, down in self._hole_places:
            row = int(np.quantile(rows, down))
            of_row = np.flatnonzero(seen[row])
            if len(of_row) == 0:
                continue
            column = int(np.quantile(of_row, across))
            radius = max(int(self._faults.hole * len(seen)), 1)
            cv2.circle(seen, (column, row), radius, 0.0, -1)
        return seen
