"""Robot descriptions (URDF) of a measured person, and the frames of their links.

The joints are those of the skeleton (:mod:`.skeleton`) by the same names, so robot_state_publisher
and RViz show the person from ``robot_description`` and ``joint_states`` alone, and the links are
where ``keypoints`` has them:

    camera_level -(fixed)-> hips -torso_x-> -torso_z-> -torso_y-> -torso_yaw-> -torso_pitch->
    -torso_roll-> torso
    torso -neck_yaw-> -neck_pitch-> -(fixed)-> head
    torso -clavicle_elevation-> clavicle -abduction (X)-> -flexion (Y)-> upper arm
    upper arm -abduction-> -flexion-> forearm -(fixed)-> hand
    torso_yaw -hip_flexion-> -hip_abduction-> -hip_rotation-> thigh -knee_flexion-> shank
    -(fixed)-> foot

If the height of the hips is known, so is the frame ``floor``, which is level below the camera, at
the height of the feet of the person who was measured.

The root ``camera_level`` follows REP-103: origin at the camera's centre, X forward (away from the
camera), Y left, Z up, level even when the camera is pitched. The person faces the camera, so the
hips are turned by half a turn; they stay where the person was measured. The visuals are the patches
of the cardbox model as thin boxes.

After REP-155, the ROS convention for people around robots, the root is the sensor's frame, every
other name ends in ``_ID``, and the arms have the joints of :mod:`.rep155`:

    sensor frame -x_body-> -z_body-> -body-> body_ID
    body_ID -y_waist-> -waist-> -r_waist-> -(fixed)-> torso_ID
    torso_ID -y_head-> -p_head-> -(fixed)-> head_ID
    torso_ID -l_clavicle-> -y_shoulder-> -p_shoulder-> -r_shoulder-> l_shoulder_ID
    l_shoulder_ID -elbow-> l_elbow_ID -(fixed)-> l_wrist_ID, and the same with r_

As in the reference model, ``torso`` is at the height of the shoulders, ``l_shoulder`` is the upper
arm and ``l_elbow`` the forearm. The wrist of the reference model is at the knuckles here, where the
forearm of the body model ends.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple
from xml.etree import ElementTree as Xml

import numpy as np

from cardbox_tracker.person.legs import floor_m
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import Part, body_parts
from cardbox_tracker.person.posture import place_limits
from cardbox_tracker.person.proportions import SHANK_SHARE, THIGH_SHARE, stature_of
from cardbox_tracker.person.rep155 import rep155_skeleton
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import FIXED, POSTURE_GROUPS, PRISMATIC, SKELETON, Group, Joint

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
"""Unit quaternion x, y, z, w."""

ROOT_LINK = "camera_level"
PATCH_THICKNESS_M = 0.004
"""Thickness of the boxes that show patches, metres."""
COLORS = {"torso": "0.25 0.45 0.75 0.9", "left": "0.2 0.7 0.4 0.9", "right": "0.85 0.45 0.2 0.9"}
"""Colour of each material."""
# URDF requires both values, but nothing uses them.
_FORMAL_LIMITS = {"effort": "100", "velocity": "20"}
_ZERO = (0.0, 0.0, 0.0)


def urdf_from_body(
    body: BodyModel,
    optical_frame: str | None = None,
    torso_place: bool = True,
    hands: bool = False,
) -> str:
    """Return the URDF of ``body`` as XML text.

    The ``optical_frame``, if given, is added with the camera's pitch, so that markers and keypoints
    are in the same tree. With ``torso_place`` it has the joints beside the 12 of the posture, with
    ``hands`` those of the hands; joint states must then contain them, or the transforms beyond are
    missing. Legs have the mean lengths of people of that size.
    """
    robot = _Robot("cardbox_person", ROOT_LINK)
    if optical_frame:
        # Optical axes in the axes of REP-103, then rotated down by the pitch about X.
        tilted = -math.pi / 2 - body.camera_pose.pitch_rad, 0.0, -math.pi / 2
        if body.camera_pose.roll_rad:
            # The reference frame has X and Y the other way round.
            tilted = _rpy((_optical(body) * (-1.0, -1.0, 1.0)).T)
        robot.fix(f"{ROOT_LINK}_to_optical", ROOT_LINK, optical_frame, _ZERO, tilted)
    hips_m = body.placement.distance_m, 0.0, body.placement.hip_height_m
    height_m = floor_m(body)
    if height_m is not None:
        robot.fix("camera_to_floor", ROOT_LINK, "floor", (0.0, 0.0, height_m), _ZERO)
    robot.fix("camera_to_hips", ROOT_LINK, "hips", hips_m, (0.0, 0.0, math.pi))
    moving = {*Group} - {Group.HAND} if torso_place else {*POSTURE_GROUPS}
    robot.add(body, SKELETON, moving | ({Group.HAND} if hands else set()), "hips")
    parts = body_parts(body.sizes)
    robot.show("torso", "torso", parts.torso)
    lid = parts.torso.depth_m, parts.torso.top_width_m, PATCH_THICKNESS_M
    robot.box("torso", "torso", lid, parts.torso.top_m)
    robot.show("torso", "torso", parts.waist)
    robot.show("head", "torso", parts.head, parts.head.middle_m)
    for side in ("left", "right"):
        robot.show(f"{side}_upper_arm", side, parts.upper_arm)
        robot.show(f"{side}_forearm", side, parts.forearm)
        for link, share in (("thigh", THIGH_SHARE), ("shank", SHANK_SHARE)):
            if torso_place:
                length_m = share * stature_of(parts)
                width_m = parts.upper_arm.mean_width_m
                robot.box(f"{side}_{link}", side, (width_m, width_m, length_m), -length_m / 2)
    return robot.text()


def rep155_urdf(body: BodyModel, body_id: str, optical_frame: str, torso_place: bool = True) -> str:
    """Return the URDF of ``body`` after REP-155 as XML text.

    ``body_id``, of letters, digits and underscores, ends all names of links and joints. The root is
    the camera's ``optical_frame``. With ``torso_place`` it has the joints of place, head and
    clavicles, which the joint states then must contain.
    """
    robot = _Robot(f"human_{body_id}", optical_frame, f"_{body_id}")
    # The hips in the optical frame while d1 is 0.
    rotation, moving = _optical(body), {*(Group if torso_place else POSTURE_GROUPS)}
    hips_m = rotation @ (-body.placement.distance_m, 0.0, body.placement.hip_height_m)
    placed = optical_frame, hips_m.tolist(), _rpy(rotation)
    robot.add(body, tuple(rep155_skeleton()), moving, *placed)
    parts = body_parts(body.sizes)
    robot.show("r_waist", "torso", parts.waist)
    robot.show("torso", "torso", parts.torso, parts.shoulder_height_m)
    robot.show("head", "torso", parts.head, parts.head.middle_m)
    for side in ("left", "right"):
        robot.show(f"{side[0]}_shoulder", side, parts.upper_arm)
        robot.show(f"{side[0]}_elbow", side, parts.forearm)
    return robot.text()


class _Robot:
    """A URDF in the making; all links but the root and all joints end in ``ending``."""

    def __init__(self, name: str, root: str, ending: str = "") -> None:
        self._xml, self._ending = Xml.Element("robot", name=name), ending
        for material, rgba in COLORS.items():
            Xml.SubElement(Xml.SubElement(self._xml, "material", name=material), "color", rgba=rgba)
        self._links = {root: Xml.SubElement(self._xml, "link", name=root)}

    def add(
        self,
        body: BodyModel,
        skeleton: Sequence[Joint],
        moving: set[Group],
        root: str,
        xyz_m: Vector = _ZERO,
        rpy: Vector = _ZERO,
    ) -> None:
        """Add a skeleton from ``root`` on; of its joints, those of groups that move."""
        parts, joints = body_parts(body.sizes), {joint.name: joint for joint in skeleton}
        used = moving | {Group.END}
        places = iter(place_limits(body.placement.distance_m).tolist())
        limits = {j.name: next(places) if j.group == Group.PLACE else j.limits for j in skeleton}
        waiting = [joint for joint in skeleton if joint.group in used]
        while waiting:
            joint = waiting.pop(0)
            parent, at_m = joints.get(joint.parent), np.array(joint.offset(parts))
            while parent is not None and parent.group not in used:
                at_m, parent = at_m + parent.offset(parts), joints.get(parent.parent)
            if parent is None:
                self._join(joint, root, xyz_m, rpy, limits[joint.name])
            elif parent.link in self._links:
                self._join(joint, parent.link, at_m.tolist(), _ZERO, limits[joint.name])
            else:
                waiting.append(joint)

    def _join(
        self, joint: Joint, parent: str, xyz_m: Vector, rpy: Vector, limits: Iterable[float]
    ) -> None:
        made = self.fix(joint.name, parent, joint.link, xyz_m, rpy)
        made.attrib["type"] = joint.kind
        if joint.kind != FIXED:
            Xml.SubElement(made, "axis", xyz=_text(joint.axis))
            lower, upper = (f"{limit:.9g}" for limit in limits)
            Xml.SubElement(made, "limit", {"lower": lower, "upper": upper, **_FORMAL_LIMITS})

    def fix(self, name: str, parent: str, child: str, xyz_m: Vector, rpy: Vector) -> Xml.Element:
        """Add a link and the fixed joint that carries it."""
        ends = {"parent": self._links[parent].attrib["name"], "child": child + self._ending}
        self._links[child] = Xml.SubElement(self._xml, "link", name=ends["child"])
        joint = Xml.SubElement(self._xml, "joint", name=name + self._ending, type=FIXED)
        for tag, link in ends.items():
            Xml.SubElement(joint, tag, link=link)
        Xml.SubElement(joint, "origin", xyz=_text(xyz_m), rpy=_text(rpy))
        return joint

    def show(self, link: str, material: str, part: Part[float], height_m: float = 0.0) -> None:
        """Show the frontal patch, a torso's with its mean width, and the sagittal one of a part."""
        middle_m = part.middle_m - height_m
        self.box(link, material, (PATCH_THICKNESS_M, part.mean_width_m, part.height_m), middle_m)
        self.box(link, material, (part.depth_m, PATCH_THICKNESS_M, part.height_m), middle_m)

    def box(self, link: str, material: str, extent_m: Vector, height_m: float) -> None:
        """Show a box along the axes of a link with its middle at ``height_m``."""
        visual = Xml.SubElement(self._links[link], "visual")
        Xml.SubElement(visual, "origin", xyz=_text((0.0, 0.0, height_m)), rpy="0 0 0")
        Xml.SubElement(Xml.SubElement(visual, "geometry"), "box", size=_text(extent_m))
        Xml.SubElement(visual, "material", name=material)

    def text(self) -> str:
        """Return the document."""
        Xml.indent(self._xml)
        return '<?xml version="1.0"?>\n' + Xml.tostring(self._xml, encoding="unicode") + "\n"


def _text(values: Iterable[float]) -> str:
    # Adding 0.0 turns a negative zero into a plain one.
    return " ".join(f"{value + 0.0:.12g}" for value in values)


def _optical(body: BodyModel) -> FloatArray:
    """Return the rotation (3, 3) from reference to optical frame; columns are the body's axes."""
    down, roll = body.camera_pose.pitch_rad, body.camera_pose.roll_rad
    rotation = np.array(
        [
            (0.0, 1.0, 0.0),
            (math.sin(down), 0.0, -math.cos(down)),
            (-math.cos(down), 0.0, -math.sin(down)),
        ]
    )
    c, s = math.cos(roll), math.sin(roll)
    return np.array([(c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)]) @ rotation if roll else rotation


def _rpy(rotation: FloatArray) -> Vector:
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


class LinkTransform(NamedTuple):
    """Pose of the frame ``child`` in ``parent``: metres, and a unit quaternion x, y, z, w."""

    parent: str
    child: str
    translation_m: Vector
    rotation: Quaternion


class _Moving(NamedTuple):
    """A joint of a URDF; ``at_zero`` is its transform at the value 0."""

    name: str
    kind: str
    axis: Vector
    at_zero: LinkTransform

    def transform(self, value: float) -> LinkTransform:
        """Return the transform at ``value``, rad or metres."""
        if self.kind != PRISMATIC:
            x, y, z = (math.sin(value / 2) * part for part in self.axis)
            turned = _product(self.at_zero.rotation, (x, y, z, math.cos(value / 2)))
            return self.at_zero._replace(rotation=turned)
        x, y, z = self.at_zero.translation_m
        u, v, w = _rotated(self.at_zero.rotation, self.axis)
        moved = (x + value * u, y + value * v, z + value * w)
        return self.at_zero._replace(translation_m=moved)


class LinkTransforms:
    """Transforms from every link of a URDF to its parent, as on TF.

    They are computed from the URDF itself, so that TF and URDF agree; robot_state_publisher does
    the same from ``robot_description`` and ``joint_states``. Joints may be fixed, revolute,
    continuous and prismatic.

    Attributes:
        joint_names: names of the movable joints, in the order of the URDF.
    """

    def __init__(self, urdf: str) -> None:
        """Parse the joints of ``urdf``, the XML text of a URDF."""
        joints = [_joint(element) for element in Xml.fromstring(urdf).findall("joint")]
        self._fixed = [joint.at_zero for joint in joints if joint.kind == FIXED]
        self._movable = [joint for joint in joints if joint.kind != FIXED]
        self.joint_names = tuple(joint.name for joint in self._movable)

    def at(self, positions: Mapping[str, float]) -> list[LinkTransform]:
        """Return the transform of each link but the root at ``positions``; else ValueError."""
        missing = [name for name in self.joint_names if name not in positions]
        if missing:
            raise ValueError(f"joints {', '.join(missing)} are missing")
        moved = [joint.transform(float(positions[joint.name])) for joint in self._movable]
        return [*self._fixed, *moved]


def _joint(element: Xml.Element) -> _Moving:
    origin = _attributes(element, "origin")
    roll, pitch, yaw = _vector(origin.get("rpy", "0 0 0"))
    turns = [_about(0, roll), _about(1, pitch), _about(2, yaw)]
    at_zero = LinkTransform(
        _attributes(element, "parent")["link"],
        _attributes(element, "child")["link"],
        _vector(origin.get("xyz", "0 0 0")),
        _product(turns[2], _product(turns[1], turns[0])),
    )
    x, y, z = _vector(_attributes(element, "axis").get("xyz", "1 0 0"))
    length = math.sqrt(x * x + y * y + z * z)
    axis = (x / length, y / length, z / length)
    return _Moving(element.attrib["name"], element.attrib["type"], axis, at_zero)


def _attributes(element: Xml.Element, tag: str) -> dict[str, str]:
    found = element.find(tag)
    return {} if found is None else found.attrib


def _vector(text: str) -> Vector:
    x, y, z = (float(word) for word in text.split())
    return x, y, z


def _about(axis: int, angle_rad: float) -> Quaternion:
    parts = [0.0, 0.0, 0.0]
    parts[axis] = math.sin(angle_rad / 2)
    return parts[0], parts[1], parts[2], math.cos(angle_rad / 2)


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the quaternion that turns by ``b``, then by ``a``."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _rotated(turn: Quaternion, vector: Vector) -> Vector:
    back = (-turn[0], -turn[1], -turn[2], turn[3])
    x, y, z, _ = _product(_product(turn, (*vector, 0.0)), back)
    return x, y, z
