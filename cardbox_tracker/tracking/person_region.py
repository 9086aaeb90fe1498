"""Selection of the tracked person's part of a silhouette.

Doors, chairs, lamps and passers-by are foreground, too. A connected region of the silhouette
belongs to the person if the last posture predicts it, or if it is a hand that belonged to the
person in the previous frame. Where another object touches the person in the image, each pixel of
the common region keeps the class of its nearest pixel in the previous frame; in front of an object
at rest, the image separates person and object. Regions that the person cannot reach are removed.
Without a last posture, or after a poor one, the person is where a head above shoulders fits best.

The classes are found on a coarse grid, and only in frames with several regions or more foreground
than a person has.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.array_checks import check_array
from cardbox_tracker.common.compiling import copied_kernel, kernel
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.pose_filter import FULL
from cardbox_tracker.segmentation.regions import Regions, find_regions, paint
from cardbox_tracker.tracking.person_masks import Mask, PersonDrawer, PersonMasks, grown

ImageArray = NDArray[np.uint8]

# Change of a channel, in grey levels, beyond which a pixel shows something else.
_CHANGE = 18
# Images until a constant pixel is known (0.5 s at 15 Hz), and until a covered one is forgotten
# (10 s at 15 Hz).
_KNOWN, _LONGEST = 8, 150

BACKGROUND, PERSON, THING = 0, 1, 2
"""Class of a pixel by the silhouette."""
UNKNOWN, SAME, CHANGED = 0, 1, 2
"""Result of the comparison of a pixel with the object at rest."""


class StillThings:
    """The pixels of objects at rest; a hand before one, as an open door, has another colour."""

    def __init__(self) -> None:
        """Begin without known objects."""
        self._looks: ImageArray | None = None
        self._counts = np.zeros((0, 0), np.int16)

    def forget(self) -> None:
        """Forget all objects."""
        self._looks = None

    def compare(self, image: ImageArray) -> NDArray[np.uint8]:
        """Return ``UNKNOWN``, ``SAME`` or ``CHANGED`` for each pixel of an image (H, W[, 3])."""
        found = np.zeros(image.shape[:2], np.uint8)
        planes = _planes(image)
        if self._looks is not None and self._looks.shape == planes.shape:
            _compare(planes, self._looks, self._counts, found)
        return found

    def learn(self, image: ImageArray, shows: NDArray[np.uint8]) -> None:
        """Update from an image, of which ``shows`` (H, W) has the class of each pixel."""
        planes = _planes(image)
        check_array("shows", shows, planes.shape[:2])
        if self._looks is None or self._looks.shape != planes.shape:
            self._looks = np.zeros_like(planes)
            self._counts = np.zeros(planes.shape[:2], np.int16)
        _learn(planes, shows, self._looks, self._counts)


def _planes(image: ImageArray) -> ImageArray:
    """Return an image (H, W) or (H, W, 3) as (H, W, channels), copied if it is read-only."""
    # numba would compile another version for read-only arrays.
    pixels = np.require(image, requirements=("C", "W"))
    return pixels[..., None] if pixels.ndim == 2 else pixels


@copied_kernel
def _change(image: Any, looks: Any, v: Any, u: Any) -> Any:
    """Return the largest difference over the channels of a pixel."""
    largest: Any = 0
    for k in range(looks.shape[2]):
        largest = max(largest, abs(np.int32(image[v, u, k]) - np.int32(looks[v, u, k])))
    return largest


@kernel
def _compare(image: Any, looks: Any, counts: Any, found: Any) -> None:
    height, width = counts.shape
    for v in range(height):
        for u in range(width):
            if counts[v, u] >= _KNOWN:
                found[v, u] = CHANGED if _change(image, looks, v, u) > _CHANGE else SAME


@kernel
def _learn(image: Any, shows: Any, looks: Any, counts: Any) -> None:
    height, width = counts.shape
    for v in range(height):
        for u in range(width):
            count = counts[v, u]
            if shows[v, u] != THING:
                if count != 0:
                    counts[v, u] = 0
                continue
            if count > 0 and _change(image, looks, v, u) <= _CHANGE:
                counts[v, u] = min(count + 1, _LONGEST)
                # Slow changes of the light are followed.
                for k in range(looks.shape[2]):
                    now, before = image[v, u, k], looks[v, u, k]
                    looks[v, u, k] = before + np.uint8(now > before) - np.uint8(now < before)
            elif count > _KNOWN:
                # The object is covered.
                counts[v, u] = count - 1
            else:
                counts[v, u] = 1
                for k in range(looks.shape[2]):
                    looks[v, u, k] = image[v, u, k]


# Largest movement of a body part between frames: a hand at 3 m/s and 15 Hz.
_NEAR_M = 0.2
# Largest movement between frames of an object that touches the person.
_STEP_M = 0.1
# A region is near the last posture, or another object, if this share of it is.
_SHARE = 0.5
# Regions touch if they share this number of cells.
_FEWEST_CELLS = 3
# Foreground areas, in body areas, beyond which another object may touch the person.
_LARGE = 1.5
# The person is sought elsewhere only if head and shoulders fit better there by this score.
_BETTER = 0.2
# Least score of head and shoulders at which another object can be the person.
_HEAD_AND_SHOULDERS = 0.5
# Area of a hand with forearm, m². A region of this size can belong to the person while the rest
# of the arm is not visible.
_HAND_M2 = 0.04
_BORDER = cv2.BORDER_REPLICATE


class PersonRegion:
    """Selects the person's part of each silhouette in a sequence."""

    def __init__(self, body: BodyModel, camera: Camera) -> None:
        """Set up for one body and one camera, which includes the pitch."""
        self._size = camera.height, camera.width
        self._drawer = PersonDrawer(body, camera)
        self._start = self._drawer.masks(self._drawer.front, _NEAR_M)
        self._kernels, self._anchor = self._drawer.head_and_shoulders()
        per_m = self._drawer.cells_per_m
        self._cell_px = cell = self._drawer.cell_px
        self._hand_px = _HAND_M2 * (cell * per_m) ** 2
        self._step = max(1.0, _STEP_M * per_m)
        self._around = max(1.0, _NEAR_M * per_m)
        self._large_px = _LARGE * cell**2 * np.count_nonzero(self._start.core)
        # Cells of the person and of other objects in the previous frame.
        self._none: Mask = np.zeros(self._drawer.shape, np.uint8)
        self._person = self._none
        self._other: Mask | None = None
        self._things = StillThings()

    def select(
        self,
        silhouette: Mask,
        posture: FloatArray | None,
        is_sure: bool,
        image: NDArray[np.uint8] | None = None,
    ) -> Mask:
        """Return the person's part of a silhouette (H, W), 0 or 255; itself if nothing is removed.

        ``posture`` is that of the previous frame, (12,) or (14,), or None at the start, and
        ``is_sure`` whether it fitted. Without the ``image`` (H, W) or (H, W, 3), pixels in front of
        an object at rest belong to the person only near the last posture. Raises ValueError if the
        silhouette is not of the camera's size.
        """
        check_array("silhouette", silhouette, self._size)
        regions = find_regions(silhouette)
        seen = _cells(silhouette, self._cell_px)
        is_large = regions.areas_px.sum() > self._large_px
        if len(regions.areas_px) <= 1 and self._other is None and not is_large:
            self._person = seen
            return silhouette
        masks = None if posture is None else self._drawer.masks(posture, _NEAR_M)
        fit = None
        if masks is None or not is_sure:
            masks, fit = self._search(seen, masks)
        same = None if image is None else self._things.compare(image) == SAME
        kept = self._kept(regions, masks, fit, same)
        if kept.all() and self._other is None and not is_large:
            self._person = seen
            return silhouette
        selected = np.zeros_like(silhouette)
        paint(*regions[:4], kept, np.uint8(255), selected)
        self._part(selected, seen, masks, image)
        if self._other is None:
            self._things.forget()
        elif image is not None:
            things = self._pixels(self._other, silhouette.shape) & silhouette
            self._things.learn(image, things * np.uint8(THING))
        return selected

    def _kept(
        self,
        regions: Regions,
        masks: PersonMasks,
        fit: float | None,
        same: NDArray[np.bool_] | None,
    ) -> NDArray[np.bool_]:
        """Return whether each region is the person's; ``fit`` is the score of head and shoulders.

        ``same`` are the pixels (H, W) of objects at rest.
        """
        before = grown(self._person, self._around) & masks.reach
        none = self._none
        other = none if self._other is None else self._other
        still = none if same is None else _cells(same.view(np.uint8), self._cell_px)
        kinds = masks.core, masks.near, before, other, still
        areas_px = np.zeros((len(kinds), len(regions.areas_px)))
        _overlaps(*regions[:4], *kinds, self._cell_px, areas_px)
        core_px, near_px, before_px, other_px, still_px = areas_px
        half_px, free_px = _SHARE * regions.areas_px, regions.areas_px - other_px
        # In a region that merged with another object, only the other pixels count.
        fewest_px = np.minimum(_FEWEST_CELLS * self._cell_px**2, regions.areas_px)
        is_near = (free_px >= fewest_px) & (near_px >= _SHARE * free_px)
        is_hand = (regions.areas_px < self._hand_px) & (before_px >= half_px) & (other_px < half_px)
        kept: NDArray[np.bool_] = is_near | is_hand
        if len(kept):
            main = int(np.argmax(core_px))
            kept[main] |= bool(core_px[main] >= fewest_px[main])
        if fit is not None:
            # Another object becomes the person only if it looks like a person and moves.
            is_thing = (still_px >= half_px) | (fit < _HEAD_AND_SHOULDERS)
            kept &= ~(is_thing & (other_px >= half_px))
        return kept

    def _part(
        self, selected: Mask, seen: Mask, masks: PersonMasks, image: NDArray[np.uint8] | None
    ) -> None:
        """Remove objects that touch the person from ``selected``; store both masks."""
        kept = _cells(selected, self._cell_px)
        other = np.zeros_like(kept)
        if self._other is not None and np.count_nonzero(kept & self._other) >= _FEWEST_CELLS:
            from_other = _distance(self._other)
            nearer = (from_other < _distance(self._person)) & (from_other <= self._step)
            other[(kept > 0) & nearer] = 1
        beyond = kept & (1 - masks.reach)
        # If they are full, the light has changed.
        full = np.count_nonzero(kept & masks.reach) >= FULL * np.count_nonzero(masks.reach)
        if not full and np.count_nonzero(beyond) >= _FEWEST_CELLS:
            other |= beyond
        if other.any():
            mine = self._pixels(masks.band(), selected.shape) > 0
            if image is not None:
                compared = self._things.compare(image)
                mine |= (compared == CHANGED) & (self._pixels(masks.reach, selected.shape) > 0)
                mine &= compared != SAME
            selected[(self._pixels(other, selected.shape) > 0) & ~mine] = 0
        self._person = kept & (1 - other)
        others = other | (seen & (1 - kept))
        self._other = others if others.any() else None

    def _pixels(self, cells: Mask, shape: tuple[int, ...]) -> Mask:
        """Return a mask of cells as a mask of pixels of ``shape``."""
        pixels = np.repeat(np.repeat(cells, self._cell_px, axis=0), self._cell_px, axis=1)
        return pixels[: shape[0], : shape[1]]

    def _search(self, seen: Mask, last: PersonMasks | None) -> tuple[PersonMasks, float]:
        """Return the masks at the best fit of head and shoulders, and its score, -1 to 1.

        ``last`` is returned unless another place fits better by a margin.
        """
        image = seen.astype(np.float32)
        # Regions at the border are assumed to continue outside of the image.
        head, trunk = (
            cv2.filter2D(image, cv2.CV_32F, k, anchor=self._anchor, borderType=_BORDER)
            for k in self._kernels
        )
        per_m, (hip_column, _) = self._drawer.cells_per_m, self._start.hip
        fits = np.minimum(head, trunk)
        row, column = np.unravel_index(int(np.argmax(fits)), fits.shape)
        best = float(fits[row, column])
        if last is not None and best < float(np.where(last.near > 0, fits, -1.0).max()) + _BETTER:
            return last, best
        place = self._drawer.front.copy()
        place[0] += (float(column) - hip_column) / per_m
        place[-1] -= (float(row) - self._anchor[1]) / per_m
        return self._drawer.masks(place, _NEAR_M), best


def warm_up() -> None:
    """Compile all functions before the first live image."""
    silhouette = np.full((2, 8), 255, np.uint8)
    regions = find_regions(silhouette)
    cells = np.zeros((2, 8), np.uint8)
    _overlaps(*regions[:4], cells, cells, cells, cells, cells, 1, np.zeros((5, 1)))
    paint(*regions[:4], np.ones(1, np.bool_), np.uint8(255), silhouette)
    things = StillThings()
    things.learn(silhouette, silhouette)
    things.compare(silhouette)


def _cells(image: Mask, cell_px: int) -> Mask:
    """Return the pixel (0 or 1) in the middle of each cell, or in its corner if cells are cut."""
    offset = 0 if any(length % cell_px for length in image.shape) else cell_px // 2
    cells: Mask = image[offset::cell_px, offset::cell_px] & np.uint8(1)
    return cells


def _distance(mask: Mask) -> FloatArray:
    """Return the distance of each cell to the nearest cell of ``mask``, in cells."""
    if not mask.any():
        return np.full(mask.shape, np.inf)
    return np.asarray(cv2.distanceTransform(1 - mask, cv2.DIST_L2, 3), np.float64)


@kernel
def _overlaps(
    rows: Any,
    starts: Any,
    ends: Any,
    labels: Any,
    core: Any,
    near: Any,
    before: Any,
    other: Any,
    still: Any,
    cell_px: Any,
    areas_px: Any,
) -> None:
    """Count pixels of each region in five masks (h, w), (5, m); ``other`` is not ``near``."""
    for run in range(len(rows)):
        label, v = labels[run], rows[run] // cell_px
        begin, end = starts[run], ends[run]
        in_core, in_near, in_before, in_other, in_still = 0, 0, 0, 0, 0
        for u in range(begin // cell_px, (end - 1) // cell_px + 1):
            count_px = min(end, (u + 1) * cell_px) - max(begin, u * cell_px)
            in_core += count_px * core[v, u]
            in_near += count_px * (near[v, u] & ~other[v, u])
            in_before += count_px * before[v, u]
            in_other += count_px * other[v, u]
            in_still += count_px * still[v, u]
        for kind, count_px in enumerate((in_core, in_near, in_before, in_other, in_still)):
            areas_px[kind, label] += count_px
