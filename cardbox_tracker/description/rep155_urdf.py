"""A person's URDF after REP-155, with the joints of :mod:`cardbox_tracker.description.rep155`.

    sensor frame -x_body-> -z_body-> -body-> body_ID
    body_ID -y_waist-> -waist-> -r_waist-> -(fixed)-> torso_ID
    torso_ID -y_head-> -p_head-> -(fixed)-> head_ID
    torso_ID -y_shoulder-> -p_shoulder-> -r_shoulder-> l_shoulder_ID -elbow-> l_elbow_ID
    l_elbow_ID -(fixed)-> l_wrist_ID, and the same with r_

Every link and joint but the sensor's frame ends in ``_ID``. As in the reference model, ``torso`` is
at the height of the shoulders, ``l_shoulder`` is the upper arm and ``l_elbow`` the forearm. The
wrist of the reference model is at the knuckles here, where the forearm of the body model ends.
"""

from __future__ import annotations

import math
from xml.etree import ElementTree as Xml

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.parts import BodyParts, body_parts
from cardbox_tracker.body.posture import TURNING_LIMITS, place_limits
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.body.skeleton import NECK_LIMITS, head_from_pivot_m, neck_pivot_m
from cardbox_tracker.description.rep155 import LOWEST_BEND_RAD, LOWEST_RAISE_RAD
from cardbox_tracker.description.urdf_elements import (
    AT_PARENT,
    Movement,
    Origin,
    add_joint,
    add_link,
    add_patches,
    add_robot,
    xml_text,
)

_FULL = (-2 * math.pi, 2 * math.pi)


def rep155_urdf(body: BodyModel, body_id: str, optical_frame: str, torso_place: bool = True) -> str:
    """Return the URDF of ``body`` as XML text.

    Args:
        body: the measured person.
        body_id: ending of all link and joint names; letters, digits and underscores.
        optical_frame: frame of the camera, the root of the tree.
        torso_place: add the joints of place and head, which the joint states then must contain.
    """
    robot = add_robot(f"human_{body_id}")
    end = f"_{body_id}"
    add_link(robot, optical_frame)
    parts = body_parts(body.sizes)
    shoulders_m = parts.shoulder_height_m
    origin = _seen_from_camera(body)
    parent = optical_frame
    x_limits, z_limits = place_limits(body.placement.distance_m).tolist()
    place = {
        "x_body": Movement("prismatic", (1, 0, 0), x_limits),
        "z_body": Movement("prismatic", (0, 0, 1), z_limits),
    }
    trunk = {
        "body": Movement("prismatic", (0, 1, 0), TURNING_LIMITS[0].tolist()),
        "y_waist": Movement("revolute", (0, 0, 1), TURNING_LIMITS[3].tolist()),
        "waist": Movement("revolute", (0, 1, 0), TURNING_LIMITS[2].tolist()),
        "r_waist": Movement("revolute", (1, 0, 0), TURNING_LIMITS[1].tolist()),
    }
    for name, movement in {**(place if torso_place else {}), **trunk}.items():
        link = add_link(robot, name + end)
        add_joint(robot, name + end, parent, name + end, origin, movement)
        parent, origin = name + end, AT_PARENT
    add_patches(link, "torso", parts.waist, _up(parts.waist.middle_m))
    torso = add_link(robot, "torso" + end)
    add_joint(robot, "torso" + end, parent, "torso" + end, Origin(_up(shoulders_m)))
    add_patches(torso, "torso", parts.torso, _up(parts.torso.middle_m - shoulders_m))
    _head(robot, parts, torso_place, end)
    _arm(robot, parts, "l", "left", 1.0, end)
    _arm(robot, parts, "r", "right", -1.0, end)
    return xml_text(robot)


def _head(robot: Xml.Element, parts: BodyParts[float], has_neck: bool, end: str) -> None:
    """Add the head, which is fixed to the torso without ``has_neck``."""
    parent = "torso" + end
    centre_m = (parts.head.forward_m, 0.0, parts.head.middle_m - parts.shoulder_height_m)
    if has_neck:
        x, y, z = neck_pivot_m(parts)
        origin = Origin((x, y, z - parts.shoulder_height_m))
        yaw, pitch = NECK_LIMITS.tolist()
        for name, axis, limits in (
            ("y_head", (0, 0, 1), yaw),
            ("p_head", (0, -1, 0), [-pitch[1], -pitch[0]]),
        ):
            add_link(robot, name + end)
            movement = Movement("revolute", axis, limits)
            add_joint(robot, name + end, parent, name + end, origin, movement)
            parent, origin = name + end, AT_PARENT
        centre_m = head_from_pivot_m(parts)
    head = add_link(robot, "head" + end)
    add_joint(robot, "head" + end, parent, "head" + end, Origin(centre_m))
    add_patches(head, "torso", parts.head, _up(0.0))


def _arm(
    robot: Xml.Element, parts: BodyParts[float], prefix: str, material: str, side: float, end: str
) -> None:
    """Add an arm; ``side`` is +1 for the left arm, -1 for the right."""
    parent, origin = "torso" + end, Origin((0.0, side * parts.shoulder_aside_m, 0.0))
    for joint, child, axis, limits in (
        ("y_shoulder", "y_shoulder", (0, 0, -side), _FULL),
        ("p_shoulder", "p_shoulder", (side, 0, 0), (LOWEST_RAISE_RAD, math.pi)),
        ("r_shoulder", "shoulder", (0, 0, side), _FULL),
        ("elbow", "elbow", (0, -1, 0), (LOWEST_BEND_RAD, math.pi)),
    ):
        name = f"{prefix}_{child}{end}"
        if joint == "elbow":
            origin = Origin(_up(parts.upper_arm.bottom_m))
        link = add_link(robot, name)
        movement = Movement("revolute", axis, limits)
        add_joint(robot, f"{prefix}_{joint}{end}", parent, name, origin, movement)
        parent, origin = name, AT_PARENT
        part = {"shoulder": parts.upper_arm, "elbow": parts.forearm}.get(child)
        if part:
            add_patches(link, material, part, _up(part.middle_m))
    wrist = f"{prefix}_wrist{end}"
    add_link(robot, wrist)
    add_joint(robot, wrist, parent, wrist, Origin(_up(parts.forearm.bottom_m)))


def _up(height_m: float) -> tuple[float, float, float]:
    return (0.0, 0.0, height_m)


def _seen_from_camera(body: BodyModel) -> Origin:
    """Return the origin of the middle of the hips in the optical frame while d1 is 0."""
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
    return Origin((x, y, z), _rpy(rotation))


def _rpy(rotation: FloatArray) -> tuple[float, float, float]:
    """Return roll, pitch and yaw with Rz(yaw) Ry(pitch) Rx(roll) = ``rotation`` (3, 3)."""
    level = math.hypot(rotation[0, 0], rotation[1, 0])
    pitch = math.atan2(-rotation[2, 0], level)
    if level < 1e-9:  # straight up or down: roll and yaw turn about the same axis
        return 0.0, pitch, math.atan2(-rotation[0, 1], rotation[1, 1])
    return (
        math.atan2(rotation[2, 1], rotation[2, 2]),
        pitch,
        math.atan2(rotation[1, 0], rotation[0, 0]),
    )
