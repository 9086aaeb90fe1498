"""A tracker's markers as messages of a recording, without rclpy."""

from __future__ import annotations

from typing import Any

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.drawing.markers import (
    SKELETON_RGBA,
    SKELETON_WIDTH_M,
    TORSO_RGBA,
    MarkerShapes,
    Rgba,
)
from cardbox_tracker.recordings.bag_writer import BagWriter

_NO_BYTES = np.zeros(0, np.uint8)
_LINE_LIST, _TRIANGLE_LIST, _DELETE_ALL = 5, 11, 3


def write_markers(
    writer: BagWriter, topic: str, stamp_ns: int, frame_id: str, shapes: MarkerShapes | None
) -> None:
    """Write the markers of a posture; None removes those of the image before."""
    header = writer.header(stamp_ns, frame_id)
    if shapes is None:
        markers = [_marker(writer, header, "", 0, 0.0, action=_DELETE_ALL)]
    else:
        markers = [
            _marker(
                *(writer, header, "patches", _TRIANGLE_LIST, 1.0),
                points_m=shapes.triangles_m,
                colors=shapes.colors,
            ),
            _marker(
                *(writer, header, "skeleton", _LINE_LIST, SKELETON_WIDTH_M),
                points_m=shapes.bones_m,
                rgba=SKELETON_RGBA,
            ),
        ]
    array = writer.type("visualization_msgs/msg/MarkerArray")
    writer.write(topic, array(markers=markers), stamp_ns)


def _marker(
    writer: BagWriter,
    header: Any,
    namespace: str,
    kind: int,
    scale: float,
    points_m: FloatArray | None = None,
    colors: list[Rgba] | None = None,
    rgba: Rgba = TORSO_RGBA,
    action: int = 0,
) -> Any:
    """Every field has to be given: these classes have no defaults."""
    make = writer.type
    point, color = make("geometry_msgs/msg/Point"), make("std_msgs/msg/ColorRGBA")
    still = make("geometry_msgs/msg/Quaternion")(x=0.0, y=0.0, z=0.0, w=1.0)
    image = make("sensor_msgs/msg/CompressedImage")
    nothing = make("std_msgs/msg/Header")(
        stamp=make("builtin_interfaces/msg/Time")(sec=0, nanosec=0), frame_id=""
    )
    corners = [] if points_m is None else points_m.tolist()
    return make("visualization_msgs/msg/Marker")(
        header=header,
        ns=namespace,
        id=0,
        type=kind,
        action=action,
        pose=make("geometry_msgs/msg/Pose")(position=point(x=0.0, y=0.0, z=0.0), orientation=still),
        scale=make("geometry_msgs/msg/Vector3")(x=scale, y=scale, z=scale),
        color=_color(color, rgba),
        lifetime=make("builtin_interfaces/msg/Duration")(sec=0, nanosec=0),
        frame_locked=False,
        points=[point(x=x, y=y, z=z) for x, y, z in corners],
        colors=[_color(color, one) for one in colors or []],
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
