"""The tracker's topics, also those after REP-155 below ``/humans``."""

from __future__ import annotations

from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Bool, Header, String

from cardbox_tracker.applications.drawing.overlay import draw_camera_overlay, draw_message
from cardbox_tracker.camera.camera import OPTICAL_FRAME
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import dumps_body_model
from cardbox_tracker.person.rep155 import Rep155Joints, joint_names
from cardbox_tracker.person.urdf import rep155_urdf
from cardbox_tracker.recordings.messages import pose_message
from cardbox_tracker.recordings.outputs import TOPICS, JointValues, OutputStream, person_space
from cardbox_tracker.recordings.person_poses import POSES, person_poses
from cardbox_tracker.ros.messages import conversions, results
from cardbox_tracker.ros.messages.types import class_of, new_message, optional_class
from cardbox_tracker.ros.nodes.camera_inputs import ObservationSet
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.tracker import Tracker


class TrackedBodies:
    """Publishes the list of the bodies that are tracked, once an image."""

    def __init__(self, node: CardboxNode, count: int = 1) -> None:
        """Advertise the list of up to ``count`` bodies, if the package hri_msgs is installed."""
        self._ids_list = optional_class("hri_msgs", "IdsList")
        self._publisher = (
            None
            if self._ids_list is None
            else node.advertise(self._ids_list, "/humans/bodies/tracked", qos.RESULT)
        )
        self._count, self._there = count, list[str | None]()

    def see(self, header: Header, body_id: str | None) -> None:
        """Take the next body of an image, None if it is not tracked; publish after the last one."""
        self._there.append(body_id)
        if len(self._there) < self._count:
            return
        ids, self._there = [one for one in self._there if one is not None], []
        if self._publisher is not None:
            self._publisher.publish(self._ids_list(header=header, ids=ids))


class Rep155Outputs:
    """Publishes joints, URDF and presence of a body."""

    def __init__(
        self, node: CardboxNode, settings: TrackerParameters, body_id: str, bodies: TrackedBodies
    ) -> None:
        self._id, self._bodies = body_id, bodies
        self._torso_place = settings.torso_place
        self._names = tuple(joint_names(body_id, settings.torso_place))
        self._convert = Rep155Joints()
        self._described: tuple[Any, str] | None = None
        place = f"/humans/bodies/{body_id}"
        self._joints = node.advertise(JointState, f"{place}/joint_states", qos.RESULT)
        # The first name is ROS's convention; libhri reads the second one.
        self._descriptions = [
            node.advertise(String, f"{place}/{name}", qos.LATCHED)
            for name in ("robot_description", "urdf")
        ]

    def publish(self, header: Header, estimate: Estimate, tracker: Tracker) -> None:
        """Publish the posture if there is one, and before it the URDF of a new person."""
        self._bodies.see(header, None if estimate.posture is None else self._id)
        if estimate.posture is None:
            return
        if self._described != (tracker.body, header.frame_id):
            self._described = (tracker.body, header.frame_id)
            self._convert = Rep155Joints()
            frame_id = header.frame_id or OPTICAL_FRAME
            urdf = rep155_urdf(tracker.body, self._id, frame_id, self._torso_place)
            for publisher in self._descriptions:
                publisher.publish(String(data=urdf))
        values = np.nan_to_num(estimate.joints[0, : len(self._names)])
        joints = JointValues(self._names, self._convert(values))
        self._joints.publish(results.message_of(header, joints))


class TrackerOutputs:
    """The tracker's topics; each message is made only while the topic has a subscriber."""

    def __init__(
        self,
        node: CardboxNode,
        settings: TrackerParameters,
        person: int | None = None,
        bodies: TrackedBodies | None = None,
    ) -> None:
        space = "" if person is None else f"{person_space(person)[1:]}/"
        self._publishers = {
            topic: node.advertise(class_of(kind), space + topic, qos.RESULT)
            for topic, kind in TOPICS.items()
            if settings.hands or topic != "hands"
        }
        self._poses = {
            topic: node.advertise(PoseStamped, space + topic, qos.RESULT) for topic in POSES
        }
        # With people, body_model is that of the first one, or the given one of all.
        self._model = space and node.advertise(String, f"{space}body_model", qos.LATCHED)
        self._body: BodyModel | None = None
        self._stream = OutputStream(settings.torso_place)
        self._overlay = node.advertise(Image, f"{space}overlay", qos.SENSOR_DATA)
        self._camera_overlays = [
            node.advertise(Image, f"{camera.rstrip('/')}/overlay", qos.SENSOR_DATA)
            for camera in settings.cameras
            if person is None
        ]
        ending = "" if person is None else f"_{person}"
        self._human = None
        if bodies is not None:
            self._human = Rep155Outputs(node, settings, settings.rep155_id + ending, bodies)
        self._guided = False
        node.subscribe(Bool, "initializer/guiding", self._on_guiding, qos.LATCHED)

    def _on_guiding(self, message: Bool, _: int) -> None:
        self._guided = message.data

    def publish(self, seen: ObservationSet, estimate: Estimate, tracker: Tracker) -> None:
        """Publish the outputs of an image; a lost posture is not repeated."""
        header = seen.header
        stamp_ns = conversions.stamp_ns(header.stamp)
        if self._model and tracker.body is not self._body:
            # Joint states of a version of the body follow it.
            self._body = tracker.body
            self._model.publish(String(data=dumps_body_model(self._body)))
        for topic, value in self._stream.values(stamp_ns, estimate, tracker, self._is_wanted):
            self._publishers[topic].publish(results.message_of(header, value))
        if any(map(_wanted, self._poses.values())):
            for topic, pose in person_poses(estimate, tracker.body):
                self._poses[topic].publish(pose_message(new_message, header, pose))
        if self._human is not None:
            self._human.publish(header, estimate, tracker)
        if _wanted(self._overlay) and not self._guided:
            image = draw_camera_overlay(seen.picture(), 0, estimate, tracker)
            self._overlay.publish(conversions.image_message(header, image, "bgr8"))
        for number, publisher in enumerate(self._camera_overlays):
            own = seen.headers[number]
            if own is not None and _wanted(publisher):
                image = draw_camera_overlay(seen.picture(number), number, estimate, tracker)
                publisher.publish(conversions.image_message(own, image, "bgr8"))

    def _is_wanted(self, topic: str) -> bool:
        return topic in self._publishers and _wanted(self._publishers[topic])

    def waiting(self, message: Image, seen: Image | None, text: str) -> None:
        """Publish on ``overlay`` the image, or the silhouette, with a text about missing inputs."""
        if not _wanted(self._overlay) or self._guided:
            return
        silhouette = conversions.silhouette_of(message)
        picture = conversions.image_behind(silhouette, seen)
        image = draw_message(silhouette if picture is None else picture, text)
        self._overlay.publish(conversions.image_message(message.header, image, "bgr8"))


def _wanted(publisher: Any) -> bool:
    return bool(publisher.get_subscription_count())
