"""The tracker's outputs as ROS messages, for nodes and bags alike.

A function ``new(kind, **fields)`` makes the messages: those of rclpy in a node, those of rosbags
in a bag. Fields that are not given are zero.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from cardbox_tracker.common.errors import NotFiniteError
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.recordings.markers import MarkerShape
from cardbox_tracker.recordings.outputs import LEVELS, JointValues, KeypointStates, Value
from cardbox_tracker.recordings.person_poses import Pose

New = Callable[..., Any]

# Constant of visualization_msgs/Marker; ADD is 0.
_DELETE_ALL = 3


def pose_message(new: New, header: Any, found: Pose) -> Any:
    """Return the PoseStamped of a pose; raise as :func:`message_of`."""
    # Slow to import.
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(finite(found.turn, "rotation")).as_quat().tolist()
    (place,) = _points(new, found.place_m[None])
    turn = new("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)
    stamped = new("geometry_msgs/msg/Pose", position=place, orientation=turn)
    return new("geometry_msgs/msg/PoseStamped", header=header, pose=stamped)


def message_of(new: New, header: Any, value: Value) -> Any:
    """Return the message that carries ``value``, in rad and metres in the frame of ``header``.

    Raises NotFiniteError for a number that is not finite.
    """
    match value:
        case JointValues(names, values, velocities):
            fields = {"name": list(names), "position": finite(values, "joint states")}
            if velocities is not None:
                fields["velocity"] = finite(velocities, "velocities of the joints")
            return new("sensor_msgs/msg/JointState", header=header, **fields)
        case KeypointStates():
            status = [
                new(
                    "diagnostic_msgs/msg/DiagnosticStatus",
                    level=LEVELS[state],
                    name=name,
                    message=str(state),
                    values=[
                        new("diagnostic_msgs/msg/KeyValue", key=key, value=text)
                        for key, text in texts.items()
                    ],
                )
                for name, state, texts in value.rows()
            ]
            return new("diagnostic_msgs/msg/DiagnosticArray", header=header, status=status)
        case str():
            return new("std_msgs/msg/String", data=value)
        case np.ndarray():
            poses = [_pose(new, position=one) for one in _points(new, value)]
            return new("geometry_msgs/msg/PoseArray", header=header, poses=poses)
    gone = {"header": header, "action": _DELETE_ALL, "pose": _pose(new)}
    markers = [_marker(new, header, shape) for shape in value]
    return new(
        "visualization_msgs/msg/MarkerArray",
        markers=markers or [new("visualization_msgs/msg/Marker", **gone)],
    )


def _marker(new: New, header: Any, shape: MarkerShape) -> Any:
    colors = {
        rgba: new("std_msgs/msg/ColorRGBA", **dict(zip("rgba", rgba, strict=True)))
        for rgba in {shape.rgba, *shape.colors}
    }
    return new(
        "visualization_msgs/msg/Marker",
        header=header,
        ns=shape.namespace,
        type=shape.kind,
        pose=_pose(new),
        scale=new("geometry_msgs/msg/Vector3", **dict.fromkeys("xyz", shape.scale)),
        color=colors[shape.rgba],
        points=_points(new, shape.points_m),
        colors=[colors[rgba] for rgba in shape.colors],
    )


def _pose(new: New, **values: Any) -> Any:
    """Return a pose without rotation."""
    still = new("geometry_msgs/msg/Quaternion", w=1.0)
    return new("geometry_msgs/msg/Pose", orientation=still, **values)


def _points(new: New, points_m: FloatArray) -> list[Any]:
    return [
        new("geometry_msgs/msg/Point", x=x, y=y, z=z)
        for x, y, z in finite(points_m, "points").tolist()
    ]


def finite(values: FloatArray, what: str) -> FloatArray:
    """Return ``values`` after a last check before they are published; raise NotFiniteError."""
    if not np.isfinite(values).all():
        raise NotFiniteError(
            f"the {what} of an image have values that are not finite numbers, so they are not "
            "published; please report it, with the body model and the CameraInfo"
        )
    return values
