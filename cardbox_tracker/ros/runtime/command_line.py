"""The command line of a node that has parameters only: it prints help and refuses other words."""

from __future__ import annotations

import argparse
import sys

from cardbox_tracker.ros.runtime.node import own_arguments


def plain_command_line(name: str, does: str, args: list[str] | None) -> list[str]:
    """Return the whole command line of the node ``name``, which has no arguments but ROS's.

    Args:
        name: of the executable.
        does: what it does, a sentence for its help.
        args: what follows the name; None: what this process was started with.

    Raises:
        SystemExit: there are others (code 2), or help was asked for (code 0).
    """
    command_line = list(sys.argv) if args is None else [name, *args]
    parser = argparse.ArgumentParser(
        prog=name,
        description=does,
        epilog=f"Everything else is a ROS argument: {name} --ros-args -p PARAMETER:=VALUE, with "
        "the parameters of docs/parameters.md, and -r TOPIC:=ANOTHER.",
    )
    parser.parse_args(own_arguments(command_line))
    return command_line
