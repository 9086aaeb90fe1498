"""From a camera's image to the silhouette in it: the same steps live and in a recording.

An image is resized and rectified; the first ones teach the empty scene, and in every later one the
person is cut out before it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.vision.background import (
    BackgroundConfig,
    BackgroundLearner,
    BackgroundModel,
    SilhouetteExtractor,
    brightness_of,
)
from cardbox_tracker.vision.camera import Calibration
from cardbox_tracker.vision.resize import to_working_size

ImageArray = NDArray[np.uint8]


class SilhouettePipeline:
    """Learns the empty scene of one camera, then cuts silhouettes out of its images.

    Attributes:
        calibration: of the images that come in.
        camera: the pinhole camera of what comes out, at the working size, without distortion.
    """

    def __init__(
        self,
        calibration: Calibration,
        size: tuple[int, int],
        config: BackgroundConfig | None = None,
    ) -> None:
        """Set up with nothing learned.

        Args:
            calibration: of the images that come in, of any size of that aspect ratio.
            size: working size (width, height), px.
            config: settings of the background model.

        Raises:
            CameraError: the camera is uncalibrated or its distortion model is unknown.
        """
        self.calibration = calibration
        self.camera = calibration.camera(*size)
        self._size = size
        self._rectifier = calibration.rectifier(*size)
        self._config = config or BackgroundConfig()
        self._learner = BackgroundLearner()
        self._extractor: SilhouetteExtractor | None = None

    @property
    def config(self) -> BackgroundConfig:
        """The settings; assigning others keeps what was learned and acts on the next image."""
        return self._config

    @config.setter
    def config(self, config: BackgroundConfig) -> None:
        self._config = config
        if self._extractor is not None:
            self._extractor = SilhouetteExtractor(self._extractor.model, config)

    @property
    def model(self) -> BackgroundModel | None:
        """The learned background; None before :meth:`finish_learning`."""
        return None if self._extractor is None else self._extractor.model

    @property
    def is_ready(self) -> bool:
        """True once a background is learned, so that silhouettes can be cut out."""
        return self._extractor is not None

    @property
    def learned_images(self) -> int:
        """Images of the empty scene added so far."""
        return self._learner.count

    @property
    def has_enough(self) -> bool:
        """True once ``config.learn_images`` images were added."""
        return self._learner.count >= self._config.learn_images

    def prepare(self, image: ImageArray) -> ImageArray:
        """Return ``image`` (H, W) or (H, W, 3) at the working size, without lens distortion."""
        small = to_working_size(image, *self._size)
        return small if self._rectifier is None else self._rectifier(small)

    def learn(self, image: ImageArray) -> None:
        """Add a prepared image, grey (H, W) or bgr (H, W, 3), of the empty scene."""
        self._learner.add(image)

    def finish_learning(self) -> BackgroundModel:
        """Learn the background from the images added; later images are compared with it.

        Raises:
            ValueError: fewer than two images were added.
        """
        model = self._learner.model()
        self._extractor = SilhouetteExtractor(model, self._config)
        return model

    def relearn(self) -> None:
        """Forget the background; it is learned again from the next images."""
        self._learner = BackgroundLearner()
        self._extractor = None

    def silhouette(self, image: ImageArray) -> ImageArray:
        """Return the silhouette (H, W), 0 or 255, of a prepared image, grey or bgr.

        Raises:
            RuntimeError: no background is learned yet.
        """
        if self._extractor is None:
            raise RuntimeError("no background is learned yet; call finish_learning() first")
        return self._extractor(image)

    def restart(self) -> None:
        """Say that the next image is not the one after the last, so that no light is followed."""
        if self._extractor is not None:
            self._extractor.restart()

    def drift(self, image: ImageArray) -> float:
        """Return how much brighter a prepared image is than the background, grey levels.

        The median over the image, since the person covers less than half of it; 0 before a
        background is learned.
        """
        if self._extractor is None:
            return 0.0
        return float(np.median(brightness_of(image) - self._extractor.model.mean))
