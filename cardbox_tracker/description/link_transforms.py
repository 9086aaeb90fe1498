"""Transforms from every link of a robot description to its parent, as published on TF.

They are computed from the URDF itself, so that TF and URDF agree; robot_state_publisher does the
same from ``robot_description`` and ``joint_states``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple
from xml.etree import ElementTree as Xml

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
"""Unit quaternion x, y, z, w."""

_TURNING = ("revolute", "continuous")


class LinkTransform(NamedTuple):
    """Pose of the frame ``child`` in ``parent``: metres, and a unit quaternion x, y, z, w."""

    parent: str
    child: str
    translation_m: Vector
    rotation: Quaternion


class _Joint(NamedTuple):
    """A joint; ``at_zero`` is its transform at the value 0."""

    name: str
    kind: str
    axis: Vector
    at_zero: LinkTransform

    def transform(self, value: float) -> LinkTransform:
        """Return the transform at ``value``, rad or metres."""
        if self.kind in _TURNING:
            x, y, z = (math.sin(value / 2) * part for part in self.axis)
            turned = _product(self.at_zero.rotation, (x, y, z, math.cos(value / 2)))
            return self.at_zero._replace(rotation=turned)
        x, y, z = self.at_zero.translation_m
        u, v, w = _rotated(self.at_zero.rotation, self.axis)
        moved = (x + value * u, y + value * v, z + value * w)
        return self.at_zero._replace(translation_m=moved)


class LinkTransforms:
    """The transforms of a URDF with fixed, revolute, continuous and prismatic joints.

    Attributes:
        joint_names: names of the movable joints, in the order of the URDF.
    """

    def __init__(self, urdf: str) -> None:
        """Parse the joints of ``urdf``, the XML text of a URDF."""
        joints = [_joint(element) for element in Xml.fromstring(urdf).findall("joint")]
        self._fixed = [joint.at_zero for joint in joints if joint.kind == "fixed"]
        self._movable = [joint for joint in joints if joint.kind != "fixed"]
        self.joint_names = tuple(joint.name for joint in self._movable)

    def at(self, positions: Mapping[str, float]) -> list[LinkTransform]:
        """Return the transform of every link but the root, at ``positions``, rad and metres.

        Raises:
            ValueError: a movable joint has no position.
        """
        missing = [name for name in self.joint_names if name not in positions]
        if missing:
            raise ValueError(f"joints {', '.join(missing)} are missing")
        moved = [joint.transform(float(positions[joint.name])) for joint in self._movable]
        return [*self._fixed, *moved]


def _joint(element: Xml.Element) -> _Joint:
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
    return _Joint(element.attrib["name"], element.attrib["type"], axis, at_zero)


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
