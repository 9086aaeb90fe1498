"""Silhouettes of a recording from the masks of a person detector, without an empty scene."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.detection.model_files import ModelFiles, installed_models
from cardbox_tracker.detection.pose_network import PoseNetwork
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.silhouettes import WORKING_SIZE, RecordedFrame, SilhouetteSource
from cardbox_tracker.vision.empty_scene import brightness_of

# Least value of the mask inside the person: a chance of one half.
_PERSON = 128


class Detector(NamedTuple):
    """The detector that replaces a background model.

    Attributes:
        models: its network files.
    """

    models: ModelFiles

    @classmethod
    def installed(cls) -> Detector:
        """Return the installed detector.

        Raises:
            CardboxError: it is not installed.
        """
        return cls(installed_models())


class DetectorSilhouetteSource(SilhouetteSource):
    """One camera of a recording whose silhouettes are the masks of a person detector."""

    def __init__(self, bag: BagReader, detector: Detector, camera: str | None = None) -> None:
        """Load the networks and prepare to read.

        Args:
            bag: an open recording.
            detector: the detector.
            camera: namespace of the camera; without it, the recording has only one.

        Raises:
            BagError: the recording has no images.
            CameraError: the recording's camera is not calibrated.
            CardboxError: the networks cannot be loaded.
        """
        self._open(bag, WORKING_SIZE, camera)
        self._network = PoseNetwork(*detector.models)
        self._missed = 0

    def frames(self, start_s: float = 0.0, end_s: float = float("inf")) -> Iterator[RecordedFrame]:
        """Yield every image from ``start_s`` to ``end_s``, in order, with the person's mask.

        The detector starts anew at ``start_s``, so that a frame depends on the span alone.
        """
        self._network.forget()
        self._missed = 0
        for stamp_ns, time_s, image in self._images():
            if time_s > end_s:
                break
            if time_s < start_s:
                continue
            found = self._network(_as_color(image))
            silhouette = np.zeros(image.shape[:2], np.uint8)
            if found is None:
                self._missed += 1
            else:
                silhouette[found.mask >= _PERSON] = 255
            yield RecordedFrame(stamp_ns, time_s, brightness_of(image), silhouette, image)

    @property
    def remarks(self) -> list[str]:
        """Oddities of the images that were read."""
        if not self._missed:
            return super().remarks
        return [*super().remarks, f"the detector finds nobody in {self._missed} images"]


def _as_color(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return an image, (H, W) or (H, W, 3), with three channels."""
    return image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
