"""Checks whether an image shows the learned scene from the same place, in any light.

The learned scene is divided into tiles. Each tile with texture is searched around its place in the
image by normalised correlation, which is invariant to the level of the light. A person hides some
tiles; a moved camera shifts all of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.segmentation.empty_scene import BackgroundModel

ImageArray = NDArray[np.uint8]
FloatImage = NDArray[np.float32]

# Tiles along the width, and the search radius as a share of a tile's size.
_TILES = 8
_REACH = 0.25
# A tile has texture if the deviation of its grey levels exceeds this multiple of the noise.
_TEXTURE, _LEAST_TEXTURE = 1.5, 3.0
# Smallest correlation of a found tile, and the gain that a shifted place needs.
_FOUND, _BETTER = 0.6, 0.05
# Smaller shifts are ignored, px.
_SAME_PX = 1
# Share of the tiles that must be found in place, and least number of tiles for a decision.
_ENOUGH, _FEWEST = 0.3, 4
# Without texture: share of the image that may look different, and the difference that counts, in
# grey levels and relative to the expected brightness.
_MOST_CHANGED = 0.4
_LEAST_CHANGE, _CHANGE = 6.0, 0.12
_DARKEST = 8.0


@dataclass(frozen=True)
class SceneFit:
    """Result of the comparison of an image with the learned scene.

    Attributes:
        tiles: number of tiles that have texture.
        in_place: number of tiles found where they were learned.
        shifted: number of tiles found elsewhere.
        shift_px: median shift (right, down) of the shifted tiles, px.
        changed: share of the pixels that look different, after correction for the light.
    """

    tiles: int
    in_place: int
    shifted: int
    shift_px: tuple[int, int]
    changed: float

    @property
    def is_moved(self) -> bool:
        """Whether the camera was moved since the scene was learned."""
        return self.shifted > max(self.in_place, _FEWEST - 1)

    @property
    def is_same(self) -> bool:
        """Whether the image shows the learned scene, with or without a person."""
        if self.tiles < _FEWEST:
            return self.changed <= _MOST_CHANGED
        return not self.is_moved and self.in_place >= _ENOUGH * self.tiles

    def __str__(self) -> str:
        """Return a description of the result, for messages."""
        if self.is_moved:
            right, down = self.shift_px
            return f"the camera was moved: the scene is shifted by about ({right}, {down}) px"
        if self.tiles < _FEWEST:
            return f"{100 * self.changed:.0f} % of the image looks different"
        return f"{self.in_place} of {self.tiles} places of the scene are found in the image"


def compare_scene(model: BackgroundModel, brightness: ImageArray) -> SceneFit:
    """Compare the brightness (H, W) of an image with the learned scene of the same size."""
    height, width = brightness.shape
    size = max(width // _TILES, 8)
    reach = max(int(_REACH * size), 2)
    image = brightness.astype(np.float32)
    shifts: list[tuple[int, int]] = []
    tiles = in_place = 0
    for top in range(0, height - size + 1, size):
        for left in range(0, width - size + 1, size):
            rows, columns = slice(top, top + size), slice(left, left + size)
            tile = np.ascontiguousarray(model.mean[rows, columns])
            noise = float(np.median(model.stddev[rows, columns]))
            if float(tile.std()) < max(_TEXTURE * noise, _LEAST_TEXTURE):
                continue
            tiles += 1
            shift = _find(tile, image, top, left, reach)
            if shift is None:
                continue
            if max(map(abs, shift)) <= _SAME_PX:
                in_place += 1
            else:
                shifts.append(shift)
    middle = np.median(shifts, axis=0) if shifts else np.zeros(2)
    level = np.float32(np.median(image / np.maximum(model.mean, _DARKEST)))
    expected = level * model.mean
    limit = np.maximum(_LEAST_CHANGE, _CHANGE * expected)
    changed = float(np.mean(np.abs(cv2.blur(image, (3, 3)) - expected) > limit))
    return SceneFit(tiles, in_place, len(shifts), (int(middle[0]), int(middle[1])), changed)


def _find(
    tile: FloatImage, image: FloatImage, top: int, left: int, reach: int
) -> tuple[int, int] | None:
    """Return the shift (right, down) of a tile, px; None if it was not found."""
    up, back = min(top, reach), min(left, reach)
    height, width = tile.shape
    around = image[top - up : top + height + reach, left - back : left + width + reach]
    scores = cv2.matchTemplate(np.ascontiguousarray(around), tile, cv2.TM_CCOEFF_NORMED)
    best_v, best_u = np.unravel_index(int(np.argmax(scores)), scores.shape)
    best = float(scores[best_v, best_u])
    if best < _FOUND:
        return None
    # Many places along an edge correlate equally well.
    if float(scores[up, back]) >= best - _BETTER:
        return 0, 0
    return int(best_u) - back, int(best_v) - up
