"""What the tracker publishes of one image."""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import PoseArray
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Header, String
from visualization_msgs.msg import MarkerArray

from cardbox_tracker.description.rep155 import Rep155Joints, joint_names
from cardbox_tracker.description.rep155_urdf import rep155_urdf
from cardbox_tracker.drawing.overlay import draw_message, draw_overlay
from cardbox_tracker.estimation.initialization.guidance import step_of
from cardbox_tracker.estimation.tracker import Estimate, Tracker
from cardbox_tracker.ros.messages import conversions, results
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode


class TrackerOutputs:
    """The tracker's topics; what costs time is made only while somebody subscribes."""

    def __init__(self, node: CardboxNode, rep155_id: str) -> None:
        """Advertise the topics for ``node``, those of REP-155 unless ``rep155_id`` is empty."""
        self._joints = node.advertise(JointState, "joint_states", qos.RESULT)
        self._deviations = node.advertise(JointState, "joint_states_stddev", qos.RESULT)
        self._keypoints = node.advertise(PoseArray, "keypoints", qos.RESULT)
        self._markers = node.advertise(MarkerArray, "markers", qos.RESULT)
        self._overlay = node.advertise(Image, "overlay", qos.SENSOR_DATA)
        self._human = Rep155Outputs(node, rep155_id) if rep155_id else None
        self._state = ""
        self._guided = False
        node.subscribe(String, "initializer/status", self._on_status, qos.LATCHED)

    def _on_status(self, message: String, _: int) -> None:
        self._guided = step_of(message.data) is not None

    def publish(
        self,
        header: Header,
        estimate: Estimate,
        silhouette: conversions.ImageArray,
        tracker: Tracker,
    ) -> None:
        """Publish a posture only where there is one: nothing stale under a new stamp."""
        if estimate.posture is not None:
            self._joints.publish(results.joint_state_message(header, estimate.posture))
            if self._human is not None:
                self._human.publish(header, estimate, tracker)
            if estimate.posture_stddev is not None and _wanted(self._deviations):
                self._deviations.publish(
                    results.joint_state_message(header, estimate.posture_stddev)
                )
            if estimate.keypoints_m is not None and _wanted(self._keypoints):
                self._keypoints.publish(results.keypoints_message(header, estimate.keypoints_m))
            if _wanted(self._markers):
                self._markers.publish(
                    results.markers_message(header, tracker.body, tracker.camera, estimate.posture)
                )
        elif self._state != estimate.state:
            self._markers.publish(results.no_markers_message(header))
        self._state = estimate.state
        if _wanted(self._overlay) and not self._guided:
            image = draw_overlay(silhouette, tracker.body, tracker.camera, estimate)
            self._overlay.publish(conversions.image_message(header, image, "bgr8"))

    def waiting(self, message: Image, text: str) -> None:
        """Show a silhouette and what the tracker waits for, where the overlay would be."""
        if not _wanted(self._overlay) or self._guided:
            return
        image = draw_message(conversions.silhouette_of(message), text)
        self._overlay.publish(conversions.image_message(message.header, image, "bgr8"))


class Rep155Outputs:
    """``/humans/bodies/<id>/joint_states`` and the URDF of those joints, latched, beside it."""

    def __init__(self, node: CardboxNode, body_id: str) -> None:
        """Advertise the topics of the body ``body_id``."""
        self._id = body_id
        self._names = joint_names(body_id)
        self._convert = Rep155Joints()
        self._described: tuple[Any, str] | None = None
        place = f"/humans/bodies/{body_id}"
        self._joints = node.advertise(JointState, f"{place}/joint_states", qos.RESULT)
        self._description = node.advertise(String, f"{place}/robot_description", qos.LATCHED)

    def publish(self, header: Header, estimate: Estimate, tracker: Tracker) -> None:
        """Publish the posture of ``estimate``, before it the URDF if the person is another."""
        assert estimate.posture is not None
        if self._described != (tracker.body, header.frame_id):
            self._described = (tracker.body, header.frame_id)
            self._convert = Rep155Joints()
            urdf = rep155_urdf(tracker.body, self._id, header.frame_id or "camera_optical_frame")
            self._description.publish(String(data=urdf))
        values = self._convert(estimate.posture)
        self._joints.publish(results.joint_state_message(header, values, self._names))


def _wanted(publisher: Any) -> bool:
    return bool(publisher.get_subscription_count())
