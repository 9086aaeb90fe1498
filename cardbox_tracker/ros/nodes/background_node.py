"""The node ``background``: images in, silhouettes out."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Header

from cardbox_tracker.errors import CameraError
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.nodes.node_parameters import BackgroundParameters
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode, run_node
from cardbox_tracker.ros.runtime.parameters import LiveParameters
from cardbox_tracker.vision.background import BackgroundLearner, SilhouetteExtractor, warm_up
from cardbox_tracker.vision.camera import Calibration, Camera, Rectifier
from cardbox_tracker.vision.camera_info import calibration_from_info
from cardbox_tracker.vision.resize import to_working_size

_LARGE_IMAGE_BYTES = 400_000
_LOSS = 0.1
_DRIFT_GREY_LEVELS = 12.0
_COVERED = 0.6


class BackgroundNode(CardboxNode):
    """Learns the empty scene and cuts out whoever enters it."""

    def __init__(self, **options: Any) -> None:
        """Subscribe to the camera and wait for its images."""
        super().__init__("background", **options)
        warm_up()
        self.parameters = LiveParameters(self, BackgroundParameters, self._changed)
        settings = self.parameters.value
        self._size = (settings.width, settings.height)
        self._config = settings.config()
        self._calibration: Calibration | None = None
        self._info_key: tuple[Any, ...] = ()
        self._camera: Camera | None = None
        self._rectifier: Rectifier | None = None
        self._learner = BackgroundLearner(self._config)
        self._extractor: SilhouetteExtractor | None = None
        self._image: conversions.ImageArray | None = None
        self._image_bytes = 0
        self._covered = 0.0

        self._silhouette = self.hand_over(Image, "silhouette", qos.SILHOUETTE)
        self._infos = self.hand_over(CameraInfo, "silhouette/camera_info", qos.SILHOUETTE)
        self._mean = self.advertise(Image, "~/mean", qos.LATCHED)
        self._stddev = self.advertise(Image, "~/stddev", qos.LATCHED)
        compressed = settings.image_transport == "compressed"
        topic = "image_raw/compressed" if compressed else "image_raw"
        kind = CompressedImage if compressed else Image
        self._image_topic = self.resolve(topic)
        self._info_topic = self.resolve("camera_info")
        self.subscribe(CameraInfo, "camera_info", self._on_info, qos.SENSOR_DATA)
        self.subscribe(kind, topic, self._on_image, qos.SENSOR_DATA)
        self.offer("~/learn", self._learn)
        self.diagnostics.extra = self._values
        self.diagnostics.advice = self._advice
        self.diagnostics.wait_for(
            f"images on {self._image_topic} and their CameraInfo on {self._info_topic}"
        )

    def _changed(self, settings: BackgroundParameters) -> None:
        self._config = settings.config()
        if self._extractor is not None:
            self._extractor = SilhouetteExtractor(self._extractor.model, self._config)
        self._learner.config = self._config

    def _learn(self) -> str:
        if self._image is None:
            raise CameraError(
                f"no image was received yet on {self._image_topic}, so there is nothing to learn "
                "from; is the camera running, and its CameraInfo on "
                f"{self._info_topic}? See 'ros2 topic hz {self._image_topic}'"
            )
        self._forget()
        return (
            f"learning the background from the next {self._config.learn_images} images; "
            "nobody may be in view"
        )

    def _forget(self) -> None:
        self._learner = BackgroundLearner(self._config)
        self._extractor = None

    def _on_info(self, message: CameraInfo, _: int) -> None:
        roi = message.roi
        key = (
            message.width,
            message.height,
            message.distortion_model,
            tuple(message.k),
            tuple(message.d),
            (roi.x_offset, roi.y_offset, roi.width, roi.height),
            (message.binning_x, message.binning_y),
        )
        if key == self._info_key and self._camera is not None:
            return
        self._info_key, self._camera = key, None
        self._calibration = calibration_from_info(message, self._image_topic, self._info_topic)
        try:
            self._rectifier = self._calibration.rectifier(*self._size)
            self._camera = self._calibration.camera(*self._size)
        except CameraError as error:
            raise CameraError(
                f"{self._info_topic}, of the images on {self._image_topic}: {error}"
            ) from None
        self._forget()
        self.diagnostics.wait_for(f"images on {self._image_topic}")

    def _on_image(self, message: Image | CompressedImage, sent_ns: int) -> None:
        self.diagnostics.input.add(conversions.stamp_ns(message.header.stamp))
        self._image_bytes = len(message.data)
        if self._camera is None or self._calibration is None:
            if not self._info_key:
                self.diagnostics.wait_for(
                    f"the CameraInfo on {self._info_topic} of the images on {self._image_topic}"
                )
            return
        full = conversions.brightness_of(message)
        conversions.check_shape(full, self._calibration, self._image_topic, self._info_topic)
        image = to_working_size(full, *self._size)
        if self._rectifier is not None:
            image = self._rectifier(image)
        self._image = image
        if self._extractor is None:
            self._add_to_background(message.header, image)
        if self._extractor is not None:
            self._publish(message.header, self._extractor, image)
            self.diagnostics.working(sent_ns)

    def _add_to_background(self, header: Header, image: conversions.ImageArray) -> None:
        self._learner.add(image)
        if not self._learner.is_ready:
            self.diagnostics.wait_for(
                f"{self._config.learn_images} images of the empty scene on {self._image_topic} "
                "(learning the background: nobody may be in view)"
            )
            return
        model = self._learner.model()
        self._extractor = SilhouetteExtractor(model, self._config)
        self._mean.publish(conversions.image_message(header, model.mean, "32FC1"))
        self._stddev.publish(conversions.image_message(header, model.stddev, "32FC1"))
        self.get_logger().info(f"background learned from {self._learner.count} images")

    def _publish(
        self, header: Header, extractor: SilhouetteExtractor, image: conversions.ImageArray
    ) -> None:
        assert self._camera is not None
        silhouette = extractor(image)
        # The image first: whoever tracks it need not wait for what hardly ever changes.
        self._silhouette.publish(conversions.image_message(header, silhouette, "mono8"))
        self._infos.publish(conversions.camera_info_message(header, self._camera))
        self._covered = np.count_nonzero(silhouette) / silhouette.size

    def _values(self) -> dict[str, str]:
        return {
            "background learned from": f"{self._learner.count}/{self._config.learn_images}",
            "foreground (% of the image)": f"{100 * self._covered:.1f}",
            "scene brightness drift (grey levels)": f"{self._drift():.1f}",
        }

    def _drift(self) -> float:
        """How much brighter the scene became; the person covers less than half of it."""
        if self._extractor is None or self._image is None:
            return 0.0
        return float(np.median(self._image - self._extractor.model.mean))

    def _advice(self) -> list[str]:
        advice = []
        if self.diagnostics.input.loss > _LOSS and self._image_bytes > _LARGE_IMAGE_BYTES:
            advice.append(
                f"{100 * self.diagnostics.input.loss:.0f} % of the images on {self._image_topic} "
                f"({self._image_bytes // 1000} kB each) are lost on the way: start all nodes "
                "with FASTRTPS_DEFAULT_PROFILES_FILE set to this package's "
                "config/fastdds_large_images.xml, or use smaller, grey or compressed images"
            )
        if abs(self._drift()) > _DRIFT_GREY_LEVELS or self._covered > _COVERED:
            advice.append(
                "the whole scene changed its brightness: switch the camera's automatic exposure "
                "and white balance off (v4l2-ctl -c auto_exposure=1,white_balance_automatic=0), "
                "then call background/learn with nobody in view"
            )
        return advice


def main(args: list[str] | None = None) -> int:
    """Run the node; the exit code is 0 unless it could not start."""
    return run_node(BackgroundNode, args)


if __name__ == "__main__":
    sys.exit(main())
