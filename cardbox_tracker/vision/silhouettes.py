"""From a camera's image to the silhouette in it: the same steps live and in a recording.

An image is resized and rectified; the first ones teach the empty scene, and in every later one the
person is cut out before it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.vision.background import (
    BackgroundConfig,
    BackgroundModel,
    SilhouetteExtractor,
    brightness_of,
)
from cardbox_tracker.vision.camera import Calibration
from cardbox_tracker.vision.learning import Learning
from cardbox_tracker.vision.resize import to_working_size

ImageArray = NDArray[np.uint8]

# A silhouette so many times larger than in another light says that the light is another one.
_IN_WRONG_LIGHT = 1.7


class SilhouettePipeline:
    """Learns the empty scene of one camera, then cuts silhouettes out of its images.

    Attributes:
        calibration: of the images that come in.
        camera: the pinhole camera of what comes out, at the working size, without distortion.
        learning: how far the empty scene is learned.
    """

    def __init__(
        self,
        calibration: Calibration,
        size: tuple[int, int],
        config: BackgroundConfig | None = None,
        learning: type[Learning] = Learning,
    ) -> None:
        """Set up with nothing learned.

        Args:
            calibration: of the images that come in, of any size of that aspect ratio.
            size: working size (width, height), px.
            config: settings of the background model.
            learning: how the empty scene is learned.

        Raises:
            CameraError: the camera is uncalibrated or its distortion model is unknown.
        """
        self.calibration = calibration
        self.camera = calibration.camera(*size)
        self._size = size
        self._rectifier = calibration.rectifier(*size)
        self._config = config or BackgroundConfig()
        self._way = learning
        self.learning = learning(self._config.learn_images)
        self._extractor: SilhouetteExtractor | None = None

    @property
    def config(self) -> BackgroundConfig:
        """The settings; assigning others keeps what was learned and acts on the next image."""
        return self._config

    @config.setter
    def config(self, config: BackgroundConfig) -> None:
        self._config = config
        self.learning.images = config.learn_images
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
        return self.learning.count

    @property
    def has_enough(self) -> bool:
        """True once the scene is learned well enough for :meth:`finish_learning`."""
        return self.learning.has_enough()

    def prepare(self, image: ImageArray) -> ImageArray:
        """Return ``image`` (H, W) or (H, W, 3) at the working size, without lens distortion."""
        small = to_working_size(image, *self._size)
        return small if self._rectifier is None else self._rectifier(small)

    def learn(self, image: ImageArray) -> None:
        """Add a prepared image, grey (H, W) or bgr (H, W, 3), of the empty scene."""
        self.learning.add(image)

    def finish_learning(self) -> BackgroundModel:
        """Learn the background from the images added; later images are compared with it.

        Raises:
            ValueError: fewer than two images were added.
        """
        model = self.learning.model()
        self._extractor = SilhouetteExtractor(model, self._config)
        return model

    def relearn(self, learning: type[Learning] | None = None) -> None:
        """Forget the background; it is learned again, in another way if one is given."""
        self._way = learning or self._way
        self.learning = self._way(self._config.learn_images)
        self._extractor = None

    def resume(self, model: BackgroundModel, image: ImageArray) -> None:
        """Go on with a background learned before, from a prepared image with anybody in it.

        The light may have changed since: where the silhouette is much smaller in a light estimated
        from this image, that light is taken.
        """
        extractor = SilhouetteExtractor(model, self._config)
        found = np.count_nonzero(extractor(image))
        extractor.restart()
        other = SilhouetteExtractor(model, self._config)
        other.expect_other_light()
        for _ in range(2):  # the second time, without the person
            left = np.count_nonzero(other(image))
        self._extractor = other if found > _IN_WRONG_LIGHT * left else extractor

    def silhouette(self, image: ImageArray, stamp_ns: int = 0) -> ImageArray:
        """Return the silhouette (H, W), 0 or 255, of a prepared image, grey or bgr.

        Its stamp, 0 if unknown, only says how fast images come.

        Raises:
            RuntimeError: no background is learned yet.
        """
        if self._extractor is None:
            raise RuntimeError("no background is learned yet; call finish_learning() first")
        return self._extractor(image, stamp_ns)

    def restart(self) -> None:
        """Say that the next image is not the one after the last, so that no light is followed."""
        if self._extractor is not None:
            self._extractor.restart()

    @property
    def light(self) -> float:
        """Brightness of the scene in the last image as a factor of what was learned."""
        return 1.0 if self._extractor is None else self._extractor.gain

    def drift(self, image: ImageArray) -> float:
        """Return how much brighter a prepared image is than the background, grey levels.

        The median over the image, since the person covers less than half of it; 0 before a
        background is learned.
        """
        if self._extractor is None:
            return 0.0
        return float(np.median(brightness_of(image) - self._extractor.model.mean))
