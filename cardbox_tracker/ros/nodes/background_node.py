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
from cardbox_tracker.vision.background import warm_up
from cardbox_tracker.vision.camera_info import calibration_from_info
from cardbox_tracker.vision.silhouettes import SilhouettePipeline

# The default shared-memory segment of Fast DDS holds half a megabyte, less its own data.
_LARGE_IMAGE_BYTES = 400_000
_LOSS_TO_WARN = 0.1
# Well above the noise of a median over the image.
_DRIFT_TO_WARN_GREY_LEVELS = 12.0
# More of the image than a person who is wholly in view covers.
_COVERAGE_TO_WARN = 0.6


class BackgroundNode(CardboxNode):
    """Learns the empty scene and cuts out the person who enters it."""

    def __init__(self, **options: Any) -> None:
        """Subscribe to the camera and wait for its images."""
        super().__init__("background", **options)
        warm_up()
        self.parameters = LiveParameters(self, BackgroundParameters, self._changed)
        settings = self.parameters.value
        self._info_key: tuple[Any, ...] = ()
        self._pipeline: SilhouettePipeline | None = None
        self._image: conversions.ImageArray | None = None
        self._image_bytes = 0
        self._covered = 0.0

        self._silhouette = self.advertise_inside(Image, "silhouette", qos.SILHOUETTE)
        self._images = self.advertise_inside(Image, "silhouette/image", qos.SILHOUETTE)
        self._infos = self.advertise_inside(CameraInfo, "silhouette/camera_info", qos.SILHOUETTE)
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
        if self._pipeline is not None:
            self._pipeline.config = settings.config()

    def _learn(self) -> str:
        if self._pipeline is None or self._image is None:
            raise CameraError(
                f"no image was received yet on {self._image_topic}, so there is nothing to learn "
                "from; is the camera running, and its CameraInfo on "
                f"{self._info_topic}? See 'ros2 topic hz {self._image_topic}'"
            )
        self._pipeline.relearn()
        return (
            f"learning the background from the next {self._pipeline.config.learn_images} images; "
            "nobody may be in view"
        )

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
        if key == self._info_key and self._pipeline is not None:
            return
        self._info_key, self._pipeline, self._image = key, None, None
        calibration = calibration_from_info(message, self._image_topic, self._info_topic)
        settings = self.parameters.value
        size = (settings.width, settings.height)
        try:
            self._pipeline = SilhouettePipeline(calibration, size, settings.config())
        except CameraError as error:
            raise CameraError(
                f"{self._info_topic}, of the images on {self._image_topic}: {error}"
            ) from None
        self.diagnostics.wait_for(f"images on {self._image_topic}")

    def _on_image(self, message: Image | CompressedImage, sent_ns: int) -> None:
        self.diagnostics.input.add(conversions.stamp_ns(message.header.stamp))
        self._image_bytes = len(message.data)
        pipeline = self._pipeline
        if pipeline is None:
            if not self._info_key:
                self.diagnostics.wait_for(
                    f"the CameraInfo on {self._info_topic} of the images on {self._image_topic}"
                )
            return
        calibration, most = pipeline.calibration, self.parameters.value.max_megapixels
        full = conversions.image_of(message, conversions.most_pixels_of(calibration, most))
        conversions.check_shape(full, calibration, self._image_topic, self._info_topic)
        self._image = image = pipeline.prepare(full)
        if not pipeline.is_ready:
            self._learn_from(message.header, pipeline, image)
        if pipeline.is_ready:
            self._publish(message.header, pipeline, image)
            self.diagnostics.working(sent_ns)

    def _learn_from(
        self, header: Header, pipeline: SilhouettePipeline, image: conversions.ImageArray
    ) -> None:
        pipeline.learn(image)
        if not pipeline.has_enough:
            self.diagnostics.wait_for(
                f"{pipeline.config.learn_images} images of the empty scene on {self._image_topic} "
                "(learning the background: nobody may be in view)"
            )
            return
        model = pipeline.finish_learning()
        self._mean.publish(conversions.image_message(header, model.mean, "32FC1"))
        self._stddev.publish(conversions.image_message(header, model.stddev, "32FC1"))
        self.get_logger().info(f"background learned from {pipeline.learned_images} images")

    def _publish(
        self, header: Header, pipeline: SilhouettePipeline, image: conversions.ImageArray
    ) -> None:
        if self._images.get_subscription_count():
            # Before the silhouette, so that nobody who needs both has to wait.
            self._images.publish(conversions.image_message(header, image))
        silhouette = pipeline.silhouette(image)
        # The silhouette first, so that the tracker does not wait for a CameraInfo that rarely
        # changes.
        self._silhouette.publish(conversions.image_message(header, silhouette, "mono8"))
        self._infos.publish(conversions.camera_info_message(header, pipeline.camera))
        self._covered = np.count_nonzero(silhouette) / silhouette.size

    def _values(self) -> dict[str, str]:
        learned = 0 if self._pipeline is None else self._pipeline.learned_images
        return {
            "background learned from": f"{learned}/{self.parameters.value.learn_images}",
            "foreground (% of the image)": f"{100 * self._covered:.1f}",
            "scene brightness drift (grey levels)": f"{self._drift():.1f}",
        }

    def _drift(self) -> float:
        if self._pipeline is None or self._image is None:
            return 0.0
        return self._pipeline.drift(self._image)

    def _advice(self) -> list[str]:
        advice = []
        if self.diagnostics.input.loss > _LOSS_TO_WARN and self._image_bytes > _LARGE_IMAGE_BYTES:
            advice.append(
                f"{100 * self.diagnostics.input.loss:.0f} % of the images on {self._image_topic} "
                f"({self._image_bytes // 1000} kB each) are lost on the way: start all nodes "
                "with FASTRTPS_DEFAULT_PROFILES_FILE set to this package's "
                "config/fastdds_large_images.xml, or use smaller, grey or compressed images"
            )
        follows = self.parameters.value.follow and self.parameters.value.clean_up
        drifted = not follows and abs(self._drift()) > _DRIFT_TO_WARN_GREY_LEVELS
        if drifted or self._covered > _COVERAGE_TO_WARN:
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
