"""The tracked person as shapes of markers, for nodes and bags; without rclpy."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cardbox_tracker.camera.camera import level_to_optical
from cardbox_tracker.person.cardbox import PATCH_NAMES, patches_at
from cardbox_tracker.person.kinematics import gaze_m, pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.sizes import FloatArray

Rgba = tuple[float, float, float, float]

# Constants of visualization_msgs/Marker.
LINE_LIST, TRIANGLE_LIST = 5, 11

_SKELETON_WIDTH_M = 0.02
_SKELETON_RGBA: Rgba = (1.0, 1.0, 1.0, 1.0)
_TORSO_RGBA: Rgba = (0.25, 0.45, 0.75, 0.7)
_SIDES: dict[str, Rgba] = {"left": (0.2, 0.7, 0.4, 0.7), "right": (0.85, 0.45, 0.2, 0.7)}
_TRIANGLES = (0, 1, 2, 0, 2, 3)


class MarkerShape(NamedTuple):
    """Shape of one marker."""

    namespace: str  #: content of the marker, ``patches`` or ``skeleton``
    kind: int  #: ``TRIANGLE_LIST`` or ``LINE_LIST``
    scale: float  #: 1 for triangles, the width in metres for lines
    #: (n, 3), three corners per triangle or both ends of each line, metres in the optical frame.
    points_m: FloatArray
    rgba: Rgba  #: colour of the whole marker, used if ``colors`` is empty
    colors: tuple[Rgba, ...] = ()  #: colour of each point, or empty


def marker_shapes(
    body: BodyModel, posture: FloatArray, neck: FloatArray | None = None
) -> tuple[MarkerShape, MarkerShape]:
    """Return the patches and the skeleton of ``body`` in a posture (12,) before its camera.

    With ``neck`` (2,), rad, the skeleton has a line in the direction of the face.
    """
    frames = pose(body, posture)
    tilt = body.camera_pose
    to_optical = level_to_optical(tilt.pitch_rad, tilt.roll_rad).T
    corners = patches_at(body, frames) @ to_optical
    colors = [
        color
        for name in PATCH_NAMES
        for color in [_SIDES.get(name.split("_")[0], _TORSO_RGBA)] * len(_TRIANGLES)
    ]
    bones = [(frames.hip, frames.neck), (frames.neck, frames.head)]
    for arm in (frames.left, frames.right):
        bones += [(frames.neck, arm.shoulder), (arm.shoulder, arm.elbow), (arm.elbow, arm.hand)]
    if neck is not None:
        start, end = gaze_m(body_parts(body.sizes), frames, neck)
        bones.append((start, end))
    return (
        MarkerShape(
            *("patches", TRIANGLE_LIST, 1.0),
            corners[:, _TRIANGLES].reshape(-1, 3),
            _TORSO_RGBA,
            tuple(colors),
        ),
        MarkerShape(
            *("skeleton", LINE_LIST, _SKELETON_WIDTH_M),
            (np.array(bones) @ to_optical).reshape(-1, 3),
            _SKELETON_RGBA,
        ),
    )
