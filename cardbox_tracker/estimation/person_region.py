"""The tracked person's part of a silhouette, when other things move in the room.

Doors, chairs, swinging lamps and passers-by are foreground, too. Of the connected regions of a
silhouette, the person's are those where the last posture predicts them, and a hand that was the
person's in the frame before. Where something else touches the person in the image, every pixel of
the common region stays what the nearest one was in the frame before; before a thing that has come
to rest the image tells the person from it. Nothing counts that the person cannot reach. Without a
last posture, or after a poor one, the person is where a head above shoulders fits best.

All but the regions is found on a coarse grid, and only in frames that have more than one region
or more foreground than a person.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.compiling import njit
from cardbox_tracker.estimation.person_figure import Figure, FigureDrawer, Mask
from cardbox_tracker.estimation.still_things import CHANGED, SAME, THING, StillThings
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.regions import Regions, find_regions

# How far a part may be from the last posture: of a hand, the way in a frame at 3 m/s and 15 Hz.
_NEAR_M = 0.2
# The same where no posture is known: arms may be anywhere beside the trunk.
_NEAR_START_M = 0.3
# How far something that touches the person moves from frame to frame.
_STEP_M = 0.1
# A region is near the last posture, or something else, if this share of it is.
_SHARE = 0.5
# Cells in which regions touch that count as one.
_FEWEST_CELLS = 3
# More foreground than this share of all that can be reached: the light has changed.
_FULL = 0.8
# More foreground than so many models, legs and all: something else may touch the person.
_LARGE = 1.5
# How much better a head above shoulders fits elsewhere before a poor estimate is left for it.
_BETTER = 0.2
# What something that was not the person has to reach to become it.
_HEAD_AND_SHOULDERS = 0.5
# A metre away from where the person was measured weighs so much.
_PER_METRE = 0.1
# A hand with a forearm, m²: so much belongs to the person also where the rest of the arm is not
# seen, if it was the person's in the frame before.
_HAND_M2 = 0.04
# Bits of what is in a cell.
_CORE, _NEAR, _BEFORE, _OTHER, _STILL = 1, 2, 4, 8, 16
_BITS = 5
_BORDER = cv2.BORDER_REPLICATE


class PersonRegion:
    """Follows which part of the silhouette is the person."""

    def __init__(self, body: BodyModel, camera: Camera) -> None:
        """Prepare for one body before one camera, pitched as it stands."""
        self._drawer = FigureDrawer(body, camera)
        self._start = self._drawer.figure(self._drawer.front, _NEAR_START_M)
        self._kernels, self._anchor = self._drawer.head_and_shoulders()
        per_m = self._drawer.cells_per_m
        self._cell_px = cell = self._drawer.cell_px
        self._hand_px = _HAND_M2 * (cell * per_m) ** 2
        self._step = max(1.0, _STEP_M * per_m)
        wide = 2 * max(1, round(_NEAR_M * per_m)) + 1
        self._around = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (wide, wide))
        self._large_px = _LARGE * cell**2 * np.count_nonzero(self._start.core)
        # Cells that were the person's in the frame before, and those that were something else.
        self._person: Mask = np.zeros(self._drawer.shape, np.uint8)
        self._other: Mask | None = None
        self._things = StillThings()

    def select(
        self,
        silhouette: Mask,
        posture: FloatArray | None,
        is_sure: bool,
        image: NDArray[np.uint8] | None = None,
    ) -> Mask:
        """Return the person's part of a silhouette; the same array if that is all of it.

        Args:
            silhouette: (H, W), 0 or 255, of the camera's size.
            posture: of the frame before, (12,) or with ``torso_x`` and ``torso_z`` (14,); None
                where tracking starts.
            is_sure: that it fitted.
            image: (H, W) grey or (H, W, 3) bgr of the same frame; without it, what is before a
                still thing is the person only near the last posture.
        """
        regions = find_regions(silhouette)
        seen = _cells(silhouette, self._cell_px)
        is_large = regions.areas_px.sum() > self._large_px
        if len(regions.areas_px) <= 1 and self._other is None and not is_large:
            self._person = seen
            return silhouette
        figure = None if posture is None else self._drawer.figure(posture, _NEAR_M)
        fit = None
        if figure is None or not is_sure:
            figure, fit = self._search(seen, figure)
        same = None if image is None else self._things.compare(image) == SAME
        kept = self._kept(regions, figure, fit, same)
        if kept.all() and self._other is None and not is_large:
            self._person = seen
            return silhouette
        selected = np.zeros_like(silhouette)
        _paint(*regions[:4], kept, selected)
        self._part(selected, seen, figure, image)
        if self._other is None:
            self._things.forget()
        elif image is not None:
            things = self._pixels(self._other, silhouette.shape) & silhouette
            self._things.learn(image, things * np.uint8(THING))
        return selected

    def _kept(
        self,
        regions: Regions,
        figure: Figure,
        fit: float | None,
        same: NDArray[np.bool_] | None,
    ) -> NDArray[np.bool_]:
        """Return which regions are the person's.

        Args:
            regions: those of the silhouette.
            figure: where the person is expected.
            fit: of head and shoulders, where they were searched.
            same: pixels (H, W) of things that stand still.
        """
        before = np.asarray(cv2.dilate(self._person, self._around), np.uint8) & figure.reach
        other = np.zeros_like(before) if self._other is None else self._other
        near = figure.near & (1 - other)
        codes = _CORE * figure.core + _NEAR * near + _BEFORE * before + _OTHER * other
        if same is not None:
            codes = codes + _STILL * _cells(same.view(np.uint8), self._cell_px)
        areas_px = np.zeros((_BITS, len(regions.areas_px)))
        _overlaps(*regions[:4], codes.astype(np.uint8), self._cell_px, areas_px)
        core_px, near_px, before_px, other_px, still_px = areas_px
        half_px, free_px = _SHARE * regions.areas_px, regions.areas_px - other_px
        # Of a region that grew together with another thing, the rest decides.
        fewest_px = np.minimum(_FEWEST_CELLS * self._cell_px**2, regions.areas_px)
        is_near = (free_px >= fewest_px) & (near_px >= _SHARE * free_px)
        is_hand = (regions.areas_px < self._hand_px) & (before_px >= half_px) & (other_px < half_px)
        kept: NDArray[np.bool_] = is_near | is_hand
        if len(kept):
            main = int(np.argmax(core_px))
            kept[main] |= bool(core_px[main] >= fewest_px[main])
        if fit is not None:
            # What was something else becomes the person only if it looks like one and moves.
            is_thing = (still_px >= half_px) | (fit < _HEAD_AND_SHOULDERS)
            kept &= ~(is_thing & (other_px >= half_px))
        return kept

    def _part(
        self, selected: Mask, seen: Mask, figure: Figure, image: NDArray[np.uint8] | None
    ) -> None:
        """Take from the person's regions what only touches the person; remember all of that."""
        kept = _cells(selected, self._cell_px)
        other = np.zeros_like(kept)
        if self._other is not None and np.count_nonzero(kept & self._other) >= _FEWEST_CELLS:
            from_other = _distance(self._other)
            nearer = (from_other < _distance(self._person)) & (from_other <= self._step)
            other[(kept > 0) & nearer] = 1
        beyond = kept & (1 - figure.reach)
        full = np.count_nonzero(kept & figure.reach) >= _FULL * np.count_nonzero(figure.reach)
        if not full and np.count_nonzero(beyond) >= _FEWEST_CELLS:
            other |= beyond
        if other.any():
            mine = self._pixels(figure.band, selected.shape) > 0
            if image is not None:
                compared = self._things.compare(image)
                mine |= (compared == CHANGED) & (self._pixels(figure.reach, selected.shape) > 0)
                mine &= compared != SAME
            selected[(self._pixels(other, selected.shape) > 0) & ~mine] = 0
        self._person = kept & (1 - other)
        others = other | (seen & (1 - kept))
        self._other = others if others.any() else None

    def _pixels(self, cells: Mask, shape: tuple[int, ...]) -> Mask:
        """Return cells, 0 or 1, as pixels of a silhouette's ``shape``."""
        pixels = np.repeat(np.repeat(cells, self._cell_px, axis=0), self._cell_px, axis=1)
        return pixels[: shape[0], : shape[1]]

    def _search(self, seen: Mask, last: Figure | None) -> tuple[Figure, float]:
        """Return where head and shoulders fit best, and how well, -1 to 1.

        It is where the ``last`` figure was unless another place is better.
        """
        image = seen.astype(np.float32)
        # What touches the border goes on behind it.
        head, trunk = (
            cv2.filter2D(image, cv2.CV_32F, k, anchor=self._anchor, borderType=_BORDER)
            for k in self._kernels
        )
        per_m, (hip_column, hip_row) = self._drawer.cells_per_m, self._start.hip
        rows, columns = (np.arange(length, dtype=np.float32) for length in image.shape)
        moved = np.hypot(rows[:, None] - hip_row, columns - hip_column)
        fits = np.minimum(head, trunk) - np.float32(_PER_METRE / per_m) * moved
        row, column = np.unravel_index(int(np.argmax(fits)), fits.shape)
        best = float(fits[row, column])
        if last is not None and best < float(np.where(last.near > 0, fits, -1.0).max()) + _BETTER:
            return last, best
        place = self._drawer.front.copy()
        place[0] += (float(column) - hip_column) / per_m
        place[-1] -= (float(row) - self._anchor[1]) / per_m
        return self._drawer.figure(place, _NEAR_START_M), best


def warm_up() -> None:
    """Compile everything, so that no live image waits for the compiler."""
    silhouette = np.full((2, 8), 255, np.uint8)
    regions = find_regions(silhouette)
    _overlaps(*regions[:4], np.zeros((2, 8), np.uint8), 1, np.zeros((_BITS, 1)))
    _paint(*regions[:4], np.ones(1, np.bool_), silhouette)
    things = StillThings()
    things.learn(silhouette, silhouette)
    things.compare(silhouette)


def _cells(image: Mask, cell_px: int) -> Mask:
    """Return 0 or 1 for each cell: its middle, or its corner where the size is not in cells."""
    offset = 0 if any(length % cell_px for length in image.shape) else cell_px // 2
    cells: Mask = image[offset::cell_px, offset::cell_px] & np.uint8(1)
    return cells


def _distance(mask: Mask) -> FloatArray:
    """Cells from each cell to the nearest one of ``mask``."""
    if not mask.any():
        return np.full(mask.shape, np.inf)
    return np.asarray(cv2.distanceTransform(1 - mask, cv2.DIST_L2, 3), np.float64)


@njit(cache=True, nogil=True)
def _overlaps(
    rows: Any, starts: Any, ends: Any, labels: Any, codes: Any, cell_px: Any, areas_px: Any
) -> None:
    """Count the pixels of each region with each of the bits of the cells' codes, (5, m)."""
    for run in range(len(rows)):
        label = labels[run]
        row = codes[rows[run] // cell_px]
        for u in range(starts[run], ends[run]):
            code = row[u // cell_px]
            for bit in range(_BITS):
                areas_px[bit, label] += (code >> bit) & 1


@njit(cache=True, nogil=True)
def _paint(rows: Any, starts: Any, ends: Any, labels: Any, kept: Any, image: Any) -> None:
    """Turn the pixels of the regions that are kept to 255."""
    for run in range(len(rows)):
        if kept[labels[run]]:
            image[rows[run], starts[run] : ends[run]] = 255
