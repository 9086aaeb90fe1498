"""The tracker's topics after REP-155 below ``/humans``.

Without the package hri_msgs, the list of tracked people is not published.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String

from cardbox_tracker.camera.camera import OPTICAL_FRAME
from cardbox_tracker.person.rep155 import Rep155Joints, head_joints, joint_names
from cardbox_tracker.person.urdf import rep155_urdf
from cardbox_tracker.recordings.outputs import JointValues, clavicles_of, neck_of, place_of
from cardbox_tracker.ros.messages import results
from cardbox_tracker.ros.messages.types import optional_class
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.tracker import Tracker


class TrackedBodies:
    """Publishes the list of the bodies that are tracked, once an image."""

    def __init__(self, node: CardboxNode, count: int = 1) -> None:
        """Advertise the list of up to ``count`` bodies."""
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


class BodyJoints:
    """The joints of a body after REP-155.

    Attributes:
        names: their names, which end in the body's ID.
    """

    def __init__(self, body_id: str, torso_place: bool) -> None:
        """Name the joints; with ``torso_place``, also those of place, head and clavicles."""
        self._torso_place = torso_place
        self.names = tuple(joint_names(body_id, torso_place))
        self._convert = Rep155Joints()

    def of(self, estimate: Estimate) -> JointValues | None:
        """Return the joints of an estimate; None without a posture."""
        if estimate.posture is None:
            return None
        values = self._convert(estimate.posture)
        if self._torso_place:
            others = place_of(estimate), head_joints(neck_of(estimate)), clavicles_of(estimate)
            values = np.concatenate([values, *others])
        return JointValues(self.names, values)


class Rep155Outputs:
    """Publishes joints, URDF and presence of a body."""

    def __init__(
        self, node: CardboxNode, settings: TrackerParameters, body_id: str, bodies: TrackedBodies
    ) -> None:
        """Advertise the topics of the body ``body_id``."""
        self._id, self._bodies = body_id, bodies
        self._torso_place = settings.torso_place
        self._values = BodyJoints(body_id, settings.torso_place)
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
            self._values = BodyJoints(self._id, self._torso_place)
            frame_id = header.frame_id or OPTICAL_FRAME
            urdf = rep155_urdf(tracker.body, self._id, frame_id, self._torso_place)
            for publisher in self._descriptions:
                publisher.publish(String(data=urdf))
        joints = self._values.of(estimate)
        assert joints is not None
        self._joints.publish(results.joint_state_message(header, joints))
