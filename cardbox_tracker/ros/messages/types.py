"""The installed class of a recorded topic's messages."""

from __future__ import annotations

import importlib
from typing import Any

from cardbox_tracker.errors import BagError


def message_class(topic: str, kind: str) -> Any:
    """Return the class of the message type ``kind``, such as ``sensor_msgs/msg/Image``.

    Raises:
        BagError: it is not installed; the text names ``topic``.
    """
    package, _, name = kind.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError):
        raise BagError(
            f"topic {topic} has the type {kind}, which is not installed; install the package "
            f"'{package}', or play other topics with --topics"
        ) from None
