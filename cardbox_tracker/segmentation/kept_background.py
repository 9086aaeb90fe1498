"""Keeps a saved or earlier background until an image shows that it fits the scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.encodings import brightness_of
from cardbox_tracker.common.errors import BackgroundFileError
from cardbox_tracker.segmentation.background_file import (
    StoredBackground,
    load_background,
    save_background,
)
from cardbox_tracker.segmentation.empty_scene import BackgroundModel
from cardbox_tracker.segmentation.scene_fit import compare_scene
from cardbox_tracker.segmentation.silhouettes import SilhouettePipeline

ImageArray = NDArray[np.uint8]


class KeptBackground:
    """A background that a pipeline may resume instead of learning, and the file to save it in.

    Attributes:
        path: the file; None if there is none.
        use: what was done with the file, in words.
    """

    def __init__(self, path: Path | None, size: tuple[int, int]) -> None:
        """Read the file ``path`` if there is one; ``size`` is the working size, px.

        Raises:
            BackgroundFileError: the file contains no background of that size.
        """
        self.path = path
        self._stored: StoredBackground | None = None
        self._before: BackgroundModel | None = None
        self.use = "not there yet"
        if path is not None and path.exists():
            self._stored = load_background(path, size)
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

        Returns:
            A text for the log; empty if the scene has to be learned.

        Raises:
            BackgroundFileError: the background in the file does not fit; the text gives the reason.
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
        """Save the background of ``pipeline`` to the file; return a text for the log.

        Raises:
            BackgroundFileError: the file cannot be written.
        """
        model = pipeline.model
        if self.path is None or model is None:
            return ""
        save_background(StoredBackground(model, pipeline.calibration), self.path)
        self.use = "written"
        return f"; saved to {self.path}"
