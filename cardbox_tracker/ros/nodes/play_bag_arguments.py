"""The command line of ``play_bag``, turned into the node's parameters."""

from __future__ import annotations

import argparse

from rclpy.parameter import Parameter


def overrides_from(arguments: list[str]) -> list[Parameter]:
    """Turn the command line (without ROS arguments) into values of the node's parameters."""
    parser = argparse.ArgumentParser(
        prog="play_bag",
        description="Play a rosbag2 recording (sqlite3 or mcap) with its original stamps.",
        epilog="Every option is also a parameter: play_bag --ros-args -p bag:=BAG. Topics are "
        "renamed with --ros-args -r /old:=/new.",
    )
    parser.add_argument("bag", nargs="?", help="rosbag2 folder or file")
    parser.add_argument("--rate", type=float, help="speed, 1 by default")
    parser.add_argument("--loop", action="store_true", default=None, help="play again and again")
    parser.add_argument("--topics", nargs="+", help="play only these")
    parser.add_argument("--start", dest="start_s", type=float, metavar="S", help="begin at S")
    parser.add_argument("--duration", dest="duration_s", type=float, metavar="S", help="play S s")
    parser.add_argument("--delay", dest="delay_s", type=float, metavar="S", help="wait S s first")
    parser.add_argument("--pause-at", nargs="+", type=float, metavar="S", help="pause at S")
    parser.add_argument(
        "--no-wait",
        dest="wait_for_subscribers",
        action="store_false",
        default=None,
        help="do not wait for a subscriber",
    )
    given = vars(parser.parse_args(arguments))
    return [Parameter(name, value=value) for name, value in given.items() if value is not None]
