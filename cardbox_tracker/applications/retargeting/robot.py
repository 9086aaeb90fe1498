"""A robot's joints and their limits from its URDF."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from xml.etree import ElementTree as Xml

import numpy as np

from cardbox_tracker.common.errors import CardboxError, cut, quoted
from cardbox_tracker.common.files import UnreadableFileError, read_regular
from cardbox_tracker.person.sizes import FloatArray

_MOVABLE = ("revolute", "continuous", "prismatic")
# Some descriptions mean no limit by 1e16; differences of larger ones would not be finite.
_WIDEST = 1e16
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
    """One movable joint with limits in rad or m; ``speed`` in rad/s or m/s is inf if not given."""

    name: str
    lower: float
    upper: float
    speed: float


@dataclass(frozen=True)
class Robot:
    """A robot.

    Attributes:
        urdf: description, in which continuous joints have limits of half a turn in each direction.
        joints: movable joints by name, in the order of the description.
        parents: for each link but the root, the names of its joint and its parent link.
    """

    urdf: str
    joints: dict[str, Joint]
    parents: dict[str, tuple[str, str]]

    @property
    def links(self) -> tuple[str, ...]:
        """All links; the root is the first one."""
        roots = {parent for _, parent in self.parents.values()} - self.parents.keys()
        return (*sorted(roots), *self.parents)

    @property
    def last_link(self) -> str:
        """The link with the longest chain of movable joints."""
        return max(reversed(self.links), key=lambda link: len(self.chain(link)))

    def chain(self, link: str) -> tuple[str, ...]:
        """Return the movable joints from the root to ``link``.

        Raises:
            CardboxError: there is no such link.
        """
        if link not in self.links:
            raise CardboxError(
                f"the robot has no link {quoted(link)}; it has {cut(', '.join(self.links))}"
            )
        found = []
        while link in self.parents:
            joint, link = self.parents[link]
            if joint in self.joints:
                found.append(joint)
        return tuple(reversed(found))

    def limits_of(self, names: Sequence[str]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return lower limits, upper limits and highest speeds, each (n,), of joints.

        Raises:
            CardboxError: there is no movable joint of that name.
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


def load_robot(path: str | os.PathLike[str]) -> Robot:
    """Read a URDF file.

    Raises:
        CardboxError: the file cannot be read, or is not a URDF with movable joints.
    """
    try:
        text = read_regular(path, _LARGEST_BYTES).decode("utf-8")
    except UnreadableFileError as error:
        raise CardboxError(f"cannot read the robot {path}: {error}; expected a URDF file") from None
    except UnicodeDecodeError:
        raise CardboxError(f"{path} is not a text file; expected the URDF of a robot") from None
    return parse_robot(text, str(path))


def parse_robot(text: str, source: str = "the description") -> Robot:
    """Parse a URDF; ``source`` names it in errors.

    Raises:
        CardboxError: see :func:`load_robot`; or it defines entities, or has too many levels,
            elements or joints.
    """
    if "xmlns:xacro" in text:
        raise CardboxError(f"{source} is xacro; convert it first: xacro FILE > robot.urdf")
    if "<!DOCTYPE" in text:
        # Few lines of entities can make gigabytes.
        raise CardboxError(f"{source} defines entities, which no URDF needs; remove them")
    parser = Xml.XMLParser(target=_BoundedBuilder(source), encoding="utf-8")
    content = text.encode("utf-8", "replace")
    try:
        # A parser reads to the end of what it is fed, also after an error.
        for begin in range(0, len(content), _CHUNK):
            parser.feed(content[begin : begin + _CHUNK])
        return _robot(parser.close())
    except Xml.ParseError as error:
        raise CardboxError(f"{source} is not XML: {error}; expected the URDF of a robot") from None
    except (KeyError, ValueError) as error:
        raise CardboxError(
            f"{source} is not a URDF with movable joints: {cut(str(error))}; every joint needs "
            "name, type, parent and child, and a revolute or prismatic joint finite limits"
        ) from None


class _BoundedBuilder(Xml.TreeBuilder):
    """Builds a description, and refuses it as soon as it is too large."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self._source, self._counts = source, dict.fromkeys(_MOST, 0)

    def start(self, tag: str, attributes: Mapping[str, str]) -> Xml.Element:
        """Count an element; the joints of a robot lie in its root, others in transmissions."""
        is_joint = tag == "joint" and self._counts["levels of nested elements"] == 1
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

    def end(self, tag: str) -> Xml.Element:
        """Count a level less."""
        self._counts["levels of nested elements"] -= 1
        return super().end(tag)


def _robot(root: Xml.Element) -> Robot:
    joints: dict[str, Joint] = {}
    parents: dict[str, tuple[str, str]] = {}
    for element in root.findall("joint"):
        name, kind = element.attrib["name"], element.attrib["type"]
        parent, child = (_link(element, which) for which in ("parent", "child"))
        if child in parents or name in joints:
            raise ValueError(f"the link {child} has two parents, or two joints are named {name}")
        parents[child] = name, parent
        if kind in _MOVABLE and element.find("mimic") is None:
            joints[name] = _joint(element, name, kind)
    for link in parents:
        seen, at = {link}, parents[link][1]
        while at in parents:
            if at in seen:
                raise ValueError(f"the link {at} is its own ancestor")
            seen.add(at)
            at = parents[at][1]
    if not joints:
        raise ValueError("it has no movable joint")
    return Robot(Xml.tostring(root, encoding="unicode"), joints, parents)


def _link(joint: Xml.Element, which: str) -> str:
    found = joint.find(f"{which}[@link]")
    if found is None:
        raise ValueError(f"the joint {joint.get('name')} has no {which}")
    return found.attrib["link"]


def _joint(element: Xml.Element, name: str, kind: str) -> Joint:
    limit = element.find("limit")
    if limit is None:
        if kind != "continuous":
            raise ValueError(f"the joint {name} has no limit")
        limit = Xml.SubElement(element, "limit", effort="0", velocity="0")
    if kind == "continuous":
        # Half a turn suffices for an arm, and pinocchio has one number for a limited joint.
        element.set("type", "revolute")
        limit.attrib |= {"lower": repr(-math.pi), "upper": repr(math.pi)}
    lower, upper, speed = (float(limit.get(one, 0.0)) for one in ("lower", "upper", "velocity"))
    if not (-_WIDEST <= lower <= upper <= _WIDEST and speed >= 0.0):
        raise ValueError(f"the joint {name} has limits {lower} to {upper} and the speed {speed}")
    return Joint(name, lower, upper, speed or math.inf)
