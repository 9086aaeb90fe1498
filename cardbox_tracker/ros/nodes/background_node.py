"""The node ``background``: images in, silhouettes out."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from sensor_msgs.msg import Image
from std_msgs.msg import Header

from cardbox_tracker.camera.camera import Calibration, Camera
from cardbox_tracker.camera.stamps import StampOrder
from cardbox_tracker.common.errors import BackgroundFileError, CameraError
from cardbox_tracker.common.health import WATCHES
from cardbox_tracker.common.progress import told
from cardbox_tracker.person.model import PLACEMENT
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.nodes.camera_images import CameraImages, SilhouetteOutputs
from cardbox_tracker.ros.nodes.depth_input import DepthCut
from cardbox_tracker.ros.nodes.shared_parameters import (
    camera_roll_parameter,
    depth_parameter,
    height_parameter,
    image_transport_parameter,
    width_parameter,
)
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.command_line import node_main
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.ros.runtime.parameter_fields import NodeParameters, at_start, parameter
from cardbox_tracker.ros.runtime.parameters import LiveParameters
from cardbox_tracker.segmentation.background import warm_up
from cardbox_tracker.segmentation.background_config import BackgroundConfig
from cardbox_tracker.segmentation.background_file import background_path
from cardbox_tracker.segmentation.kept_background import KeptBackground
from cardbox_tracker.segmentation.learning import WAYS
from cardbox_tracker.segmentation.silhouettes import SilhouettePipeline, nearest_m

# The default shared-memory segment of Fast DDS holds half a megabyte, less its own data.
_LARGE_IMAGE_BYTES = 400_000

_NEXT_LEARNING = "next learning"


@dataclass(frozen=True)
class BackgroundParameters(NodeParameters, BackgroundConfig):
    """Cut the person out of a camera's images: images in, silhouettes out."""

    effects = MappingProxyType({"learn_images": _NEXT_LEARNING})
    image_transport: str = image_transport_parameter()
    width: int = width_parameter()
    height: int = height_parameter()
    background_file: str = at_start(
        "",
        "file of the learned background; if it exists at the start and fits the camera and the "
        "scene, nothing has to be learned, even with a person in view; empty: none",
    )
    within_m: float = parameter(
        0.0,
        "with depth images: pixels nearer than this are the person, and nothing has to be "
        "learned; choose a distance between the person and the wall; 0: learn the empty scene",
        unit="m",
        limits=(0.0, PLACEMENT["distance_m"][1]),
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
    camera_roll_deg: float = camera_roll_parameter()

    def check(self) -> None:
        """Raise ValueError if values contradict each other."""
        if self.camera_roll_deg and self.depth:
            raise ValueError(
                f"camera_roll_deg is {self.camera_roll_deg:g}, but depth images are not turned; "
                "turn the camera upright, or leave depth empty"
            )
        if self.within_m > 0.0 and not self.depth:
            raise ValueError(
                f"within_m is {self.within_m:g} but no depth is given; set 'depth' to a topic of "
                "depth images, or within_m to 0"
            )


class BackgroundNode(CardboxNode):
    """Learns the empty scene and cuts out the person who enters it."""

    def __init__(self, **options: Any) -> None:
        super().__init__("background", **options)
        self.parameters = LiveParameters(self, BackgroundParameters, self._changed)
        settings = self.parameters.value
        path = background_path(settings.background_file)
        self._kept = KeptBackground(path, (settings.width, settings.height))
        self._pipeline: SilhouettePipeline | None = None
        self._image: conversions.ImageArray | None = None
        self._in_this_round = 0
        self._outputs = SilhouetteOutputs(self)
        self._mean = self.advertise(Image, "~/mean", qos.LATCHED)
        self._stddev = self.advertise(Image, "~/stddev", qos.LATCHED)
        # The initializer waits for a node that already advertises silhouettes.
        with told(self.get_logger().info, "preparing (the very first start compiles)"):
            warm_up()
        self.camera_images = CameraImages(
            self,
            settings.image_transport,
            self._on_calibration,
            self._on_image,
            roll_deg=settings.camera_roll_deg,
        )
        self._cut = DepthCut(self, settings.depth, self._send) if settings.depth else None
        self.offer("~/learn", self._learn)
        self.diagnostics.extra = self._values
        self.diagnostics.remedy = "take a smaller working resolution, or fewer images a second"
        self.diagnostics.advice = self._advice

    def _changed(self, settings: BackgroundParameters) -> None:
        if self._pipeline is not None:
            self._pipeline.config = settings

    def _learn(self) -> str:
        if self.parameters.value.within_m > 0.0:
            return "nothing has to be learned: within_m is set, so depth shows the person"
        if self._pipeline is None or self._image is None:
            topic, info_topic = self.camera_images.topic, self.camera_images.info_topic
            raise CameraError(
                f"no image was received yet on {topic}, so nothing can be learned; is the camera "
                f"running, and its CameraInfo on {info_topic}? See 'ros2 topic hz {topic}'"
            )
        self._kept.forget()
        self._pipeline.relearn(WAYS[self.parameters.value.learning])
        return f"waiting for {self._pipeline.learning.waits_for(self.camera_images.topic)}"

    def _on_calibration(self, calibration: Calibration) -> None:
        settings = self.parameters.value
        if self._pipeline is not None and self._pipeline.calibration.is_resized(calibration):
            self._pipeline.calibration = calibration
            return
        if self._pipeline is not None:
            self._kept.carry_over(self._pipeline.model)
        self._image = None
        self._pipeline = SilhouettePipeline(
            calibration, (settings.width, settings.height), settings, WAYS[settings.learning]
        )

    def _on_image(self, header: Header, full: conversions.ImageArray, sent_ns: int) -> None:
        pipeline = self._pipeline
        assert pipeline is not None
        if self.camera_images.order is StampOrder.RESTART:
            # A recording with fewer images than are learned needs several rounds.
            if not pipeline.is_ready and self._in_this_round >= pipeline.learning.images:
                pipeline.relearn()
            self._in_this_round = 0
        self._in_this_round += 1
        self._image = image = pipeline.prepare(full)
        within_m = self.parameters.value.within_m
        if self._cut is not None and within_m > 0.0:
            self._outputs.send_image(header, image)
            self._cut.add(header, pipeline.camera, within_m, sent_ns)
            return
        if not pipeline.is_ready:
            self._prepare(header, pipeline, image)
        if pipeline.is_ready:
            self._outputs.send_image(header, image)
            silhouette = pipeline.silhouette(image, conversions.stamp_ns(header.stamp))
            self._send(header, silhouette, pipeline.camera, sent_ns)

    def _prepare(
        self, header: Header, pipeline: SilhouettePipeline, image: conversions.ImageArray
    ) -> None:
        done = self._kept.resume(pipeline, image)
        if not done:
            pipeline.learning.add(image)
            if not pipeline.learning.has_enough():
                self.diagnostics.wait_for(pipeline.learning.waits_for(self.camera_images.topic))
                return
            pipeline.finish_learning()
            done = f"background learned from {pipeline.learning.count} images"
            try:
                done += self._kept.keep(pipeline)
            except BackgroundFileError as error:
                self.diagnostics.warn(str(error))
        model = pipeline.model
        assert model is not None
        self._mean.publish(conversions.image_message(header, model.mean, "32FC1"))
        self._stddev.publish(conversions.image_message(header, model.stddev, "32FC1"))
        self.get_logger().info(done)

    def _send(
        self, header: Header, silhouette: conversions.ImageArray, camera: Camera, sent_ns: int
    ) -> None:
        self._outputs.send(header, silhouette, camera, self.camera_images.info)
        self.diagnostics.working(sent_ns)

    def _values(self) -> dict[str, str]:
        values = {
            "background learned from": f"0/{self.parameters.value.learn_images}",
            "foreground (% of the image)": f"{100 * self._outputs.covered:.1f}",
            "scene brightness drift (grey levels)": f"{self._drift():.1f}",
            "ignored CameraInfo": str(self.camera_images.watch.ignored),
        }
        if self._cut is not None:
            values["nearest depth (m)"] = f"{nearest_m(self._cut.depth_m):.2f}"
        if self._kept.path is not None:
            values["background file"] = self._kept.use
        if self._pipeline is not None:
            values |= self._pipeline.learning.values()
        return values

    def _drift(self) -> float:
        if self._pipeline is None or self._image is None:
            return 0.0
        return self._pipeline.drift(self._image)

    def _advice(self) -> dict[str, str]:
        """Return what a user should do about the images, a text for each kind of trouble."""
        settings, texts = self.parameters.value, self.camera_images.remarks()
        # A slow node leaves images out, and of a burst most, which are not lost on the way.
        is_left_out = self.diagnostics.is_slow or self.diagnostics.arrivals.has_burst
        loss = 0.0 if is_left_out else self.diagnostics.input.loss
        image_bytes, covered = self.camera_images.image_bytes, self._outputs.covered
        if image_bytes > _LARGE_IMAGE_BYTES:
            given = {"topic": self.camera_images.topic, "kilobytes": image_bytes // 1000}
            texts["loss"] = WATCHES["loss"].remark(100.0 * loss, **given)
        follows = settings.follow and settings.clean_up
        drift = 0.0 if follows else abs(self._drift())
        if settings.within_m > 0.0:
            texts["depth"] = WATCHES["near"].remark(covered, within_m=settings.within_m)
        elif "exposure" not in texts and (
            WATCHES["drift"].is_beyond(drift) or WATCHES["near"].is_beyond(covered)
        ):
            texts["brightness"] = WATCHES["drift"].words
        return {kind: text for kind, text in texts.items() if text}


main = node_main("background", BackgroundNode, BackgroundParameters)
