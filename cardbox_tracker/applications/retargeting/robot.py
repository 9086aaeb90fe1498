"""A robot's joints, their places and their limits from its URDF."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from xml.etree import ElementTree as Xml

import numpy as np

from cardbox_tracker.common.errors import CardboxError, cut, quoted, reason_of
from cardbox_tracker.common.files import foreign, read_regular
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import rotation_x, rotation_y, rotation_z

_MOVABLE = ("revolute", "continuous", "prismatic")
# Some descriptions mean no limit by 1e16; differences of larger ones would not be finite.
_WIDEST = 1e16
# A joint whose limits are nearer stays.
_NARROWEST = 1e-6
_LARGEST_BYTES, _CHUNK = 16 * 1024 * 1024, 1 << 14
# The memory of a dynamic model grows with the third power of its freedoms: 330 MB at 128.
_MOST = {
    "levels of nested elements": 32,
    "elements": 100_000,
    "joints": 1000,
    "degrees of freedom": 128,
}
_FREEDOMS = {"fixed": 0, "planar": 3, "floating": 6}


@dataclass(frozen=True)
class Joint:
    """One joint between two links."""

    name: str
    kind: str  #: ``revolute``, ``continuous``, ``prismatic`` or any that stays, such as ``fixed``
    parent: str  #: name of a link
    child: str  #: name of a link
    origin_m: FloatArray  #: (3,), in the frame of ``parent``
    turn: FloatArray  #: rotation matrix (3, 3) from the child at 0 to ``parent``
    axis: FloatArray  #: unit vector (3,) in the frame of ``child``
    lower: float = 0.0  #: lowest position, rad or m; half a turn back for a ``continuous`` joint
    upper: float = 0.0  #: highest position, rad or m
    speed: float = math.inf  #: highest speed, rad/s or m/s; inf if the description gives none, or 0
    #: the joint that it copies, ``multiplier * position + offset``; empty for none
    mimics: str = ""
    multiplier: float = 1.0
    offset: float = 0.0

    @property
    def moves(self) -> bool:
        """True unless it stays or follows another joint."""
        return self.upper > self.lower and not self.mimics


@dataclass(frozen=True)
class Robot:
    """A robot."""

    urdf: str  #: description
    all_joints: dict[str, Joint]  #: every joint by the name of its child link

    @property
    def joints(self) -> dict[str, Joint]:
        """The joints that can be moved, by name, in the order of the description."""
        return {one.name: one for one in self.all_joints.values() if one.moves}

    @property
    def links(self) -> tuple[str, ...]:
        """All links; the root is the first one."""
        roots = {one.parent for one in self.all_joints.values()} - self.all_joints.keys()
        return (*sorted(roots), *self.all_joints)

    def path(self, link: str) -> tuple[Joint, ...]:
        """Return all joints from the root to ``link``; raise CardboxError if there is none."""
        if link not in self.links:
            raise CardboxError(
                f"the robot has no link {quoted(link)}; it has {cut(', '.join(self.links))}"
            )
        found: list[Joint] = []
        while link in self.all_joints:
            found.append(self.all_joints[link])
            link = found[-1].parent
        return tuple(reversed(found))

    def limits_of(self, names: Sequence[str]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return lower limits, upper limits and highest speeds, each (n,), of joints.

        Raises CardboxError if there is no movable joint of that name.
        """
        unknown = [name for name in names if name not in self.joints]
        if unknown:
            raise CardboxError(
                f"the robot has no movable joint {', '.join(map(quoted, unknown))}; it has "
                f"{cut(', '.join(self.joints))}"
            )
        chosen = [self.joints[name] for name in names]
        rows = np.array([(one.lower, one.upper, one.speed) for one in chosen], np.float64)
        lower, upper, speed = rows.reshape(-1, 3).T
        return lower, upper, speed

    def positions_of(
        self, name: str, text: str, joints: Sequence[str], usual: FloatArray | float
    ) -> FloatArray:
        """Return the positions (n,) of a text ``JOINT=VALUE,...``, rad or m, for ``joints``.

        Others are the ``usual`` ones, or the limits nearest to them. Raises CardboxError, which
        calls the text by its ``name``, for one that is not of these joints or beyond its limits.
        """
        limits = np.transpose(self.limits_of(joints)[:2])
        positions = np.clip(usual, *limits.T)
        for part in filter(None, (part.strip() for part in text.split(","))):
            joint, _, value = part.partition("=")
            try:
                number = joints.index(joint.strip())
                positions[number] = float(value)
            except ValueError:
                raise CardboxError(
                    f"the {name} {quoted(part)} is not JOINT=VALUE with one of {', '.join(joints)}"
                ) from None
            lower, upper = limits[number]
            if not lower <= positions[number] <= upper:
                raise CardboxError(
                    f"the {name} {quoted(part)} is beyond the joint's limits; expected {lower:g} "
                    f"to {upper:g}"
                )
        return positions

    def axis_of(self, joint: Joint) -> FloatArray:
        """Return the axis (3,) of a joint in the frame of the root while all joints are at 0."""
        axis = joint.axis
        for one in reversed(self.path(joint.child)):
            axis = one.turn @ axis
        return axis

    def table(self, roles: Mapping[str, str], max_speed: float) -> str:
        """Return a text with a row for each joint of ``roles``: name, role, limits, speed."""
        rows = [("joint", "role", "limits", "speed")]
        for name, role in roles.items():
            one = self.joints[name]
            unit = "m" if one.kind == "prismatic" else "rad"
            speed = min(one.speed, max_speed)
            given = "" if np.isfinite(one.speed) else ", the URDF gives none"
            limits = f"{one.lower:.2f} to {one.upper:.2f} {unit}"
            if unit == "rad" and 4 * math.pi < max(-one.lower, one.upper) <= 360.0:
                limits += ", are these degrees?"
            rows.append((name, role, limits, f"{speed:g} {unit}/s{given}"))
        widths = [max(len(row[column]) for row in rows) for column in range(4)]
        return "\n".join("  ".join(map(str.ljust, row, widths)).rstrip() for row in rows)


def load_robot(path: str | os.PathLike[str]) -> Robot:
    """Read a URDF file; raise CardboxError if it cannot be read, or has no movable joints."""
    with foreign(path, CardboxError, "a URDF file"):
        content = read_regular(path, _LARGEST_BYTES)
    return parse_robot(content, str(path))


def parse_robot(content: str | bytes, source: str = "the description") -> Robot:
    """Parse a URDF, in bytes of the encoding that they declare; ``source`` names it in errors.

    Raises CardboxError as :func:`load_robot`, and for xacro, entities, or too many levels, elements
    or joints.
    """
    encoding = "utf-8" if isinstance(content, str) else None
    data = content.encode("utf-8", "replace") if isinstance(content, str) else content
    parser = Xml.XMLParser(target=_BoundedBuilder(source), encoding=encoding)
    try:
        # A parser reads to the end of what it is fed, also after an error.
        for begin in range(0, len(data), _CHUNK):
            parser.feed(data[begin : begin + _CHUNK])
        return _robot(parser.close())
    except (KeyError, ValueError) as error:
        raise CardboxError(
            f"{source} is not a URDF with movable joints: {reason_of(error)}; every joint needs "
            "name, type, parent and child, and a revolute or prismatic joint finite limits"
        ) from None
    except (Xml.ParseError, LookupError) as error:
        raise CardboxError(f"{source} is not XML: {error}; expected the URDF of a robot") from None


class _BoundedBuilder(Xml.TreeBuilder):
    """Builds a description, and refuses it as soon as it is too large."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self._source, self._counts = source, dict.fromkeys(_MOST, 0)

    def start(self, tag: str, attributes: Mapping[str, str]) -> Xml.Element:
        """Count an element; the joints of a robot lie in its root, others in transmissions."""
        is_joint = tag == "joint" and self._counts["levels of nested elements"] == 1
        if "xacro" in tag or any("${" in value for value in attributes.values()):
            raise CardboxError(
                f"{self._source} is xacro; convert it first: xacro FILE > robot.urdf"
            )
        freedoms = _FREEDOMS.get(attributes.get("type", ""), 1)
        more = (1, 1, is_joint, is_joint * freedoms)
        for (what, most), added in zip(_MOST.items(), more, strict=True):
            self._counts[what] += added
            if self._counts[what] > most:
                raise CardboxError(
                    f"{self._source} has more than {most} {what}; give the URDF of a robot, or of "
                    "its arm alone"
                )
        return super().start(tag, dict(attributes))

    def doctype(self, *_: str | None) -> None:
        """Refuse entities, few lines of which can make gigabytes."""
        raise CardboxError(f"{self._source} defines entities, which no URDF needs; remove them")

    def end(self, tag: str) -> Xml.Element:
        self._counts["levels of nested elements"] -= 1
        return super().end(tag)


def _robot(root: Xml.Element) -> Robot:
    links = [element.attrib["name"] for element in root.findall("link")]
    joints: dict[str, Joint] = {}
    for element in root.findall("joint"):
        one = _joint(element)
        if one.child in joints or any(one.name == other.name for other in joints.values()):
            raise ValueError(
                f"the link {one.child} has two parents, or two joints are named {one.name}"
            )
        if not {one.parent, one.child} <= set(links):
            raise ValueError(f"the joint {one.name} is at a link that the description lacks")
        joints[one.child] = one
    for link in joints:
        seen, at = {link}, joints[link].parent
        while at in joints:
            if at in seen:
                raise ValueError(f"the link {at} is its own ancestor")
            seen.add(at)
            at = joints[at].parent
    if len(set(links)) < len(links) or len(set(links) - joints.keys()) > 1:
        raise ValueError("two links have one name, or no joint leads to several links")
    by_name = {one.name: one for one in joints.values()}
    for one in joints.values():
        leaders = [one.name]
        while (leader := by_name.get(one.mimics)) and leader.mimics:
            if leader.name in leaders:
                raise ValueError(f"the joints {', '.join(leaders)} mimic each other")
            leaders.append(leader.name)
            offset = one.multiplier * leader.offset + one.offset
            multiplier = one.multiplier * leader.multiplier
            one = replace(one, mimics=leader.mimics, multiplier=multiplier, offset=offset)
        joints[one.child] = one
    robot = Robot(Xml.tostring(root, encoding="unicode"), joints)
    if not robot.joints:
        still = [one.name for one in joints.values() if one.kind in _MOVABLE and not one.mimics]
        why = (
            f"; the limits of {', '.join(still)} are equal, or missing, which is 0" if still else ""
        )
        raise ValueError(f"it has no movable joint{why}")
    return robot


def _link(joint: Xml.Element, which: str) -> str:
    found = joint.find(f"{which}[@link]")
    if found is None:
        raise ValueError(f"the joint {joint.get('name')} has no {which}")
    return found.attrib["link"]


def _vector(joint: Xml.Element, tag: str, attribute: str, default: str) -> FloatArray:
    element = joint.find(tag)
    text = default if element is None else element.get(attribute, default)
    try:
        found = np.array([float(word) for word in text.split()])
    except ValueError:
        found = np.full(3, np.nan)
    if found.shape != (3,) or not (np.abs(found) <= _WIDEST).all():
        raise ValueError(
            f"the {attribute} of the {tag} of the joint {joint.get('name')} is {quoted(text)}; "
            "expected three finite numbers with spaces between"
        )
    return found


def _number(joint: Xml.Element, tag: str, attribute: str, default: str = "0") -> float:
    element = joint.find(tag)
    text = default if element is None else element.get(attribute, default)
    try:
        return float(text)
    except ValueError:
        raise ValueError(
            f"the {attribute} of the {tag} of the joint {joint.get('name')} is {quoted(text)}; "
            "expected a number"
        ) from None


def _joint(element: Xml.Element) -> Joint:
    name, kind = element.attrib["name"], element.attrib["type"]
    roll, pitch, yaw = _vector(element, "origin", "rpy", "0 0 0").tolist()
    joint = Joint(
        *(name, kind, _link(element, "parent"), _link(element, "child")),
        _vector(element, "origin", "xyz", "0 0 0"),
        rotation_z(yaw) @ rotation_y(pitch) @ rotation_x(roll),
        np.array([1.0, 0.0, 0.0]),
    )
    if kind not in _MOVABLE:
        return joint
    axis = _vector(element, "axis", "xyz", "1 0 0")
    length = float(np.linalg.norm(axis))
    if not length > 0.0:
        raise ValueError(f"the joint {name} has an axis without direction")
    limit, mimic = element.find("limit"), element.find("mimic")
    if limit is None and kind != "continuous":
        raise ValueError(f"the joint {name} has no limit")
    lower, upper, speed = (
        _number(element, "limit", name) for name in ("lower", "upper", "velocity")
    )
    if kind == "continuous":
        # Half a turn each way suffices for an arm.
        lower, upper = -math.pi, math.pi
    if not (-_WIDEST <= lower <= upper <= _WIDEST and speed >= 0.0):
        raise ValueError(f"the joint {name} has limits {lower} to {upper} and the speed {speed}")
    upper = upper if upper - lower >= _NARROWEST else lower
    joint = replace(joint, axis=axis / length, lower=lower, upper=upper, speed=speed or math.inf)
    if mimic is None:
        return joint
    multiplier = _number(element, "mimic", "multiplier", "1")
    offset = _number(element, "mimic", "offset")
    if not math.isfinite(multiplier * offset):
        raise ValueError(f"the joint {name} mimics by {multiplier} and {offset}")
    return replace(joint, mimics=mimic.attrib["joint"], multiplier=multiplier, offset=offset)
