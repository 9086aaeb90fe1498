"""The transforms of a person's links as messages of a recording, without rclpy."""

from __future__ import annotations

from collections.abc import Mapping

from cardbox_tracker.person.urdf import LinkTransforms
from cardbox_tracker.recordings.bag_writer import BagWriter

TOPIC = "/tf"


class BagTransforms:
    """Writes ``/tf`` for the joint states of a recording, from its URDF.

    A viewer needs ``/tf`` to move the URDF, and a recording has no robot_state_publisher.
    """

    def __init__(self, writer: BagWriter) -> None:
        """Use ``writer``; nothing is written before :meth:`describe`."""
        self._writer = writer
        self._links: LinkTransforms | None = None

    def describe(self, urdf: str) -> None:
        """Write the links of ``urdf`` from now on."""
        self._links = LinkTransforms(urdf)

    def write(self, stamp_ns: int, positions: Mapping[str, float]) -> None:
        """Write the transforms at ``positions`` of the joints, rad and metres.

        Raises:
            ValueError: a joint of the URDF has no position.
        """
        if self._links is None:
            return
        make = self._writer.type
        vector = make("geometry_msgs/msg/Vector3")
        quaternion = make("geometry_msgs/msg/Quaternion")
        transform = make("geometry_msgs/msg/Transform")
        stamped = make("geometry_msgs/msg/TransformStamped")
        transforms = []
        for link in self._links.at(positions):
            x, y, z = link.translation_m
            turn = quaternion(**dict(zip("xyzw", link.rotation, strict=True)))
            transforms.append(
                stamped(
                    header=self._writer.header(stamp_ns, link.parent),
                    child_frame_id=link.child,
                    transform=transform(translation=vector(x=x, y=y, z=z), rotation=turn),
                )
            )
        message = make("tf2_msgs/msg/TFMessage")(transforms=transforms)
        self._writer.write(TOPIC, message, stamp_ns)
