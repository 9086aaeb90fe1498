"""Robot description (URDF) of a measured person.

Its movable joints are those of the joint states, by the same names and signs: the posture's 12,
``torso_x``, ``torso_z``, ``neck_yaw`` and ``neck_pitch``. So robot_state_publisher and RViz show
the person from them alone:

    camera_level -(fixed)-> hips -torso_x-> -torso_z-> -torso_y-> -torso_yaw-> -torso_pitch->
    -torso_roll-> torso
    torso -neck_yaw-> -neck_pitch-> -(fixed)-> head
    torso -abduction (X)-> -flexion (Y)-> upper arm -abduction-> -flexion-> forearm -(fixed)-> hand

The root ``camera_level`` follows REP-103: origin at the camera's centre, X forward (away from the
camera), Y left, Z up, level even when the camera is pitched. The person faces the camera, so the
hips are turned by half a turn; they stay where the person was measured. The visuals are the patches
of the cardbox model as thin boxes.
"""

from __future__ import annotations

import math
from xml.etree import ElementTree as Xml

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.parts import BodyParts, body_parts
from cardbox_tracker.body.posture import TURNING_LIMITS, place_limits
from cardbox_tracker.body.skeleton import (
    JOINT_NAMES,
    NECK_LIMITS,
    NECK_NAMES,
    PLACE_NAMES,
    head_from_pivot_m,
    neck_pivot_m,
)
from cardbox_tracker.description.urdf_elements import (
    AT_PARENT,
    PATCH_THICKNESS_M,
    Movement,
    Origin,
    add_box,
    add_joint,
    add_link,
    add_patches,
    add_robot,
    xml_text,
)

ROOT_LINK = "camera_level"

_LIMITS = dict(
    zip(
        (*JOINT_NAMES, *NECK_NAMES),
        [*TURNING_LIMITS.tolist(), *NECK_LIMITS.tolist()],
        strict=True,
    )
)


def urdf_from_body(
    body: BodyModel,
    optical_frame: str | None = None,
    torso_place: bool = True,
) -> str:
    """Return the URDF of ``body`` as XML text.

    Args:
        body: the measured person.
        optical_frame: name of the camera's optical frame; if given, it is added with the camera's
            pitch, so that markers and keypoints are in the same tree.
        torso_place: add the joints ``torso_x``, ``torso_z``, ``neck_yaw`` and ``neck_pitch``; the
            joint states then must contain them, or the transforms beyond are missing.
    """
    robot = add_robot("cardbox_person")
    add_link(robot, ROOT_LINK)
    if optical_frame:
        add_link(robot, optical_frame)
        # Optical axes in the axes of REP-103, then rotated down by the pitch about X.
        tilted = Origin(rpy=(-math.pi / 2 - body.camera_pose.pitch_rad, 0.0, -math.pi / 2))
        add_joint(robot, f"{ROOT_LINK}_to_optical", ROOT_LINK, optical_frame, tilted)
    add_link(robot, "hips")
    place_m = (body.placement.distance_m, 0.0, body.placement.hip_height_m)
    add_joint(robot, "camera_to_hips", ROOT_LINK, "hips", Origin(place_m, (0.0, 0.0, math.pi)))
    parts = body_parts(body.sizes)
    _trunk(robot, parts, _place(robot, body) if torso_place else "hips")
    _head(robot, parts, has_neck=torso_place)
    _arm(robot, parts, "left", 1.0)
    _arm(robot, parts, "right", -1.0)
    return xml_text(robot)


def _place(robot: Xml.Element, body: BodyModel) -> str:
    """Add the joints of the place below the hips and return their last link."""
    parent = "hips"
    limits = place_limits(body.placement.distance_m).tolist()
    for joint, axis, ends in zip(PLACE_NAMES, ((1, 0, 0), (0, 0, 1)), limits, strict=True):
        child = f"{joint}_link"
        add_link(robot, child)
        movement = Movement("prismatic", axis, ends)
        add_joint(robot, joint, parent, child, movement=movement)
        parent = child
    return parent


def _trunk(robot: Xml.Element, parts: BodyParts[float], parent: str) -> None:
    for joint, axis in (
        ("torso_y", (0, 1, 0)),
        ("torso_yaw", (0, 0, 1)),
        ("torso_pitch", (0, 1, 0)),
        ("torso_roll", (1, 0, 0)),
    ):
        child = "torso" if joint == "torso_roll" else f"{joint}_link"
        kind = "prismatic" if joint == "torso_y" else "revolute"
        link = add_link(robot, child)
        add_joint(robot, joint, parent, child, movement=Movement(kind, axis, _LIMITS[joint]))
        parent = child
    torso, waist = parts.torso, parts.waist
    add_patches(link, "torso", torso, (0.0, 0.0, torso.middle_m))
    lid = (torso.depth_m, torso.top_width_m, PATCH_THICKNESS_M)
    add_box(link, "torso", lid, (0.0, 0.0, torso.top_m))
    add_patches(link, "torso", waist, (0.0, 0.0, waist.middle_m))


def _head(robot: Xml.Element, parts: BodyParts[float], has_neck: bool) -> None:
    parent, centre_m = "torso", (parts.head.forward_m, 0.0, parts.head.middle_m)
    if has_neck:
        origin = Origin(neck_pivot_m(parts))
        for joint, axis in zip(NECK_NAMES, ((0, 0, 1), (0, 1, 0)), strict=True):
            child = f"{joint}_link"
            add_link(robot, child)
            movement = Movement("revolute", axis, _LIMITS[joint])
            add_joint(robot, joint, parent, child, origin, movement)
            parent, origin = child, AT_PARENT
        centre_m = head_from_pivot_m(parts)
    head = add_link(robot, "head")
    add_joint(robot, "neck", parent, "head", Origin(centre_m))
    add_patches(head, "torso", parts.head, (0.0, 0.0, 0.0))


def _arm(robot: Xml.Element, parts: BodyParts[float], name: str, side: float) -> None:
    """Add an arm; ``side``, +1 left and -1 right, mirrors the abduction but not the flexion."""
    shoulder = Origin((0.0, side * parts.shoulder_aside_m, parts.shoulder_height_m))
    parent, origin = "torso", shoulder
    for joint, limb, part in (
        ("shoulder", f"{name}_upper_arm", parts.upper_arm),
        ("elbow", f"{name}_forearm", parts.forearm),
    ):
        turned = f"{name}_{joint}_link"
        add_link(robot, turned)
        abduction, flexion = f"{name}_{joint}_abduction", f"{name}_{joint}_flexion"
        sideways = Movement("revolute", (side, 0, 0), _LIMITS[abduction])
        add_joint(robot, abduction, parent, turned, origin, sideways)
        link = add_link(robot, limb)
        forwards = Movement("revolute", (0, -1, 0), _LIMITS[flexion])
        add_joint(robot, flexion, turned, limb, movement=forwards)
        add_patches(link, name, part, (0.0, 0.0, part.middle_m))
        parent, origin = limb, Origin((0.0, 0.0, part.bottom_m))
    add_link(robot, f"{name}_hand")
    add_joint(robot, f"{name}_wrist", parent, f"{name}_hand", origin)
