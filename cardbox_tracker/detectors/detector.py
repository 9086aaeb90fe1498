"""The installed detector, which finds the person in image after image of one camera."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.detectors.landmarks import image_points
from cardbox_tracker.detectors.model_files import ModelFiles, installed_models
from cardbox_tracker.detectors.pose_network import Detection, PoseNetwork

Image = NDArray[np.uint8]

MEDIAPIPE = "mediapipe"
"""Name of the detector whose networks ``cardbox detector --install`` installs."""


class Detector(NamedTuple):
    """The installed detector.

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

    def start(self) -> PersonDetector:
        """Return a detector for the images of one camera.

        Raises:
            CardboxError: the networks cannot be loaded.
        """
        return PersonDetector(PoseNetwork(*self.models))


class PersonDetector:
    """Finds the person in image after image of one camera.

    Attributes:
        missed: number of images in which nobody was found.
    """

    def __init__(self, network: PoseNetwork) -> None:
        """Use ``network`` for one camera alone, because it follows the person."""
        self._network = network
        self.missed = 0

    def restart(self) -> None:
        """Forget the last image, so that results depend on the following images alone."""
        self._network.forget()
        self.missed = 0

    def __call__(self, image: Image) -> Detection | None:
        """Return the person in an image (H, W) or (H, W, 3), bgr; None if there is nobody."""
        color = image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
        found = self._network(color)
        self.missed += found is None
        return found

    def points(self, image: Image) -> ImagePoints | None:
        """Return the points in an image at the working size."""
        found = self(image)
        return None if found is None else image_points(found)
