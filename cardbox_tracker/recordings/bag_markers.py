"""A tracker's markers as messages of a recording, without rclpy."""

from __future__ import annotations

from typing import Any

import numpy as np

from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.markers import MarkerShape, Rgba
from cardbox_tracker.recordings.outputs import Markers

_NO_BYTES = np.zeros(0, np.uint8)
_NO_POINTS = np.zeros((0, 3))
# Values of the constants of visualization_msgs/Marker.
_ADD, _DELETE_ALL = 0, 3
_NOTHING = MarkerShape("", 0, 0.0, _NO_POINTS, (0.0, 0.0, 0.0, 0.0))


def write_markers(
    writer: BagWriter, topic: str, stamp_ns: int, frame_id: str, markers: Markers
) -> None:
    """Write markers; without shapes, a message that removes all earlier ones."""
    header = writer.header(stamp_ns, frame_id)
    messages = [_marker(writer, header, shape, _ADD) for shape in markers.shapes]
    if not messages:
        messages = [_marker(writer, header, _NOTHING, _DELETE_ALL)]
    array = writer.type("visualization_msgs/msg/MarkerArray")
    writer.write(topic, array(markers=messages), stamp_ns)


def _marker(writer: BagWriter, header: Any, shape: MarkerShape, action: int) -> Any:
    """Return a marker message; all fields are given because the classes have no defaults."""
    make = writer.type
    point, color = make("geometry_msgs/msg/Point"), make("std_msgs/msg/ColorRGBA")
    still = make("geometry_msgs/msg/Quaternion")(x=0.0, y=0.0, z=0.0, w=1.0)
    image = make("sensor_msgs/msg/CompressedImage")
    nothing = make("std_msgs/msg/Header")(
        stamp=make("builtin_interfaces/msg/Time")(sec=0, nanosec=0), frame_id=""
    )
    scale = shape.scale
    return make("visualization_msgs/msg/Marker")(
        header=header,
        ns=shape.namespace,
        id=0,
        type=shape.kind,
        action=action,
        pose=make("geometry_msgs/msg/Pose")(position=point(x=0.0, y=0.0, z=0.0), orientation=still),
        scale=make("geometry_msgs/msg/Vector3")(x=scale, y=scale, z=scale),
        color=_color(color, shape.rgba),
        lifetime=make("builtin_interfaces/msg/Duration")(sec=0, nanosec=0),
        frame_locked=False,
        points=[point(x=x, y=y, z=z) for x, y, z in shape.points_m.tolist()],
        colors=[_color(color, rgba) for rgba in shape.colors],
        texture_resource="",
        texture=image(header=nothing, format="", data=_NO_BYTES),
        uv_coordinates=[],
        text="",
        mesh_resource="",
        mesh_file=make("visualization_msgs/msg/MeshFile")(filename="", data=_NO_BYTES),
        mesh_use_embedded_materials=False,
    )


def _color(make: Any, rgba: Rgba) -> Any:
    r, g, b, a = rgba
    return make(r=r, g=g, b=b, a=a)
