"""What the installed executables call: the program, or in words why it cannot be loaded.

``colcon build`` outside the virtual environment makes executables for the system's Python, which
has neither numba nor rosbags.
"""

from __future__ import annotations

import sys
from importlib import import_module

from cardbox_tracker.ros.runtime.processes import EXECUTABLES


def start(name: str, module: str) -> int:
    """Run ``main`` of ``module`` for the executable ``name``; return its exit code."""
    try:
        return int(import_module(module).main())
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


def cardbox() -> int:
    """Run ``cardbox``."""
    return start("cardbox", "cardbox_tracker.commands.main")


def background() -> int:
    """Run the node ``background``."""
    return start("background", EXECUTABLES["background"])


def initializer() -> int:
    """Run the node ``initializer``."""
    return start("initializer", EXECUTABLES["initializer"])


def tracker() -> int:
    """Run the node ``tracker``."""
    return start("tracker", EXECUTABLES["tracker"])


def camera() -> int:
    """Run the node ``camera``."""
    return start("camera", EXECUTABLES["camera"])


def play_bag() -> int:
    """Run the node ``play_bag``."""
    return start("play_bag", EXECUTABLES["play_bag"])


def cardbox_nodes() -> int:
    """Run all nodes in one process."""
    return start("cardbox_nodes", EXECUTABLES["cardbox_nodes"])
