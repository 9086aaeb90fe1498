"""The node ``stereo_depth`` measures depth images from the images of a rectified pair."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from cardbox_tracker.camera.camera import Calibration, Camera, Rectifier
from cardbox_tracker.camera.camera_info import calibration_from_info
from cardbox_tracker.camera.encodings import to_working_size
from cardbox_tracker.camera.extrinsics_files import of_rectified_pair
from cardbox_tracker.camera.stereo import NEAREST_M, StereoDepth, stereo_of_pair
from cardbox_tracker.common.errors import CameraError
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.nodes.camera_images import image_topic
from cardbox_tracker.ros.nodes.input_stream import RecentImages
from cardbox_tracker.ros.nodes.shared_parameters import image_transport_parameter
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.command_line import node_main
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.ros.runtime.parameter_fields import NodeParameters, at_start, parameter
from cardbox_tracker.ros.runtime.parameters import LiveParameters

# Largest number of images of one side that wait for the other side.
_KEPT = 4
# Pairs between two looks at whether the sides are swapped.
_LOOK_AGAIN = 30


@dataclass(frozen=True)
class StereoDepthParameters(NodeParameters):
    """Measure depth in a rectified pair of cameras, by semi-global matching."""

    image_transport: str = image_transport_parameter()
    width: int = at_start(320, "width at which depth is measured", unit="px", limits=(32, 4096))
    nearest_m: float = parameter(
        NEAREST_M,
        "nearer objects are not found; smaller values cost more time",
        unit="m",
        limits=(0.1, 20.0),
    )
    tolerance_s: float = parameter(
        0.005,
        "largest difference of the stamps of a left and a right image that form a pair",
        unit="s",
        limits=(0.0, 1.0),
    )


class _Pair(NamedTuple):
    """Data of both CameraInfo, kept until one of them changes."""

    calibrations: list[Calibration]
    rectifiers: list[Rectifier | None]
    camera: Camera
    stereo: StereoDepth


class StereoDepthNode(CardboxNode):
    """Pairs left and right images by their stamps and measures depth in the left one."""

    def __init__(self, **options: Any) -> None:
        super().__init__("stereo_depth", **options)
        self.parameters = LiveParameters(self, StereoDepthParameters, self._changed)
        settings = self.parameters.value
        self._infos: dict[str, CameraInfo] = {}
        self._pair: _Pair | None = None
        self._known, self._measured, self._are_swapped = 0.0, 0, False
        self._depth = self.advertise(Image, "depth", qos.SILHOUETTE)
        self._depth_info = self.advertise(CameraInfo, "depth/camera_info", qos.SILHOUETTE)
        images = {
            side: image_topic(self, f"{side}/image_raw", settings.image_transport)
            for side in ("left", "right")
        }
        self._topics = {side: topic for side, (topic, _) in images.items()}
        self._kept = {side: RecentImages(_KEPT) for side in ("left", "right")}
        for side in images:
            self.subscribe_info(f"{side}/camera_info", partial(self._on_info, side))
        for side, (topic, kind) in images.items():
            self.subscribe(kind, topic, partial(self._on_image, side), qos.SENSOR_DATA)
        self.diagnostics.extra = lambda: {"known (% of the image)": f"{100 * self._known:.1f}"}
        self.diagnostics.advice = self._warnings
        self.diagnostics.remedy = "take smaller images, or fewer a second"
        self.diagnostics.source = f"images on {self._topics['left']}"
        self.diagnostics.wait_for(
            f"images on {self._topics['left']} and {self._topics['right']}, and the CameraInfo of "
            "both"
        )

    def _changed(self, _: StereoDepthParameters) -> None:
        self._pair = None

    def _on_info(self, side: str, message: CameraInfo, _: int) -> None:
        before = self._infos.get(side)
        self._infos[side] = message
        if before is None or not conversions.is_same_info(before, message):
            self._pair = None

    def _on_image(self, side: str, message: Image | CompressedImage, sent_ns: int) -> None:
        """Measure the latest pair of matching stamps, and drop older images."""
        stamp_ns = conversions.stamp_ns(message.header.stamp)
        if side == "left" and not self.diagnostics.arrived(stamp_ns).is_usable:
            return
        self._kept[side].append(message)
        tolerance_ns = 1e9 * self.parameters.value.tolerance_s
        for left in reversed(self._kept["left"]):
            stamp_ns = conversions.stamp_ns(left.header.stamp)
            for right in reversed(self._kept["right"]):
                if abs(conversions.stamp_ns(right.header.stamp) - stamp_ns) <= tolerance_ns:
                    for side, message in (("left", left), ("right", right)):
                        while self._kept[side].popleft() is not message:
                            pass
                    self._measure(left, right, sent_ns)
                    return

    def _measure(
        self, left: Image | CompressedImage, right: Image | CompressedImage, sent_ns: int
    ) -> None:
        if len(self._infos) < len(self._topics):
            missing = " and ".join(
                self.resolve(f"{side}/camera_info")
                for side in self._topics
                if side not in self._infos
            )
            self.diagnostics.wait_for(f"the CameraInfo on {missing}")
            return
        if self._pair is None:
            self._pair = self._pair_of_infos()
        pair, images = self._pair, []
        for message, calibration, rectifier in zip(
            (left, right), pair.calibrations, pair.rectifiers, strict=True
        ):
            most = conversions.most_pixels_of(calibration)
            image = conversions.image_of(message, most)
            image = to_working_size(image, pair.camera.width, pair.camera.height)
            images.append(image if rectifier is None else rectifier(image))
        depth_m = pair.stereo(*images)
        if self._measured % _LOOK_AGAIN == 0:
            self._are_swapped = pair.stereo.seem_swapped(images[0], images[1], depth_m)
        self._measured += 1
        self._known = float(np.count_nonzero(depth_m) / depth_m.size)
        depth_m[depth_m == 0.0] = np.nan
        self._depth.publish(conversions.image_message(left.header, depth_m, "32FC1"))
        self._depth_info.publish(conversions.camera_info_message(left.header, pair.camera))
        self.diagnostics.working(sent_ns)

    def _warnings(self) -> dict[str, str]:
        if not self._are_swapped:
            return {}
        return {
            "swapped": f"{100 * self._known:.0f} % of the pixels have a depth, and more would have "
            f"one with the images exchanged; are {self._topics['left']} and "
            f"{self._topics['right']} swapped?"
        }

    def _pair_of_infos(self) -> _Pair:
        """Return the data of both CameraInfo; raise CameraError if they are not rectified."""
        settings = self.parameters.value
        calibrations = [
            calibration_from_info(self._infos[side], topic, self.resolve(f"{side}/camera_info"))
            for side, topic in self._topics.items()
        ]
        where = of_rectified_pair(self._infos["left"], self._infos["right"], "the right camera")
        if where is None:
            raise CameraError(
                "the cameras are not a rectified pair: expected P[0,3] = -fx B below 0 in "
                f"{self.resolve('right/camera_info')}; calibrate them together, and rectify "
                "the images with stereo_image_proc"
            )
        width = settings.width
        height = round(width * calibrations[0].height / calibrations[0].width)
        camera, other = (calibration.camera(width, height) for calibration in calibrations)
        return _Pair(
            calibrations,
            [calibration.rectifier(width, height) for calibration in calibrations],
            camera,
            stereo_of_pair(camera, other, where, settings.nearest_m),
        )


main = node_main("stereo_depth", StereoDepthNode, StereoDepthParameters)
