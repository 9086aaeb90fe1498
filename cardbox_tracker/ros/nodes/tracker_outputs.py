"""What the tracker publishes for each image."""

from __future__ import annotations

from typing import Any

import numpy as np
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Bool, Header, String

from cardbox_tracker.description.rep155 import Rep155Joints, joint_names
from cardbox_tracker.description.rep155_urdf import rep155_urdf
from cardbox_tracker.drawing.overlay import draw_message, draw_overlay
from cardbox_tracker.estimation.tracker import Estimate, Tracker
from cardbox_tracker.outputs import JointValues, Output, OutputStream, outputs, place_of
from cardbox_tracker.ros.messages import conversions, results
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode


class TrackerOutputs:
    """The tracker's topics; each message is made only while the topic has a subscriber."""

    def __init__(self, node: CardboxNode, settings: TrackerParameters) -> None:
        """Advertise the topics for ``node``, those of REP-155 if ``settings`` have its ID."""
        topics = outputs(settings.torso_place)
        self._publishers = {
            output.topic: node.advertise(
                results.message_type(output.kind), output.topic, qos.RESULT
            )
            for output in topics
        }
        self._stream = OutputStream(topics)
        self._overlay = node.advertise(Image, "overlay", qos.SENSOR_DATA)
        self._human = Rep155Outputs(node, settings) if settings.rep155_id else None
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
        if self._human is not None:
            self._human.publish(header, estimate, tracker)
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

    def __init__(self, node: CardboxNode, settings: TrackerParameters) -> None:
        """Advertise the topics of the body ``settings.rep155_id``."""
        self._id = body_id = settings.rep155_id
        self._torso_place = settings.torso_place
        self._names = tuple(joint_names(body_id, settings.torso_place))
        self._convert = Rep155Joints()
        self._described: tuple[Any, str] | None = None
        place = f"/humans/bodies/{body_id}"
        self._joints = node.advertise(JointState, f"{place}/joint_states", qos.RESULT)
        self._description = node.advertise(String, f"{place}/robot_description", qos.LATCHED)

    def publish(self, header: Header, estimate: Estimate, tracker: Tracker) -> None:
        """Publish the posture if there is one, before it the URDF if the person is another."""
        if estimate.posture is None:
            return
        if self._described != (tracker.body, header.frame_id):
            self._described = (tracker.body, header.frame_id)
            self._convert = Rep155Joints()
            frame_id = header.frame_id or "camera_optical_frame"
            urdf = rep155_urdf(tracker.body, self._id, frame_id, self._torso_place)
            self._description.publish(String(data=urdf))
        values = self._convert(estimate.posture)
        if self._torso_place:
            values = np.concatenate([values, place_of(estimate)])
        joints = JointValues(self._names, values)
        self._joints.publish(results.joint_state_message(header, joints))


def _wanted(publisher: Any) -> bool:
    return bool(publisher.get_subscription_count())
