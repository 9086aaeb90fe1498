"""Elements of HTML and SVG; texts and attributes are escaped where they are written."""

from __future__ import annotations

from xml.etree import ElementTree

Element = ElementTree.Element


def element(tag: str, text: str = "", **attributes: object) -> Element:
    """Return an element.

    Args:
        tag: its name.
        text: its text.
        attributes: its attributes; ``stroke_width`` becomes ``stroke-width``, ``class_`` ``class``.
    """
    names = {name.rstrip("_").replace("_", "-"): str(x) for name, x in attributes.items()}
    made = Element(tag, names)
    made.text = text
    return made


def add(parent: Element, tag: str, text: str = "", **attributes: object) -> Element:
    """Return a new element, see :func:`element`, at the end of ``parent``."""
    made = element(tag, text, **attributes)
    parent.append(made)
    return made


def document(root: Element) -> bytes:
    """Return a whole HTML document as UTF-8; letters of broken file names become "?"."""
    text = ElementTree.tostring(root, encoding="unicode", method="html")
    return b"<!DOCTYPE html>\n" + text.encode("utf-8", "replace") + b"\n"
