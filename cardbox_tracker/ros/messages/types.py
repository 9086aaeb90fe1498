"""The installed class of a recorded topic's messages."""

from __future__ import annotations

import importlib
import re
from typing import Any

from cardbox_tracker.errors import BagError, cut, quoted

_TYPE = re.compile(r"([a-z][a-z0-9_]{0,99})/msg/([A-Z][A-Za-z0-9]{0,99})")


def message_class(topic: str, kind: str) -> Any:
    """Return the class of the message type ``kind``, such as ``sensor_msgs/msg/Image``.

    Raises:
        BagError: it is not installed; the text names ``topic``.
    """
    parts = _TYPE.fullmatch(kind)
    if parts is None:
        raise BagError(
            f"topic {cut(topic)} has the type {quoted(kind)}; expected one such as "
            "sensor_msgs/msg/Image: play other topics with --topics"
        )
    package, name = parts.groups()
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError):
        raise BagError(
            f"topic {topic} has the type {kind}, which is not installed; install the package "
            f"'{package}', or play other topics with --topics"
        ) from None
