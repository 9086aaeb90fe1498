"""The nodes in this process, without DDS, for quick tests of faults in the stream of images."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import rclpy
from builtin_interfaces.msg import Time
from rclpy.context import Context
from rclpy.parameter import Parameter
from std_msgs.msg import Header

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message, stamp_ns
from cardbox_tracker.ros.nodes.background_node import BackgroundNode
from cardbox_tracker.ros.nodes.camera_inputs import ObservationSet
from cardbox_tracker.ros.nodes.tracker_node import TrackerNode
from cardbox_tracker.ros.runtime.node import IntraProcess
from cardbox_tracker.tracking.estimate import Estimate
from lab.tools.fault_scene import EMPTY, START_NS, Found, Person, S, Sent

LEARN_IMAGES = 5


def header_of(stamp_ns: int) -> Header:
    """Return a header with the stamp."""
    return Header(frame_id="camera", stamp=Time(sec=stamp_ns // S, nanosec=stamp_ns % S))


class InsideNodes:
    """Background and tracker node, which get images one by one, so that load drops none."""

    def __init__(self, person: Person, folder: Path) -> None:
        """Start them and teach the background; files go to ``folder``."""
        self.person, self.found = person, list[Found]()
        self._context = Context()
        rclpy.init(context=self._context, args=[])
        self._model, self._file = folder / "body.yaml", folder / "background.npz"
        save_body_model(person.body, self._model)
        self._inside = IntraProcess()
        self.background = self._start_background()
        self.tracker = self._start_tracker()
        for number in range(-3 * LEARN_IMAGES, 0):
            self.send(Sent(START_NS + number * S // 15, 0.0, shows=EMPTY))

    def _node(self, kind: Any, **parameters: Any) -> Any:
        make: Any = Parameter
        overrides = [make(name, value=value) for name, value in parameters.items()]
        return kind(
            intra_process=self._inside,
            context=self._context,
            enable_rosout=False,
            parameter_overrides=overrides,
        )

    def _start_background(self) -> BackgroundNode:
        camera = self.person.camera
        node: BackgroundNode = self._node(
            BackgroundNode,
            learn_images=LEARN_IMAGES,
            background_file=str(self._file),
            width=camera.width,
            height=camera.height,
        )
        return node

    def _start_tracker(self) -> TrackerNode:
        node: TrackerNode = self._node(TrackerNode, model_file=str(self._model))

        def note(seen: ObservationSet, estimate: Estimate, _: Any) -> None:
            stamp = stamp_ns(seen.header.stamp)
            self.found.append(Found(stamp, estimate.posture, estimate.offset_m))

        node._outputs[0].publish = note  # type: ignore[method-assign, assignment]
        return node

    def send(self, sent: Sent) -> None:
        """Hand an image and its CameraInfo to the background node."""
        header = header_of(sent.stamp_ns)
        node, images = self.background, self.background.camera_images
        try:
            images.on_info(camera_info_message(header, self.person.camera), 0)
            images.on_image(image_message(header, self.person.image(sent), "mono8"), 0)
        except CardboxError as error:
            node.diagnostics.problem(str(error))

    def send_all(self, images: Iterable[Sent]) -> None:
        """Hand over images at once, without their pauses."""
        for sent in images:
            self.send(sent)

    def restart(self) -> None:
        """Replace both nodes by new ones, as after a crash: only files remain."""
        for node in (self.tracker, self.background):
            node.destroy_node()  # type: ignore[no-untyped-call]
        self._inside = IntraProcess()
        self.background, self.tracker = self._start_background(), self._start_tracker()

    def close(self) -> None:
        """Stop the nodes."""
        for node in (self.tracker, self.background):
            node.close()
            node.destroy_node()  # type: ignore[no-untyped-call]
        self._context.try_shutdown()
