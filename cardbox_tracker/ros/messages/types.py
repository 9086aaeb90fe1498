"""Message classes of packages that may not be installed."""

from __future__ import annotations

import importlib
import re
from array import array
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from typing import Any

import numpy as np

from cardbox_tracker.common.errors import BagError, cut, quoted

_TYPE = re.compile(r"([a-z][a-z0-9_]{0,99})/msg/([A-Z][A-Za-z0-9]{0,99})")


def message_class(topic: str, kind: str) -> Any:
    """Return the class of a message type, or raise BagError with ``topic``."""
    parts = _TYPE.fullmatch(kind)
    if parts is None:
        raise BagError(
            f"topic {cut(topic)} has the type {quoted(kind)}; expected one such as "
            "sensor_msgs/msg/Image: play other topics with --topics"
        )
    package, name = parts.groups()
    found = optional_class(package, name)
    if found is None:
        raise BagError(
            f"topic {topic} has the type {kind}, which is not installed; install the package "
            f"'{package}' (ros-jazzy-{package.replace('_', '-')}), or play other topics with "
            "--topics"
        )
    return found


def optional_class(package: str, name: str) -> Any:
    """Return the message class ``name`` of a package, or None if it is not installed."""
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError):
        return None


@cache
def class_of(kind: str) -> Any:
    """Return the class of a type such as ``std_msgs/msg/String`` that is installed."""
    return optional_class(*kind.split("/msg/"))


def new_message(kind: str, **fields: Any) -> Any:
    """Return a message of a type with these fields; arrays of numbers are of doubles."""
    for name, value in fields.items():
        if isinstance(value, np.ndarray):
            # rclpy checks each number of any other type.
            fields[name] = array("d", value.tolist())
    if kind == "diagnostic_msgs/msg/DiagnosticStatus":
        fields["level"] = bytes([fields["level"]])
    return class_of(kind)(**fields)


def message_classes(
    kinds: Mapping[str, str], chosen: Iterable[str], leave_out: Callable[[str], None]
) -> dict[str, Any]:
    """Return the class of each topic; ``leave_out`` is told of those not installed.

    Raises BagError if a chosen topic's type, or every type, is not installed.
    """
    names = list(chosen)
    if names:
        return {name: message_class(name, kinds[name]) for name in names}
    found = {}
    problem = ""
    for name, kind in kinds.items():
        try:
            found[name] = message_class(name, kind)
        except BagError as error:
            problem = str(error)
            leave_out(f"not played: {problem}")
    if problem and not found:
        raise BagError(f"no topic can be played: {problem}")
    return found
