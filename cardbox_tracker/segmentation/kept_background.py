"""Keeps a saved or earlier background until an image shows that it fits the scene."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.encodings import brightness_of
from cardbox_tracker.common.errors import BackgroundFileError
from cardbox_tracker.segmentation.background import LEAST_STDDEV
from cardbox_tracker.segmentation.background_config import BackgroundConfig
from cardbox_tracker.segmentation.background_file import (
    StoredBackground,
    load_background,
    save_background,
)
from cardbox_tracker.segmentation.chroma import DARKEST
from cardbox_tracker.segmentation.empty_scene import BackgroundModel
from cardbox_tracker.segmentation.silhouettes import SilhouettePipeline

ImageArray = NDArray[np.uint8]
FloatImage = NDArray[np.float32]

# Tiles along the width, and the search radius as a share of a tile's size.
_TILES = 8
_REACH = 0.25
# Smallest correlation of a found tile, and the gain that a shifted place needs.
_FOUND, _BETTER = 0.6, 0.05
# Smaller shifts are ignored, px.
_SAME_PX = 1
# Share of the tiles that must be found in place, and least number of tiles for a decision.
_ENOUGH, _FEWEST = 0.3, 4
# Without texture: share of the image that may look different.
_MOST_CHANGED = 0.4
# What differs as much as a person does, in these settings, looks different.
_USUAL = BackgroundConfig()


@dataclass(frozen=True)
class SceneFit:
    """Result of the comparison of an image with the learned scene."""

    tiles: int  #: number of tiles that have texture
    in_place: int  #: number of tiles found where they were learned
    shifted: int  #: number of tiles found elsewhere
    shift_px: tuple[int, int]  #: median shift (right, down) of the shifted tiles, px
    changed: float  #: share of the pixels that look different, after correction for the light

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
            # The deviation of the grey levels of texture exceeds the noise.
            if float(tile.std()) < _USUAL.threshold * max(noise, LEAST_STDDEV):
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
    level = np.float32(np.median(image / np.maximum(model.mean, DARKEST)))
    expected = level * model.mean
    limit = np.maximum(_USUAL.min_contrast, _USUAL.shadow * expected)
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


class KeptBackground:
    """A background that a pipeline may resume instead of learning, and the file to save it in.

    Attributes:
        path: the file; None if there is none.
        use: what was done with the file, in words.
    """

    def __init__(self, path: Path | None, most: tuple[int, int]) -> None:
        """Read the file ``path`` if there is one; ``most`` is that of the pipeline, px."""
        self.path = path
        self._stored: StoredBackground | None = None
        self._before: BackgroundModel | None = None
        self.use = "not there yet"
        if path is not None and path.exists():
            self._stored = load_background(path, most)
            self.use = "not used yet"

    def carry_over(self, model: BackgroundModel | None) -> None:
        """Offer the background that was used before a change of calibration, not the file's."""
        if model is not None:
            self._stored, self._before = None, model

    def forget(self) -> None:
        """Drop the background, since the scene is learned anew."""
        self._stored = self._before = None

    def resume(self, pipeline: SilhouettePipeline, image: ImageArray) -> str:
        """Resume the kept background in ``pipeline`` if it fits a prepared image.

        Returns a text for the log, empty if the scene has to be learned. Raises
        BackgroundFileError, with the reason, if the background in the file does not fit.
        """
        if self._stored is not None:
            self._resume_file(self._stored, pipeline, image)
            return f"background read from {self.path}"
        if self._before is None:
            return ""
        model, self._before = self._before, None
        fit = compare_scene(model, brightness_of(image))
        if not fit.is_same:
            return ""
        pipeline.resume(model, image)
        return "the background is kept: it fits the images of the camera as it is now"

    def _resume_file(
        self, stored: StoredBackground, pipeline: SilhouettePipeline, image: ImageArray
    ) -> None:
        stored.check_camera(pipeline.calibration, str(self.path))
        fit = compare_scene(stored.model, brightness_of(image))
        if not fit.is_same:
            raise BackgroundFileError(
                f"the background in {self.path} is not what the camera shows ({fit}); put the "
                "camera back where it was, or let more of the scene be seen, or call "
                "background/learn with nobody in view, which replaces the file"
            )
        pipeline.resume(stored.model, image)
        self._stored, self.use = None, "used"

    def keep(self, pipeline: SilhouettePipeline) -> str:
        """Save the background of ``pipeline`` to the file; return a text for the log."""
        model = pipeline.model
        if self.path is None or model is None:
            return ""
        save_background(StoredBackground(model, pipeline.calibration), self.path)
        self.use = "written"
        return f"; saved to {self.path}"
