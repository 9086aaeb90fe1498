"""What the tracker found, as messages: joint states, keypoints, markers."""

from __future__ import annotations

import array

import numpy as np
from geometry_msgs.msg import Point, Pose, PoseArray, Quaternion, Vector3
from numpy.typing import NDArray
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from cardbox_tracker.body.cardbox import PATCH_NAMES, cardbox_patches
from cardbox_tracker.body.kinematics import forward_kinematics
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import JOINT_NAMES
from cardbox_tracker.vision.camera import Camera

FloatArray = NDArray[np.float64]

_TRIANGLES = (0, 1, 2, 0, 2, 3)
_JOINTS = list(JOINT_NAMES)
_COLORS = {
    "left": ColorRGBA(r=0.2, g=0.7, b=0.4, a=0.7),
    "right": ColorRGBA(r=0.85, g=0.45, b=0.2, a=0.7),
    "": ColorRGBA(r=0.25, g=0.45, b=0.75, a=0.7),
}
_SKELETON_COLOR = ColorRGBA(r=1.0, g=1.0, b=1.0, a=1.0)
_SKELETON_WIDTH_M = 0.02
# Corners kept when the person is lost would stay in the air.
_DELETE_ALL = Marker(action=Marker.DELETEALL)


def joint_state_message(header: Header, values: FloatArray) -> JointState:
    """Return the 12 joints in ``values`` (12,), rad and metres (or their deviations)."""
    return JointState(header=header, name=_JOINTS, position=array.array("d", values.tolist()))


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
    patches = camera.reference_to_optical(cardbox_patches(body, posture))
    triangles = _marker(header, "patches", Marker.TRIANGLE_LIST, 1.0)
    for name, corners in zip(PATCH_NAMES, patches.tolist(), strict=True):
        points = [Point(x=x, y=y, z=z) for x, y, z in corners]
        triangles.points.extend(points[i] for i in _TRIANGLES)
        side = name.split("_")[0]
        triangles.colors.extend([_COLORS.get(side, _COLORS[""])] * len(_TRIANGLES))

    frames = forward_kinematics(body, posture)
    bones = [(frames.hip, frames.neck), (frames.neck, frames.head)]
    for arm in (frames.left, frames.right):
        bones += [
            (frames.neck, arm.shoulder),
            (arm.shoulder, arm.elbow),
            (arm.elbow, arm.hand),
        ]
    skeleton = _marker(header, "skeleton", Marker.LINE_LIST, _SKELETON_WIDTH_M)
    skeleton.color = _SKELETON_COLOR
    ends = camera.reference_to_optical(np.array(bones)).reshape(-1, 3)
    skeleton.points = [Point(x=x, y=y, z=z) for x, y, z in ends.tolist()]
    return MarkerArray(markers=[triangles, skeleton])


def no_markers_message(header: Header) -> MarkerArray:
    """Return what removes every marker of a person who is no longer tracked."""
    _DELETE_ALL.header = header
    return MarkerArray(markers=[_DELETE_ALL])


def _marker(header: Header, namespace: str, kind: int, scale: float) -> Marker:
    return Marker(
        header=header,
        ns=namespace,
        type=kind,
        action=Marker.ADD,
        pose=Pose(orientation=Quaternion(w=1.0)),
        scale=Vector3(x=scale, y=scale, z=scale),
        color=_COLORS[""],
        frame_locked=False,
    )
