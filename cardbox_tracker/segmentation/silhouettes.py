"""Turns camera images into silhouettes, with the same steps live and in a recording.

An image is resized and rectified. The first images teach the empty scene; from every later one the
silhouette of the person is extracted. In depth images a limit of the distance takes its place.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import WORKING_SIZE, Calibration
from cardbox_tracker.camera.depth_image import DepthImage
from cardbox_tracker.camera.encodings import brightness_of, to_working_size
from cardbox_tracker.common.settings import settings_or
from cardbox_tracker.segmentation.background import SilhouetteExtractor
from cardbox_tracker.segmentation.background_config import BackgroundConfig
from cardbox_tracker.segmentation.empty_scene import BackgroundModel
from cardbox_tracker.segmentation.learning import Learning
from cardbox_tracker.segmentation.regions import LEAST_AREA, MOST_HOLE, clean_silhouette

ImageArray = NDArray[np.uint8]

# If another light makes the silhouette smaller by this factor, that light is correct.
_IN_WRONG_LIGHT = 1.7


class SilhouettePipeline:
    """Learns the empty scene of one camera, then extracts silhouettes from its images.

    Attributes:
        calibration: calibration of the input images.
        camera: pinhole camera of the silhouettes, at the working size, without distortion.
        learning: the method and progress of learning the empty scene.
    """

    def __init__(
        self,
        calibration: Calibration,
        most: tuple[int, int] = WORKING_SIZE,
        config: BackgroundConfig | None = None,
        learning: type[Learning] = Learning,
    ) -> None:
        """Start without a background.

        ``calibration`` is that of the images, which may have any size of its aspect ratio; working
        images keep it, with about as many pixels as ``most`` (width, height). ``learning`` learns
        the empty scene. Raises CameraError if the camera is uncalibrated or its
        distortion model is unknown.
        """
        self.calibration = calibration
        self._size = calibration.working_size(most)
        level = calibration.level_size(*self._size)
        self.camera = calibration.camera(*level)
        self._rectifier = calibration.rectifier(*level)
        self._config = settings_or(BackgroundConfig(), config)
        self._way = learning
        self.learning = learning(self._config.learn_images)
        self._extractor: SilhouetteExtractor | None = None

    @property
    def config(self) -> BackgroundConfig:
        """The settings; other settings act on the next image and keep the background."""
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
        """Whether a background is learned, so that silhouettes can be extracted."""
        return self._extractor is not None

    def prepare(self, image: ImageArray) -> ImageArray:
        """Return ``image`` (H, W) or (H, W, 3) at the working size, without lens distortion."""
        small = to_working_size(image, *self._size)
        return small if self._rectifier is None else self._rectifier(small)

    def finish_learning(self) -> BackgroundModel:
        """Make a background from the added images; ValueError if there are fewer than two."""
        model = self.learning.model()
        self._extractor = SilhouetteExtractor(model, self._config)
        return model

    def relearn(self, learning: type[Learning] | None = None) -> None:
        """Forget the background and learn it again, with another method if one is given."""
        self._way = learning or self._way
        self.learning = self._way(self._config.learn_images)
        self._extractor = None

    def resume(self, model: BackgroundModel, image: ImageArray) -> None:
        """Continue with a background learned before; the prepared image may show a person.

        The light may have changed since. If the silhouette is much smaller in a light that is
        estimated from this image, that light is used.
        """
        extractor = SilhouetteExtractor(model, self._config)
        found = np.count_nonzero(extractor(image))
        extractor.restart()
        other = SilhouetteExtractor(model, self._config)
        other.expect_other_light()
        for _ in range(2):  # the second pass excludes the person
            left = np.count_nonzero(other(image))
        self._extractor = other if found > _IN_WRONG_LIGHT * left else extractor

    def silhouette(self, image: ImageArray, stamp_ns: int = 0) -> ImageArray:
        """Return the silhouette (H, W) of a prepared image; the stamp, ns or 0, tells the rate."""
        if self._extractor is None:
            raise RuntimeError("no background is learned yet; call finish_learning() first")
        return self._extractor(image, stamp_ns)

    def restart(self) -> None:
        """Forget the light, since the next image does not follow the last one."""
        if self._extractor is not None:
            self._extractor.restart()

    def drift(self, image: ImageArray) -> float:
        """Return the median difference from the background, grey levels; 0 without one."""
        if self._extractor is None:
            return 0.0
        return float(np.median(brightness_of(image) - self._extractor.model.mean))


# Unknown pixels between near ones belong to the person: a depth camera measures nothing at edges
# and where only one of its eyes sees.
_GAP = 1 / 64


def nearest_m(depth_m: DepthImage) -> float:
    """Return the distance of the nearest hundredth of a depth image, metres; infinite without."""
    known = depth_m[np.isfinite(depth_m) & (depth_m > 0)]
    return float(np.quantile(known, 0.01)) if known.size else np.inf


def silhouette_within(depth_m: DepthImage, within_m: float) -> NDArray[np.uint8]:
    """Return the silhouette (H, W), 0 or 255, of the pixels nearer than ``within_m``.

    The depth is (H, W), metres along the optical axis; not finite or 0 where it is unknown. The
    person has to stand free of the wall, with nothing else nearer than the limit but the floor
    below the hips, which does not count.
    """
    is_known = np.isfinite(depth_m) & (depth_m > 0)
    near = np.uint8(255) * (is_known & (depth_m < within_m))
    width = max(3, round(_GAP * depth_m.shape[1]) | 1)
    closed = cv2.morphologyEx(near, cv2.MORPH_CLOSE, np.ones((width, width), np.uint8))
    near[~is_known & (np.asarray(closed) > 0)] = 255
    return clean_silhouette(near, LEAST_AREA, MOST_HOLE)[0]
