"""A person's URDF after REP-155, with the joints of :mod:`cardbox_tracker.description.rep155`.

    sensor frame -body-> body_ID -y_waist-> -waist-> -r_waist-> -(fixed)-> torso_ID
    torso_ID -(fixed)-> head_ID
    torso_ID -y_shoulder-> -p_shoulder-> -r_shoulder-> l_shoulder_ID -elbow-> l_elbow_ID
    l_elbow_ID -(fixed)-> l_wrist_ID, and the same with r_

Every link and joint but the sensor's frame ends in ``_ID``. As in the reference model, ``torso`` is
at the height of the shoulders, ``l_shoulder`` is the upper arm and ``l_elbow`` the forearm. The
wrist of the reference model is the end of the fist here, where the outline ends.
"""

from __future__ import annotations

import math
from xml.etree import ElementTree as Xml

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import JOINT_LIMITS
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.description.rep155 import LOWEST_BEND_RAD, LOWEST_RAISE_RAD
from cardbox_tracker.description.urdf_elements import (
    add_box,
    add_joint,
    add_link,
    add_robot,
    xml_text,
)

_THIN_M = 0.004
_FULL = (-2 * math.pi, 2 * math.pi)


def rep155_urdf(body: BodyModel, body_id: str, optical_frame: str) -> str:
    """Return the URDF of ``body`` as XML text.

    Args:
        body: the measured person.
        body_id: ending of all link and joint names; letters, digits and underscores.
        optical_frame: frame of the camera, the root of the tree.
    """
    robot = add_robot(f"human_{body_id}")
    end = f"_{body_id}"
    add_link(robot, optical_frame)
    size = body.size
    neck_m = size("waist_height") + size("torso_height")
    shoulders_m = neck_m - size("shoulder_drop")
    origin, rpy = _seen_from_camera(body)
    parent = optical_frame
    for index, (name, kind, axis) in enumerate(
        (
            ("body", "prismatic", (0, 1, 0)),
            ("y_waist", "revolute", (0, 0, 1)),
            ("waist", "revolute", (0, 1, 0)),
            ("r_waist", "revolute", (1, 0, 0)),
        )
    ):
        lowest, highest = JOINT_LIMITS[(0, 3, 2, 1)[index]]
        link = add_link(robot, name + end)
        add_joint(
            *(robot, name + end, kind, parent, name + end, origin, rpy),
            axis=axis,
            limits=(lowest, highest),
        )
        parent, origin, rpy = name + end, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    middle = _up(size("waist_height") / 2)
    add_box(link, "torso", (_THIN_M, size("waist_width"), size("waist_height")), middle)
    add_box(link, "torso", (size("waist_depth"), _THIN_M, size("waist_height")), middle)
    torso = add_link(robot, "torso" + end)
    add_joint(robot, "torso" + end, "fixed", parent, "torso" + end, _up(shoulders_m))
    middle = _up(size("shoulder_drop") - size("torso_height") / 2)
    width_m = (size("torso_top_width") + size("torso_bottom_width")) / 2
    add_box(torso, "torso", (_THIN_M, width_m, size("torso_height")), middle)
    add_box(torso, "torso", (size("torso_depth"), _THIN_M, size("torso_height")), middle)
    head = add_link(robot, "head" + end)
    head_m = neck_m - shoulders_m + size("neck_length") + size("head_height") / 2
    add_joint(
        *(robot, "head" + end, "fixed", "torso" + end, "head" + end),
        (size("head_offset"), 0.0, head_m),
    )
    add_box(head, "torso", (_THIN_M, size("head_width"), size("head_height")), _up(0.0))
    add_box(head, "torso", (size("head_depth"), _THIN_M, size("head_height")), _up(0.0))
    _arm(robot, body, "l", "left", 1.0, end)
    _arm(robot, body, "r", "right", -1.0, end)
    return xml_text(robot)


def _arm(
    robot: Xml.Element, body: BodyModel, prefix: str, material: str, side: float, end: str
) -> None:
    """``side`` is +1 for the left arm, -1 for the right."""
    size = body.size
    parent, origin = "torso" + end, (0.0, side * size("shoulder_breadth") / 2, 0.0)
    for joint, child, axis, limits in (
        ("y_shoulder", "y_shoulder", (0, 0, -side), _FULL),
        ("p_shoulder", "p_shoulder", (side, 0, 0), (LOWEST_RAISE_RAD, math.pi)),
        ("r_shoulder", "shoulder", (0, 0, side), _FULL),
        ("elbow", "elbow", (0, -1, 0), (LOWEST_BEND_RAD, math.pi)),
    ):
        name = f"{prefix}_{child}{end}"
        if joint == "elbow":
            origin = (0.0, 0.0, -size("upper_arm_length"))
        link = add_link(robot, name)
        add_joint(
            *(robot, f"{prefix}_{joint}{end}", "revolute", parent, name, origin),
            axis=axis,
            limits=limits,
        )
        parent, origin = name, (0.0, 0.0, 0.0)
        part = {"shoulder": "upper_arm", "elbow": "forearm"}.get(child)
        if part:
            length_m, width_m = size(f"{part}_length"), size(f"{part}_width")
            add_box(link, material, (_THIN_M, width_m, length_m), _up(-length_m / 2))
            add_box(link, material, (width_m, _THIN_M, length_m), _up(-length_m / 2))
    add_link(robot, f"{prefix}_wrist{end}")
    add_joint(
        *(robot, f"{prefix}_wrist{end}", "fixed", parent, f"{prefix}_wrist{end}"),
        _up(-size("forearm_length")),
    )


def _up(height_m: float) -> tuple[float, float, float]:
    return (0.0, 0.0, height_m)


def _seen_from_camera(
    body: BodyModel,
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Where the middle of the hips is in the optical frame when d1 is 0, as URDF has it."""
    down = body.camera_pose.pitch_rad
    # Columns: the body's X (to the camera), Y (to the right of the image) and Z (up).
    rotation = np.array(
        [
            (0.0, 1.0, 0.0),
            (math.sin(down), 0.0, -math.cos(down)),
            (-math.cos(down), 0.0, -math.sin(down)),
        ]
    )
    x, y, z = (rotation @ (-body.placement.distance_m, 0.0, body.placement.hip_height_m)).tolist()
    return (x, y, z), _rpy(rotation)


def _rpy(rotation: FloatArray) -> tuple[float, float, float]:
    """Roll, pitch, yaw with Rz(yaw) Ry(pitch) Rx(roll) = ``rotation`` (3, 3)."""
    level = math.hypot(rotation[0, 0], rotation[1, 0])
    pitch = math.atan2(-rotation[2, 0], level)
    if level < 1e-9:  # straight up or down: roll and yaw turn about the same axis
        return 0.0, pitch, math.atan2(-rotation[0, 1], rotation[1, 1])
    return (
        math.atan2(rotation[2, 1], rotation[2, 2]),
        pitch,
        math.atan2(rotation[1, 0], rotation[0, 0]),
    )
