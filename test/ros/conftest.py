"""A separate ROS context for each test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest


@pytest.fixture
def make_node() -> Iterator[Callable[..., Any]]:
    """Return a function that makes nodes; extra arguments are ROS arguments."""
    import rclpy
    from rclpy.context import Context
    from rclpy.node import Node

    context = Context()
    nodes: list[Node] = []

    def make(*arguments: str, name: str = "tested") -> Node:
        if not context.ok():
            rclpy.init(args=["--ros-args", *arguments] if arguments else None, context=context)
        node = Node(name, context=context, enable_rosout=False)
        nodes.append(node)
        return node

    yield make
    for node in nodes:
        node.destroy_node()
    context.try_shutdown()
