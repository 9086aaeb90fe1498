"""Limits of a robot description, checked while it is read and before anything is built from it."""

from __future__ import annotations

from collections.abc import Mapping
from xml.parsers import expat

from cardbox_tracker.errors import CardboxError

_MOST_LEVELS, _MOST_ELEMENTS, _MOST_JOINTS = 32, 100_000, 1000
# The memory of a dynamic model grows with the third power of this: 330 MB at 128.
_MOST_FREEDOMS = 128
_FREEDOMS = {"fixed": 0, "planar": 3, "floating": 6}


class _Count:
    """Counts elements, levels, joints and degrees of freedom as a parser meets them."""

    def __init__(self) -> None:
        self.levels = self.elements = self.joints = self.freedoms = 0

    def begin(self, name: str, attributes: Mapping[str, str]) -> None:
        self.levels += 1
        self.elements += 1
        # The joints of a robot lie in its root; others belong to transmissions.
        if name == "joint" and self.levels == 2:
            self.joints += 1
            self.freedoms += _FREEDOMS.get(attributes.get("type", ""), 1)
        for found, most, what in (
            (self.levels, _MOST_LEVELS, "levels of nested elements"),
            (self.elements, _MOST_ELEMENTS, "elements"),
            (self.joints, _MOST_JOINTS, "joints"),
            (self.freedoms, _MOST_FREEDOMS, "degrees of freedom"),
        ):
            if found > most:
                raise CardboxError(
                    f"has more than {most} {what}; give the URDF of a robot, or of its arm alone"
                )

    def end(self, _: str) -> None:
        self.levels -= 1


def check_urdf_size(text: str) -> None:
    """Check the size of a URDF without building it.

    Raises:
        CardboxError: it defines entities, or has too many levels, elements or joints; the text
            continues a sentence that begins with the name of the source.
        ExpatError: it is not XML.
    """

    def refuse(*_: object) -> None:
        raise CardboxError("defines entities, which no URDF needs; remove them")

    count, parser = _Count(), expat.ParserCreate("utf-8")
    parser.StartElementHandler, parser.EndElementHandler = count.begin, count.end
    parser.StartDoctypeDeclHandler = refuse
    parser.Parse(text.encode("utf-8", "replace"), True)
