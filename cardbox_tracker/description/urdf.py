"""A robot description (URDF) of a measured person.

Its movable joints are the 12 of the posture, by the same names and signs, so that
robot_state_publisher and RViz show the person from the joint states alone:

    camera_level -(fixed)-> hips -torso_y-> -torso_yaw-> -torso_pitch-> -torso_roll-> torso
    torso -abduction (X)-> -flexion (Y)-> upper arm -abduction-> -flexion-> forearm -(fixed)-> hand

The root ``camera_level`` follows REP-103: origin at the camera's centre, X forward (away from the
camera), Y left, Z up, level even when the camera is pitched. The person faces the camera, so the
hips are turned by half a turn. The visuals are the patches of the cardbox model as thin boxes.
"""

from __future__ import annotations

import math
from xml.etree import ElementTree as Xml

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import JOINT_LIMITS, JOINT_NAMES
from cardbox_tracker.description.urdf_elements import (
    add_box,
    add_joint,
    add_link,
    add_robot,
    xml_text,
)

ROOT_LINK = "camera_level"
PATCH_THICKNESS_M = 0.004


def urdf_from_body(
    body: BodyModel, optical_frame: str | None = None, name: str = "cardbox_person"
) -> str:
    """Return the URDF of ``body`` as XML text.

    Args:
        body: the measured person.
        optical_frame: if given, also add the camera's optical frame of that name, pitched as the
            body model says, so that markers and keypoints show up in the same tree.
        name: name of the robot.
    """
    robot = add_robot(name)
    add_link(robot, ROOT_LINK)
    if optical_frame:
        add_link(robot, optical_frame)
        # Level optical axes seen from REP-103 axes, then turned down by the pitch about X.
        rpy = (-math.pi / 2 - body.camera_pose.pitch_rad, 0.0, -math.pi / 2)
        add_joint(robot, f"{ROOT_LINK}_to_optical", "fixed", ROOT_LINK, optical_frame, rpy=rpy)
    add_link(robot, "hips")
    origin = (body.placement.distance_m, 0.0, body.placement.hip_height_m)
    add_joint(robot, "camera_to_hips", "fixed", ROOT_LINK, "hips", origin, (0.0, 0.0, math.pi))
    _trunk(robot, body)
    _arm(robot, body, "left", 1.0)
    _arm(robot, body, "right", -1.0)
    return xml_text(robot)


def _trunk(robot: Xml.Element, body: BodyModel) -> None:
    size = body.size
    parent = "hips"
    for joint, axis in (
        ("torso_y", (0, 1, 0)),
        ("torso_yaw", (0, 0, 1)),
        ("torso_pitch", (0, 1, 0)),
        ("torso_roll", (1, 0, 0)),
    ):
        child = "torso" if joint == "torso_roll" else f"{joint}_link"
        kind = "prismatic" if joint == "torso_y" else "revolute"
        link = add_link(robot, child)
        add_joint(robot, joint, kind, parent, child, axis=axis, limits=_limits(joint))
        parent = child
    waist_m, torso_m = size("waist_height"), size("torso_height")
    top_m = waist_m + torso_m
    # URDF has no trapezoid: the torso's frontal patch is drawn with its mean width.
    width_m = (size("torso_top_width") + size("torso_bottom_width")) / 2
    thin = PATCH_THICKNESS_M
    middle_m = waist_m + torso_m / 2
    add_box(link, "torso", (thin, width_m, torso_m), (0, 0, middle_m))
    add_box(link, "torso", (size("torso_depth"), thin, torso_m), (0, 0, middle_m))
    add_box(link, "torso", (size("torso_depth"), size("torso_top_width"), thin), (0, 0, top_m))
    add_box(link, "torso", (thin, size("waist_width"), waist_m), (0, 0, waist_m / 2))
    add_box(link, "torso", (size("waist_depth"), thin, waist_m), (0, 0, waist_m / 2))
    head = add_link(robot, "head")
    height_m = top_m + size("neck_length") + size("head_height") / 2
    add_joint(robot, "neck", "fixed", "torso", "head", (size("head_offset"), 0.0, height_m))
    add_box(head, "torso", (thin, size("head_width"), size("head_height")), (0, 0, 0))
    add_box(head, "torso", (size("head_depth"), thin, size("head_height")), (0, 0, 0))


def _arm(robot: Xml.Element, body: BodyModel, name: str, side: float) -> None:
    """``side`` is +1 for the left arm, -1 for the right: abduction is mirrored, flexion is not."""
    size = body.size
    height_m = size("waist_height") + size("torso_height") - size("shoulder_drop")
    parent, origin = "torso", (0.0, side * size("shoulder_breadth") / 2, height_m)
    for joint, part in (("shoulder", "upper_arm"), ("elbow", "forearm")):
        turned, limb = f"{name}_{joint}_link", f"{name}_{part}"
        add_link(robot, turned)
        abduction, flexion = f"{name}_{joint}_abduction", f"{name}_{joint}_flexion"
        add_joint(
            *(robot, abduction, "revolute", parent, turned, origin),
            axis=(side, 0, 0),
            limits=_limits(abduction),
        )
        link = add_link(robot, limb)
        add_joint(
            *(robot, flexion, "revolute", turned, limb),
            axis=(0, -1, 0),
            limits=_limits(flexion),
        )
        length_m, width_m = size(f"{part}_length"), size(f"{part}_width")
        add_box(link, name, (PATCH_THICKNESS_M, width_m, length_m), (0, 0, -length_m / 2))
        add_box(link, name, (width_m, PATCH_THICKNESS_M, length_m), (0, 0, -length_m / 2))
        parent, origin = limb, (0.0, 0.0, -length_m)
    add_link(robot, f"{name}_hand")
    add_joint(robot, f"{name}_wrist", "fixed", parent, f"{name}_hand", origin)


def _limits(name: str) -> tuple[float, float]:
    lowest, highest = JOINT_LIMITS[JOINT_NAMES.index(name)]
    return float(lowest), float(highest)
