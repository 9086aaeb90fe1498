"""The command line of ``play_bag``, turned into the node's parameters."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence

import yaml
from rclpy.parameter import Parameter

from cardbox_tracker.errors import CardboxError
from cardbox_tracker.recordings.bag_reader import IMAGE_TYPES, BagReader

_COMPRESSED = "/compressed"


def overrides_from(arguments: list[str]) -> list[Parameter]:
    """Turn the command line (without ROS arguments) into values of the node's parameters.

    Raises:
        SystemExit: it is wrong, or asks for something to be printed.
    """
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
    parser.add_argument(
        "--find-topics",
        nargs="+",
        choices=("image", "camera_info"),
        help="print the names of these topics of the bag as YAML, and exit",
    )
    parser.add_argument(
        "--below",
        action="append",
        metavar="NAMESPACE",
        help="with --find-topics: of the camera below it; several times for several cameras",
    )
    given = vars(parser.parse_args(arguments))
    wanted, cameras = given.pop("find_topics"), given.pop("below") or []
    if wanted:
        try:
            print(yaml.safe_dump(find_topics(given["bag"] or "", wanted, cameras)), end="")
        except CardboxError as error:
            parser.exit(1, f"{error}\n")
        parser.exit()
    return [Parameter(name, value=value) for name, value in given.items() if value is not None]


def find_topics(bag: str, wanted: Iterable[str], cameras: Sequence[str] = ()) -> dict[str, str]:
    """Return what the launch arguments of the same names are for a bag.

    Args:
        bag: rosbag2 folder or file.
        wanted: ``image``, which comes with ``image_transport``, and ``camera_info``.
        cameras: namespaces of several cameras; the names are then those below each of them.

    Raises:
        CardboxError: it cannot be read, does not have exactly one of each, or the cameras differ.
    """
    with BagReader(bag) as reader:
        images = sorted(name for name, kind in reader.topics.items() if kind in IMAGE_TYPES)
        if len(images) > 1 and not cameras:
            raise CardboxError(
                f"{bag} has images on {', '.join(images)}; choose one with the launch arguments "
                'image and camera_info, or several cameras with cameras:="[NAMESPACE, NAMESPACE]"'
            )
        found = [_topics_of(reader, wanted, camera) for camera in cameras or ("",)]
    if any(one != found[0] for one in found):
        each = "; ".join(f"{name}: {one}" for name, one in zip(cameras, found, strict=True))
        raise CardboxError(f"the cameras of {bag} have different topics, expected the same: {each}")
    return found[0]


def _topics_of(reader: BagReader, wanted: Iterable[str], camera: str) -> dict[str, str]:
    """What :func:`find_topics` returns, of one camera; of the only one if its name is empty."""
    folder = f"/{camera}/" if camera else ""
    found = {}
    if "image" in wanted:
        topic = reader.image_topic(camera or None).removeprefix(folder)
        found["image"] = topic.removesuffix(_COMPRESSED)
        found["image_transport"] = "compressed" if topic.endswith(_COMPRESSED) else "raw"
    if "camera_info" in wanted:
        found["camera_info"] = reader.camera_info_topic(camera or None).removeprefix(folder)
    return found
