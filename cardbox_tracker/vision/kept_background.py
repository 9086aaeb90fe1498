"""A background of before, from a file or from memory, until an image shows that it fits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.errors import BackgroundFileError
from cardbox_tracker.vision.background_file import (
    StoredBackground,
    load_background,
    save_background,
)
from cardbox_tracker.vision.empty_scene import BackgroundModel, brightness_of
from cardbox_tracker.vision.scene_fit import compare_scene
from cardbox_tracker.vision.silhouettes import SilhouettePipeline

ImageArray = NDArray[np.uint8]


class KeptBackground:
    """What a pipeline may go on with instead of learning, and where what it learns is written.

    Attributes:
        path: the file; None without one.
    """

    def __init__(self, path: Path | None, size: tuple[int, int]) -> None:
        """Read the file ``path`` if there is one; ``size`` is the working size, px.

        Raises:
            BackgroundFileError: it is no background of that size.
        """
        self.path = path
        self._stored: StoredBackground | None = None
        self._before: BackgroundModel | None = None
        if path is not None and path.exists():
            self._stored = load_background(path, size)

    def carry_over(self, model: BackgroundModel | None) -> None:
        """Offer a background of before the calibration changed, and no longer the file's."""
        if model is not None:
            self._stored, self._before = None, model

    def forget(self) -> None:
        """Offer nothing any more: the scene is learned anew."""
        self._stored = self._before = None

    def resume(self, pipeline: SilhouettePipeline, image: ImageArray) -> str:
        """Let ``pipeline`` go on with the background of before if a prepared image shows it fits.

        Returns:
            What was done, for the log; an empty text if the scene has to be learned.

        Raises:
            BackgroundFileError: what is in the file does not fit; the text says why.
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
        self._stored = None

    def keep(self, pipeline: SilhouettePipeline) -> str:
        """Write what ``pipeline`` has learned to the file; return what was done, for the log.

        Raises:
            BackgroundFileError: the file cannot be written.
        """
        model = pipeline.model
        if self.path is None or model is None:
            return ""
        save_background(StoredBackground(model, pipeline.calibration), self.path)
        return f"; saved to {self.path}"
