"""What the tracker publishes for each image."""

from __future__ import annotations

from typing import Any

from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Bool, Header, String

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.description.rep155 import Rep155Joints, joint_names
from cardbox_tracker.description.rep155_urdf import rep155_urdf
from cardbox_tracker.drawing.overlay import draw_message, draw_overlay
from cardbox_tracker.estimation.tracker import Estimate, Tracker
from cardbox_tracker.outputs import OUTPUTS, JointValues, Output, OutputStream
from cardbox_tracker.ros.messages import conversions, results
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode


class TrackerOutputs:
    """The tracker's topics; each message is made only while the topic has a subscriber."""

    def __init__(self, node: CardboxNode, rep155_id: str) -> None:
        """Advertise the topics for ``node``, those of REP-155 unless ``rep155_id`` is empty."""
        self._publishers = {
            output.topic: node.advertise(
                results.message_type(output.kind), output.topic, qos.RESULT
            )
            for output in OUTPUTS
        }
        self._stream = OutputStream()
        self._overlay = node.advertise(Image, "overlay", qos.SENSOR_DATA)
        self._human = Rep155Outputs(node, rep155_id) if rep155_id else None
        self._guided = False
        node.subscribe(Bool, "initializer/guiding", self._on_guiding, qos.LATCHED)

    def _on_guiding(self, message: Bool, _: int) -> None:
        self._guided = message.data

    def publish(
        self,
        header: Header,
        estimate: Estimate,
        silhouette: conversions.ImageArray,
        tracker: Tracker,
    ) -> None:
        """Publish the outputs of an image; without a posture, no old one under its stamp."""
        for output, value in self._stream.values(estimate, tracker, self._is_wanted):
            self._publishers[output.topic].publish(results.message_of(header, value))
        if self._human is not None and estimate.posture is not None:
            self._human.publish(header, estimate.posture, tracker)
        if _wanted(self._overlay) and not self._guided:
            image = draw_overlay(silhouette, tracker.body, tracker.camera, estimate)
            self._overlay.publish(conversions.image_message(header, image, "bgr8"))

    def _is_wanted(self, output: Output) -> bool:
        return _wanted(self._publishers[output.topic])

    def waiting(self, message: Image, text: str) -> None:
        """Publish on ``overlay`` the silhouette and what the tracker waits for."""
        if not _wanted(self._overlay) or self._guided:
            return
        image = draw_message(conversions.silhouette_of(message), text)
        self._overlay.publish(conversions.image_message(message.header, image, "bgr8"))


class Rep155Outputs:
    """``/humans/bodies/<id>/joint_states`` and the URDF of those joints, latched, beside it."""

    def __init__(self, node: CardboxNode, body_id: str) -> None:
        """Advertise the topics of the body ``body_id``."""
        self._id = body_id
        self._names = tuple(joint_names(body_id))
        self._convert = Rep155Joints()
        self._described: tuple[Any, str] | None = None
        place = f"/humans/bodies/{body_id}"
        self._joints = node.advertise(JointState, f"{place}/joint_states", qos.RESULT)
        self._description = node.advertise(String, f"{place}/robot_description", qos.LATCHED)

    def publish(self, header: Header, posture: FloatArray, tracker: Tracker) -> None:
        """Publish a posture (12,), before it the URDF if the person is another."""
        if self._described != (tracker.body, header.frame_id):
            self._described = (tracker.body, header.frame_id)
            self._convert = Rep155Joints()
            urdf = rep155_urdf(tracker.body, self._id, header.frame_id or "camera_optical_frame")
            self._description.publish(String(data=urdf))
        joints = JointValues(self._names, self._convert(posture))
        self._joints.publish(results.joint_state_message(header, joints))


def _wanted(publisher: Any) -> bool:
    return bool(publisher.get_subscription_count())
