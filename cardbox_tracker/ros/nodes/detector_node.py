"""The node ``detector``: images in, 2D points of the person's joints and silhouettes out."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from cardbox_tracker.camera.camera import Calibration, unrectified
from cardbox_tracker.camera.stamps import WINDOW, StampOrder
from cardbox_tracker.detectors.detector import Detector, PersonDetector
from cardbox_tracker.detectors.pose_network import NOBODY, Detection, silhouette_of
from cardbox_tracker.ros.messages.conversions import ImageArray, stamp_ns
from cardbox_tracker.ros.messages.keypoints import people_message, skeleton_class, skeleton_message
from cardbox_tracker.ros.nodes.camera_images import CameraImages, SilhouetteOutputs
from cardbox_tracker.ros.nodes.shared_parameters import (
    camera_roll_parameter,
    height_parameter,
    image_transport_parameter,
    width_parameter,
)
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.command_line import node_main
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.ros.runtime.parameter_fields import NodeParameters, at_start, parameter
from cardbox_tracker.ros.runtime.parameters import LiveParameters
from cardbox_tracker.ros.runtime.publishers import SinglePublisher
from cardbox_tracker.segmentation.silhouettes import SilhouettePipeline
from cardbox_tracker.tracking.session import MOST_PEOPLE

_NICE = 5


@dataclass(frozen=True)
class DetectorParameters(NodeParameters):
    """Find a person with a neural network: images in, 2D points and silhouettes out."""

    image_transport: str = image_transport_parameter()
    width: int = width_parameter()
    height: int = height_parameter()
    publish_silhouette: bool = at_start(
        False,
        "also publish the person's mask on silhouette, instead of the node background, which must "
        "not run beside it",
    )
    people: int = at_start(
        0, "number of people to find at most; 0: one, who is followed", limits=(0, MOST_PEOPLE)
    )
    rate_hz: float = parameter(
        10.0,
        "most images a second to look at, which leaves processor time to the tracker; 0: as many "
        "as it manages, as always with publish_silhouette",
        unit="Hz",
        limits=(0.0, 240.0),
    )
    camera_roll_deg: float = camera_roll_parameter()


class DetectorNode(CardboxNode):
    """Looks at the newest image; images that come in the meantime are left out."""

    def __init__(self, person: PersonDetector | None = None, **options: Any) -> None:
        """Load the networks, unless a ``person`` is given that finds people, and subscribe.

        Raises CardboxError if the detector is not installed.
        """
        super().__init__("detector", **options)
        self.parameters = LiveParameters(self, DetectorParameters)
        settings = self.parameters.value
        if person is None and not settings.publish_silhouette:
            # The tracker goes first; the threads of the networks inherit this.
            os.nice(_NICE)
        self._person = person or Detector.installed(settings.people).start()
        self._pipeline: SilhouettePipeline | None = None
        self._looked_ns = 0
        self._took_ms: deque[float] = deque(maxlen=WINDOW)
        self._keypoints = self.advertise(PointCloud2, "~/keypoints", qos.RESULT)
        self._skeleton_kind = skeleton_class()
        self._skeletons = (
            None
            if self._skeleton_kind is None
            else self.advertise(self._skeleton_kind, "~/skeleton2d", qos.RESULT)
        )
        self._silhouettes = SilhouetteOutputs(self) if settings.publish_silhouette else None
        self.diagnostics.extra = self._values
        self._images = CameraImages(
            self,
            settings.image_transport,
            self._on_calibration,
            self._on_image,
            settings.camera_roll_deg,
        )
        own = (self.resolve("silhouette"),) if settings.publish_silhouette else ()
        self._single = SinglePublisher(self, own)
        self.diagnostics.advice = lambda: self._images.remarks() | self._single.remarks()

    def _on_calibration(self, calibration: Calibration) -> None:
        settings = self.parameters.value
        self._pipeline = SilhouettePipeline(calibration, (settings.width, settings.height))
        self._person.restart()

    def _on_image(self, header: Header, full: ImageArray, sent_ns: int) -> None:
        pipeline = self._pipeline
        assert pipeline is not None
        if self._images.order is StampOrder.RESTART:
            self._person.restart()
            self._looked_ns = 0
        if not self._is_due(stamp_ns(header.stamp)):
            return
        began_s = time.perf_counter()
        image = pipeline.prepare(full)
        found = self._person.all_in(stamp_ns(header.stamp), image)
        self._took_ms.append(1e3 * (time.perf_counter() - began_s))
        self._send_points(header, found, pipeline)
        if self._silhouettes is not None:
            self._silhouettes.send_image(header, image)
            silhouette = silhouette_of(found, image.shape)
            self._silhouettes.send(header, silhouette, pipeline.camera, self._images.info)
        self.diagnostics.working(sent_ns)

    def _is_due(self, at_ns: int) -> bool:
        rate_hz = self.parameters.value.rate_hz
        if rate_hz > 0.0 and at_ns and self._silhouettes is None:
            # The image nearest to the time is taken, not the first one after it.
            early_ns = self.diagnostics.input.period_ns / 2
            if at_ns - self._looked_ns + early_ns < 1e9 / rate_hz:
                return False
            self._looked_ns = at_ns
        return True

    def _send_points(
        self, header: Header, found: Sequence[Detection], pipeline: SilhouettePipeline
    ) -> None:
        """Publish all points in the camera's own image, and the first skeleton."""
        calibration, camera = pipeline.calibration, pipeline.camera
        size = camera.width, camera.height
        people = [
            one._replace(
                points_px=unrectified(calibration, one.points_px, *size),
                spatial_m=None if one.spatial_m is None else one.spatial_m @ calibration.turn(),
            )
            for one in found
        ]
        self._keypoints.publish(people_message(header, people))
        if self._skeletons is not None:
            one = people[0] if people else NOBODY
            size = calibration.width, calibration.height
            skeleton = skeleton_message(
                self._skeleton_kind, header, one.points_px, one.scores, size
            )
            self._skeletons.publish(skeleton)

    def _values(self) -> dict[str, str]:
        values = {
            "images without a person": str(self._person.missed),
            "ignored CameraInfo": str(self._images.watch.ignored),
        }
        if self._person.remark:
            values["several people"] = self._person.remark
        if self._took_ms:
            values["time of an image (ms)"] = f"{np.median(self._took_ms):.1f}"
        if self._silhouettes is not None:
            values["foreground (% of the image)"] = f"{100 * self._silhouettes.covered:.1f}"
        return values


main = node_main("detector", DetectorNode, DetectorParameters)
