"""The tracker's topics after REP-155 below ``/humans``.

Without the package hri_msgs, the list of tracked people is not published.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String

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


class Rep155Outputs:
    """Publishes joints, URDF and presence of the body ``rep155_id``."""

    def __init__(self, node: CardboxNode, settings: TrackerParameters) -> None:
        """Advertise the topics of the body ``settings.rep155_id``."""
        self._id = body_id = settings.rep155_id
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
        self._ids_list = optional_class("hri_msgs", "IdsList")
        self._tracked = (
            None
            if self._ids_list is None
            else node.advertise(self._ids_list, "/humans/bodies/tracked", qos.RESULT)
        )

    def publish(self, header: Header, estimate: Estimate, tracker: Tracker) -> None:
        """Publish the posture if there is one, and before it the URDF of a new person."""
        if self._tracked is not None:
            ids = [] if estimate.posture is None else [self._id]
            self._tracked.publish(self._ids_list(header=header, ids=ids))
        if estimate.posture is None:
            return
        if self._described != (tracker.body, header.frame_id):
            self._described = (tracker.body, header.frame_id)
            self._convert = Rep155Joints()
            frame_id = header.frame_id or "camera_optical_frame"
            urdf = rep155_urdf(tracker.body, self._id, frame_id, self._torso_place)
            for publisher in self._descriptions:
                publisher.publish(String(data=urdf))
        values = self._convert(estimate.posture)
        if self._torso_place:
            others = place_of(estimate), head_joints(neck_of(estimate)), clavicles_of(estimate)
            values = np.concatenate([values, *others])
        joints = JointValues(self._names, values)
        self._joints.publish(results.joint_state_message(header, joints))
