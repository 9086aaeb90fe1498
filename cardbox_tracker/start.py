"""Start a program of the package: ``python -m cardbox_tracker.start NAME ARGUMENTS``.

What is installed as ``cardbox``, ``background`` and so on begins here, before any slow import, so
that a signal during the imports ends it without a traceback.
"""

from __future__ import annotations

import sys
from importlib import import_module

from cardbox_tracker import interrupts

NODES: dict[str, str] = {
    "background": "cardbox_tracker.ros.nodes.background_node",
    "initializer": "cardbox_tracker.ros.nodes.initializer_node",
    "tracker": "cardbox_tracker.ros.nodes.tracker_node",
    "camera": "cardbox_tracker.ros.nodes.camera_node",
    "play_bag": "cardbox_tracker.ros.nodes.play_bag_node",
    "cardbox_nodes": "cardbox_tracker.ros.nodes.single_process",
}
"""Module of each executable that ``ros2 run cardbox_tracker`` knows, besides ``cardbox``."""


def _node(name: str) -> int:
    interrupts.leave_at_once(0)
    code: int = import_module(NODES[name]).main()
    return code


def background() -> int:
    """Run the node ``background``."""
    return _node("background")


def initializer() -> int:
    """Run the node ``initializer``."""
    return _node("initializer")


def tracker() -> int:
    """Run the node ``tracker``."""
    return _node("tracker")


def camera() -> int:
    """Run the node ``camera``."""
    return _node("camera")


def play_bag() -> int:
    """Run the node ``play_bag``."""
    return _node("play_bag")


def cardbox_nodes() -> int:
    """Run all nodes in one process."""
    return _node("cardbox_nodes")


def cardbox() -> int:
    """Run the command ``cardbox``."""
    interrupts.leave_at_once()
    main = import_module("cardbox_tracker.commands.main").main
    interrupts.interrupt_commands()
    code: int = main()
    # All is done and closed; what Python does at its end must not be interrupted.
    interrupts.leave_at_once(code)
    return code


def main() -> int:
    """Run the program that the first argument names."""
    name = sys.argv[1] if len(sys.argv) > 1 else ""
    if name not in (*NODES, "cardbox"):
        print(f"expected one of {', '.join(NODES)} or cardbox; got '{name}'", file=sys.stderr)
        return 2
    sys.argv = [name, *sys.argv[2:]]
    return cardbox() if name == "cardbox" else _node(name)


if __name__ == "__main__":
    sys.exit(main())
