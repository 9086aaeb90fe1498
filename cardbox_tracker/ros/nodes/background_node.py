"""The node ``background``: images in, silhouettes out."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Header

from cardbox_tracker.errors import BackgroundFileError, CameraError
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.nodes.depth_cut import DepthCut
from cardbox_tracker.ros.nodes.shared_parameters import (
    depth_parameter,
    image_transport_parameter,
    max_megapixels_parameter,
)
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.command_line import plain_command_line
from cardbox_tracker.ros.runtime.node import CardboxNode, run_node
from cardbox_tracker.ros.runtime.parameter_fields import AT_START, NodeParameters, parameter, shared
from cardbox_tracker.ros.runtime.parameters import LiveParameters
from cardbox_tracker.ros.runtime.publishers import SinglePublisher
from cardbox_tracker.settings import settings_of
from cardbox_tracker.vision.background import warm_up
from cardbox_tracker.vision.background_advice import Findings, advice
from cardbox_tracker.vision.background_config import BackgroundConfig
from cardbox_tracker.vision.background_file import background_path
from cardbox_tracker.vision.calibration_watch import CalibrationWatch
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.depth_silhouette import WITHIN_LIMITS_M
from cardbox_tracker.vision.kept_background import KeptBackground
from cardbox_tracker.vision.learning import WAYS
from cardbox_tracker.vision.silhouettes import SilhouettePipeline

_DOES = "Cut the person out of a camera's images: images in, silhouettes out."
_NEXT_LEARNING = "next learning"


@dataclass(frozen=True)
class BackgroundParameters(NodeParameters):
    """Cut the person out of the camera's images."""

    image_transport: str = image_transport_parameter()
    width: int = parameter(
        320, "working resolution, width", unit="px", limits=(32, 4096), effect=AT_START
    )
    height: int = parameter(
        240, "working resolution, height", unit="px", limits=(32, 4096), effect=AT_START
    )
    background_file: str = parameter(
        "",
        "file of the learned background; if it exists at the start and fits the camera and the "
        "scene, nothing has to be learned, even with a person in view; empty: none",
        effect=AT_START,
    )
    within_m: float = parameter(
        0.0,
        "with depth images: pixels nearer than this are the person, and nothing has to be "
        "learned; choose a distance between the person and the wall; 0: learn the empty scene",
        unit="m",
        limits=(0.0, WITHIN_LIMITS_M[1]),
    )
    depth: str = depth_parameter()
    learning: str = parameter(
        next(iter(WAYS)),
        "still: learn the empty scene when nothing moves; person_in_view: learn the scene around a "
        "person, and the rest when the person steps aside; always: learn from the first images "
        "despite movements",
        choices=tuple(WAYS),
        effect=_NEXT_LEARNING,
    )
    max_megapixels: float = max_megapixels_parameter()
    learn_images: int = shared(BackgroundConfig, "learn_images", effect=_NEXT_LEARNING)
    threshold: float = shared(BackgroundConfig, "threshold")
    min_stddev: float = shared(BackgroundConfig, "min_stddev")
    clean_up: bool = shared(BackgroundConfig, "clean_up")
    smoothing_px: float = shared(BackgroundConfig, "smoothing_px")
    min_contrast: float = shared(BackgroundConfig, "min_contrast")
    shadow: float = shared(BackgroundConfig, "shadow")
    soft_shadow: float = shared(BackgroundConfig, "soft_shadow")
    darkest_shadow: float = shared(BackgroundConfig, "darkest_shadow")
    color: bool = shared(BackgroundConfig, "color")
    min_color_contrast: float = shared(BackgroundConfig, "min_color_contrast")
    color_edge: float = shared(BackgroundConfig, "color_edge")
    edge: float = shared(BackgroundConfig, "edge")
    flicker: float = shared(BackgroundConfig, "flicker")
    follow: bool = shared(BackgroundConfig, "follow")
    min_area: float = shared(BackgroundConfig, "min_area")
    max_hole: float = shared(BackgroundConfig, "max_hole")
    absorb_after: int = shared(BackgroundConfig, "absorb_after")

    def check(self) -> None:
        """Raise ValueError if values contradict each other."""
        if self.within_m > 0.0 and not self.depth:
            raise ValueError(
                f"within_m is {self.within_m:g} but no depth is given; set 'depth' to a topic of "
                "depth images, or within_m to 0"
            )

    def config(self) -> BackgroundConfig:
        """Return the settings of the core."""
        names = settings_of(BackgroundConfig)
        return BackgroundConfig(**{name: getattr(self, name) for name in names})


class BackgroundNode(CardboxNode):
    """Learns the empty scene and cuts out the person who enters it."""

    def __init__(self, **options: Any) -> None:
        """Subscribe to the camera and wait for its images."""
        super().__init__("background", **options)
        warm_up()
        self.parameters = LiveParameters(self, BackgroundParameters, self._changed)
        settings = self.parameters.value
        path = background_path(settings.background_file)
        self._kept = KeptBackground(path, (settings.width, settings.height))
        self._pipeline: SilhouettePipeline | None = None
        self._image: conversions.ImageArray | None = None
        self._image_bytes = 0
        self._info: CameraInfo | None = None
        self._covered = 0.0
        self._silhouettes = self.advertise_inside(Image, "silhouette", qos.SILHOUETTE)
        self._images = self.advertise_inside(Image, "silhouette/image", qos.SILHOUETTE)
        self._infos = self.advertise_inside(CameraInfo, "silhouette/camera_info", qos.SILHOUETTE)
        self._mean = self.advertise(Image, "~/mean", qos.LATCHED)
        self._stddev = self.advertise(Image, "~/stddev", qos.LATCHED)
        compressed = settings.image_transport == "compressed"
        topic = "image_raw/compressed" if compressed else "image_raw"
        kind = CompressedImage if compressed else Image
        self._image_topic = self.resolve(topic)
        self._info_topic = self.resolve("camera_info")
        self._watch = CalibrationWatch(self._info_topic, self._image_topic)
        self._single = SinglePublisher(self, (self._image_topic, self._info_topic))
        self.subscribe(CameraInfo, "camera_info", self._on_info, qos.SENSOR_DATA)
        self.subscribe(kind, topic, self._on_image, qos.SENSOR_DATA)
        self._cut = DepthCut(self, settings.depth, self._send) if settings.depth else None
        self.offer("~/learn", self._learn)
        self.diagnostics.extra = self._values
        self.diagnostics.source = f"images on {self._image_topic}"
        self.diagnostics.advice = self._advice
        self.diagnostics.wait_for(
            f"images on {self._image_topic} and their CameraInfo on {self._info_topic}"
        )

    def _changed(self, settings: BackgroundParameters) -> None:
        if self._pipeline is not None:
            self._pipeline.config = settings.config()

    def _learn(self) -> str:
        if self.parameters.value.within_m > 0.0:
            return "nothing has to be learned: within_m is set, so depth shows the person"
        if self._pipeline is None or self._image is None:
            raise CameraError(
                f"no image was received yet on {self._image_topic}, so nothing can be learned; "
                "is the camera running, and its CameraInfo on "
                f"{self._info_topic}? See 'ros2 topic hz {self._image_topic}'"
            )
        self._kept.forget()
        self._pipeline.relearn(WAYS[self.parameters.value.learning])
        return f"waiting for {self._pipeline.learning.waits_for(self._image_topic)}"

    def _on_info(self, message: CameraInfo, _: int) -> None:
        before = self._watch.remark
        changed = self._watch.see(message)
        if self._watch.remark and not before:
            self.get_logger().warning(self._watch.remark)
        calibration = self._watch.current
        if not changed or calibration is None:
            return
        settings = self.parameters.value
        if self._pipeline is not None:
            self.get_logger().warning(
                f"the CameraInfo on {self._info_topic} has changed for good, to {calibration}"
            )
            self._kept.carry_over(self._pipeline.model)
        self._image, self._info = None, message
        self._pipeline = SilhouettePipeline(
            calibration,
            (settings.width, settings.height),
            settings.config(),
            WAYS[settings.learning],
        )
        self.diagnostics.wait_for(f"images on {self._image_topic}")

    def _on_image(self, message: Image | CompressedImage, sent_ns: int) -> None:
        if not self.diagnostics.input.add(conversions.stamp_ns(message.header.stamp)).is_usable:
            return
        self._image_bytes = len(message.data)
        pipeline = self._pipeline
        if pipeline is None:
            if not self._watch.seen:
                self.diagnostics.wait_for(
                    f"the CameraInfo on {self._info_topic} for the images on {self._image_topic}"
                )
            return
        calibration, most = pipeline.calibration, self.parameters.value.max_megapixels
        full = conversions.image_of(message, conversions.most_pixels_of(calibration, most))
        conversions.check_shape(full, calibration, self._image_topic, self._info_topic)
        self._image = image = pipeline.prepare(full)
        within_m = self.parameters.value.within_m
        if self._cut is not None and within_m > 0.0:
            self._send_image(message.header, image)
            self._cut.add(message.header, pipeline.camera, within_m, sent_ns)
            return
        if not pipeline.is_ready:
            self._prepare(message.header, pipeline, image)
        if pipeline.is_ready:
            self._send_image(message.header, image)
            silhouette = pipeline.silhouette(image, conversions.stamp_ns(message.header.stamp))
            self._send(message.header, silhouette, pipeline.camera, sent_ns)

    def _prepare(
        self, header: Header, pipeline: SilhouettePipeline, image: conversions.ImageArray
    ) -> None:
        """Continue with the previous background, or learn a new one."""
        done = self._kept.resume(pipeline, image)
        if not done:
            pipeline.learning.add(image)
            if not pipeline.has_enough:
                self.diagnostics.wait_for(pipeline.learning.waits_for(self._image_topic))
                return
            pipeline.finish_learning()
            done = f"background learned from {pipeline.learned_images} images"
            try:
                done += self._kept.keep(pipeline)
            except BackgroundFileError as error:
                self.diagnostics.warn(str(error))
        model = pipeline.model
        assert model is not None
        self._mean.publish(conversions.image_message(header, model.mean, "32FC1"))
        self._stddev.publish(conversions.image_message(header, model.stddev, "32FC1"))
        self.get_logger().info(done)

    def _send_image(self, header: Header, image: conversions.ImageArray) -> None:
        """Publish an image before its silhouette; the tracker pairs both."""
        if self._images.get_subscription_count():
            self._images.publish(conversions.image_message(header, image))

    def _send(
        self, header: Header, silhouette: conversions.ImageArray, camera: Camera, sent_ns: int
    ) -> None:
        """Publish a silhouette (H, W), 0 or 255, and then its calibration."""
        self._silhouettes.publish(conversions.image_message(header, silhouette, "mono8"))
        self._infos.publish(conversions.camera_info_message(header, camera, self._info))
        self._covered = np.count_nonzero(silhouette) / silhouette.size
        self.diagnostics.working(sent_ns)

    def _values(self) -> dict[str, str]:
        values = {
            "background learned from": f"0/{self.parameters.value.learn_images}",
            "foreground (% of the image)": f"{100 * self._covered:.1f}",
            "scene brightness drift (grey levels)": f"{self._drift():.1f}",
            "ignored CameraInfo": str(self._watch.ignored),
        }
        if self._pipeline is not None:
            values |= self._pipeline.learning.values()
        return values

    def _drift(self) -> float:
        if self._pipeline is None or self._image is None:
            return 0.0
        return self._pipeline.drift(self._image)

    def _advice(self) -> dict[str, str]:
        settings, remark = self.parameters.value, self._watch.remark
        findings = Findings(
            self._image_topic,
            self.diagnostics.input.loss,
            self._image_bytes,
            self._drift(),
            settings.follow and settings.clean_up,
            self._covered,
            settings.within_m,
        )
        return advice(findings) | self._single.remarks() | ({"": remark} if remark else {})


def main(args: list[str] | None = None) -> int:
    """Run the node; the exit code is 0 unless it could not start."""
    return run_node(BackgroundNode, plain_command_line("background", _DOES, args))


if __name__ == "__main__":
    sys.exit(main())
