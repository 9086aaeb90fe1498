"""Builds the elements of a URDF: links, visible boxes, joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple
from xml.etree import ElementTree as Xml

from cardbox_tracker.body.parts import Part

Vector = Sequence[float]

PATCH_THICKNESS_M = 0.004
"""Thickness of the boxes that show patches, metres."""

COLORS = {"torso": "0.25 0.45 0.75 0.9", "left": "0.2 0.7 0.4 0.9", "right": "0.85 0.45 0.2 0.9"}
"""Colour of each material."""
# URDF requires both values, but nothing uses them.
_FORMAL_LIMITS: dict[str, str] = {"effort": "100", "velocity": "20"}


class Origin(NamedTuple):
    """Pose of a joint in the frame of its parent link: metres, and roll, pitch, yaw in rad."""

    xyz_m: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)


AT_PARENT = Origin()
"""The origin of the parent link itself."""


class Movement(NamedTuple):
    """Movement of a joint: its type, its axis, and its lower and upper limit in rad or metres."""

    kind: str
    axis: Vector
    limits: Vector


def add_robot(name: str) -> Xml.Element:
    """Return a robot named ``name`` with the materials of ``COLORS``."""
    robot = Xml.Element("robot", name=name)
    for material, rgba in COLORS.items():
        Xml.SubElement(Xml.SubElement(robot, "material", name=material), "color", rgba=rgba)
    return robot


def add_link(robot: Xml.Element, name: str) -> Xml.Element:
    """Add a link."""
    return Xml.SubElement(robot, "link", name=name)


def add_box(link: Xml.Element, material: str, extent_m: Vector, centre_m: Vector) -> None:
    """Add a visible box along the axes of ``link``, extents in metres."""
    visual = Xml.SubElement(link, "visual")
    Xml.SubElement(visual, "origin", xyz=_text(centre_m), rpy="0 0 0")
    Xml.SubElement(Xml.SubElement(visual, "geometry"), "box", size=_text(extent_m))
    Xml.SubElement(visual, "material", name=material)


def add_patches(link: Xml.Element, material: str, part: Part[float], centre_m: Vector) -> None:
    """Add the frontal and the sagittal patch of ``part`` around a centre, as thin boxes.

    URDF has no trapezoid: the torso's frontal patch is drawn with its mean width.
    """
    thin = PATCH_THICKNESS_M
    add_box(link, material, (thin, part.mean_width_m, part.height_m), centre_m)
    add_box(link, material, (part.depth_m, thin, part.height_m), centre_m)


def add_joint(
    robot: Xml.Element,
    name: str,
    parent: str,
    child: str,
    origin: Origin = AT_PARENT,
    movement: Movement | None = None,
) -> None:
    """Add a joint, which is fixed without a ``movement``."""
    kind = "fixed" if movement is None else movement.kind
    joint = Xml.SubElement(robot, "joint", name=name, type=kind)
    Xml.SubElement(joint, "parent", link=parent)
    Xml.SubElement(joint, "child", link=child)
    Xml.SubElement(joint, "origin", xyz=_text(origin.xyz_m), rpy=_text(origin.rpy))
    if movement is not None:
        Xml.SubElement(joint, "axis", xyz=_text(movement.axis))
        lower, upper = movement.limits
        given = {"lower": f"{lower:.9g}", "upper": f"{upper:.9g}"} if kind != "continuous" else {}
        Xml.SubElement(joint, "limit", {**given, **_FORMAL_LIMITS})


def xml_text(robot: Xml.Element) -> str:
    """Return the document of ``robot``."""
    Xml.indent(robot)
    return '<?xml version="1.0"?>\n' + Xml.tostring(robot, encoding="unicode") + "\n"


def _text(values: Vector) -> str:
    # Adding 0.0 turns a negative zero into a plain one.
    return " ".join(f"{value + 0.0:.12g}" for value in values)
