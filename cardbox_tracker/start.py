"""Start a program of the package: ``python -m cardbox_tracker.start NAME ARGUMENTS``.

What is installed as ``cardbox``, ``background`` and so on begins here, before any slow import, so
that a signal during the imports ends it without a traceback. ``colcon build`` outside the virtual
environment makes executables for the system's Python, which lacks numba and rosbags: that is said
in words.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module

from cardbox_tracker import interrupts

NODES: dict[str, str] = {
    "background": "cardbox_tracker.ros.nodes.background_node",
    "initializer": "cardbox_tracker.ros.nodes.initializer_node",
    "tracker": "cardbox_tracker.ros.nodes.tracker_node",
    "camera": "cardbox_tracker.ros.nodes.camera_node",
    "play_bag": "cardbox_tracker.ros.nodes.play_bag_node",
    "stereo_depth": "cardbox_tracker.ros.nodes.stereo_depth_node",
    "rula": "cardbox_tracker.ros.nodes.rula_node",
    "retarget": "cardbox_tracker.ros.nodes.retarget_node",
    "cardbox_nodes": "cardbox_tracker.ros.nodes.single_process",
}
"""Module of each executable that ``ros2 run cardbox_tracker`` knows, besides ``cardbox``."""


def _node(name: str) -> int:
    interrupts.leave_at_once(0)
    return start(name, lambda: import_module(NODES[name]).main())


def start(name: str, main: Callable[[], int]) -> int:
    """Run ``main`` of the program ``name``; a package that is missing is named.

    Returns:
        The exit code; 1 where a package is missing.
    """
    try:
        return main()
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if missing in ("", "cardbox_tracker"):
            raise
        print(
            f"{name}: the Python package '{missing}' is missing from the Python that this runs "
            f"under, {sys.executable}. Activate the virtual environment into which cardbox_tracker "
            "was installed with pip, source ROS, and build with 'python -m colcon build': outside "
            "of it, 'colcon build' takes the system's Python (docs/tutorial.md)",
            file=sys.stderr,
        )
        return 1


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


def stereo_depth() -> int:
    """Run the node ``stereo_depth``."""
    return _node("stereo_depth")


def rula() -> int:
    """Run the node ``rula``."""
    return _node("rula")


def retarget() -> int:
    """Run the node ``retarget``."""
    return _node("retarget")


def cardbox_nodes() -> int:
    """Run all nodes in one process."""
    return _node("cardbox_nodes")


def cardbox() -> int:
    """Run the command ``cardbox``."""
    interrupts.leave_at_once()
    code = start("cardbox", _command)
    # All is done and closed; what Python does at its end must not be interrupted.
    interrupts.leave_at_once(code)
    if code == interrupts.INTERRUPTED:
        interrupts.leave_interrupted()
    return code


def _command() -> int:
    main = import_module("cardbox_tracker.commands.main").main
    interrupts.interrupt_commands()
    code: int = main()
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
