"""The tracker's output on ``/tf``, in place of robot_state_publisher.

It needs the package tf2_msgs, which is part of ROS, but not available on PyPI.
"""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from std_msgs.msg import Header

from cardbox_tracker.camera.camera import OPTICAL_FRAME
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.urdf import (
    LinkTransform,
    LinkTransforms,
    rep155_urdf,
    urdf_from_body,
)
from cardbox_tracker.recordings.outputs import joint_values, positions_of
from cardbox_tracker.ros.messages.types import optional_class
from cardbox_tracker.ros.nodes.rep155_outputs import BodyJoints
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.tracker import Tracker


class TfOutputs:
    """Publishes the frames of the links of ``robot_description`` for each image.

    Of several people, these are the frames of REP-155, which end in the person's ID.
    """

    def __init__(
        self, node: CardboxNode, settings: TrackerParameters, body_id: str | None = None
    ) -> None:
        """Advertise ``/tf`` for ``node``; ``body_id`` is the ID of one of several people.

        Raises:
            CardboxError: the package tf2_msgs is not installed.
        """
        self._kind = optional_class("tf2_msgs", "TFMessage")
        if self._kind is None:
            raise CardboxError(
                "publish_tf needs the package tf2_msgs, which is not installed; install it (sudo "
                "apt install ros-jazzy-tf2-msgs; PyPI has none), or leave publish_tf off: "
                "robot_state_publisher makes /tf from robot_description and joint_states, and the "
                "bag of 'cardbox track --bag' has it"
            )
        self._publisher = node.advertise(self._kind, "/tf", qos.TF)
        self._settings = settings
        self._id, self._joints = body_id, None
        if body_id is not None:
            self._joints = BodyJoints(body_id, settings.torso_place)
        self._described: tuple[Any, str] | None = None
        self._links: LinkTransforms | None = None

    def publish(self, header: Header, estimate: Estimate, tracker: Tracker) -> None:
        """Publish the frames of an image if it has a posture."""
        settings = self._settings
        joints = (
            joint_values(estimate, settings.torso_place)
            if self._joints is None
            else self._joints.of(estimate)
        )
        if joints is None:
            return
        if self._links is None or self._described != (tracker.body, header.frame_id):
            self._described = (tracker.body, header.frame_id)
            optical, place = header.frame_id, settings.torso_place
            if self._id is not None:
                frame_id = optical or OPTICAL_FRAME
                urdf = rep155_urdf(tracker.body, self._id, frame_id, place)
            else:
                root = optical if settings.optical_frame_in_tf else ""
                urdf = urdf_from_body(tracker.body, root or None, torso_place=place)
            self._links = LinkTransforms(urdf)
        links = self._links.at(positions_of(joints))
        transforms = [_stamped(header, link) for link in links]
        self._publisher.publish(self._kind(transforms=transforms))


def _stamped(header: Header, link: LinkTransform) -> TransformStamped:
    x, y, z = link.translation_m
    qx, qy, qz, qw = link.rotation
    return TransformStamped(
        header=Header(stamp=header.stamp, frame_id=link.parent),
        child_frame_id=link.child,
        transform=Transform(
            translation=Vector3(x=x, y=y, z=z), rotation=Quaternion(x=qx, y=qy, z=qz, w=qw)
        ),
    )
