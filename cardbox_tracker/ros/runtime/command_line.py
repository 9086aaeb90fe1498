"""Command line of a node that has only parameters: it prints help and refuses other arguments."""

from __future__ import annotations

import argparse
import sys

from cardbox_tracker.ros.runtime.node import own_arguments


def plain_command_line(name: str, does: str, args: list[str] | None) -> list[str]:
    """Return the complete command line of the node ``name``, which has only ROS arguments.

    Args:
        name: name of the executable.
        does: sentence for the help.
        args: arguments after the name; None for those of this process.

    Raises:
        SystemExit: there are other arguments (code 2), or help was requested (code 0).
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
