"""What the tracker found, as messages: joint states, keypoints, markers."""

from __future__ import annotations

import array

from geometry_msgs.msg import Point, Pose, PoseArray, Quaternion, Vector3
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import JOINT_NAMES
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.drawing.markers import (
    PART_RGBA,
    SKELETON_RGBA,
    SKELETON_WIDTH_M,
    TORSO_RGBA,
    marker_shapes,
)
from cardbox_tracker.vision.camera import Camera

_JOINTS = list(JOINT_NAMES)
_COLORS = {
    rgba: ColorRGBA(r=rgba[0], g=rgba[1], b=rgba[2], a=rgba[3])
    for rgba in (*PART_RGBA, SKELETON_RGBA)
}
# Corners kept when the person is lost would stay in the air.
_DELETE_ALL = Marker(action=Marker.DELETEALL)


def joint_state_message(
    header: Header, values: FloatArray, names: list[str] | None = None
) -> JointState:
    """Return the joints in ``values`` (n,), rad and metres (or their deviations).

    Without ``names`` they are the 12 of the posture.
    """
    return JointState(
        header=header, name=names or _JOINTS, position=array.array("d", values.tolist())
    )


def keypoints_message(header: Header, points_m: FloatArray) -> PoseArray:
    """Return the six keypoints (6, 3), metres in the frame of ``header``."""
    upright = Quaternion(w=1.0)
    return PoseArray(
        header=header,
        poses=[
            Pose(position=Point(x=x, y=y, z=z), orientation=upright)
            for x, y, z in points_m.tolist()
        ],
    )


def markers_message(
    header: Header, body: BodyModel, camera: Camera, posture: FloatArray
) -> MarkerArray:
    """Return the patches (namespace ``patches``) and the bones (``skeleton``) of a posture (12,).

    Points are in the optical frame of ``camera``, metres; ``header`` names that frame.
    """
    shapes = marker_shapes(body, camera, posture)
    triangles = _marker(header, "patches", Marker.TRIANGLE_LIST, 1.0)
    triangles.points = _points(shapes.triangles_m)
    triangles.colors = [_COLORS[color] for color in shapes.colors]
    skeleton = _marker(header, "skeleton", Marker.LINE_LIST, SKELETON_WIDTH_M)
    skeleton.color = _COLORS[SKELETON_RGBA]
    skeleton.points = _points(shapes.bones_m)
    return MarkerArray(markers=[triangles, skeleton])


def no_markers_message(header: Header) -> MarkerArray:
    """Return what removes every marker of a person who is no longer tracked."""
    _DELETE_ALL.header = header
    return MarkerArray(markers=[_DELETE_ALL])


def _points(points_m: FloatArray) -> list[Point]:
    return [Point(x=x, y=y, z=z) for x, y, z in points_m.tolist()]


def _marker(header: Header, namespace: str, kind: int, scale: float) -> Marker:
    return Marker(
        header=header,
        ns=namespace,
        type=kind,
        action=Marker.ADD,
        pose=Pose(orientation=Quaternion(w=1.0)),
        scale=Vector3(x=scale, y=scale, z=scale),
        color=_COLORS[TORSO_RGBA],
        frame_locked=False,
    )
