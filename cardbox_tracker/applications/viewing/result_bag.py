"""Shows a bag of results, from ``cardbox track --bag`` or recorded from running nodes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from cardbox_tracker.applications.viewing.feed import Feed
from cardbox_tracker.errors import BagError
from cardbox_tracker.recordings.bag_reader import BagMessage, BagReader, stamp_ns_of
from cardbox_tracker.recordings.result_reader import (
    MODEL,
    joints_of,
    namespace_of,
    points_of,
)
from cardbox_tracker.vision.encodings import decode_bgr, image_parts

_ROBOT, _JOINTS = "/robot_description", "/joint_states"


def show_together(
    results: Sequence[tuple[BagReader, Feed]], progress: Callable[[float], None] = lambda _: None
) -> list[int]:
    """Show bags of results of one recording at the same time, each to its receiver.

    A viewer that plays while it is sent the data has an image of each from the beginning on.

    Args:
        results: open recordings and their receivers.
        progress: called with the finished fraction, 0 to 1.

    Returns:
        The number of images with joints of each.

    Raises:
        BagError: a bag has no results of the tracker, or is damaged.
    """
    counts = [0] * len(results)
    running = {number: _shown(*one) for number, one in enumerate(results)}
    finished = dict.fromkeys(running, 0.0)
    while running:
        number = min(running, key=finished.__getitem__)
        try:
            finished[number], has_joints = next(running[number])
        except StopIteration:
            del running[number]
            continue
        counts[number] += has_joints
        progress(min(finished[one] for one in running))
    return counts


def _shown(bag: BagReader, feed: Feed) -> Iterator[tuple[float, bool]]:
    """Show the messages; yield the finished fraction after each, and whether it had joints."""
    space = namespace_of(bag)
    handlers = _handlers(bag, feed, space) | _robots(bag, feed, space)
    total_s = max(bag.duration_s, 1e-9)
    for message in bag.messages([topic for topic in bag.topics if topic in handlers]):
        content = bag.deserialize(message)
        try:
            handlers[message.topic](message, content)
        except (AttributeError, TypeError, ValueError) as error:
            # A recording contains the definitions of its types.
            raise BagError(
                f"{message.topic} of {bag.path} has a malformed message: {error}; record it again"
            ) from None
        yield (message.time_ns - bag.start_ns) / 1e9 / total_s, message.topic == space + _JOINTS


Handler = Callable[[BagMessage, Any], None]


def _handlers(bag: BagReader, feed: Feed, space: str) -> dict[str, Handler]:
    """Return the handlers of the tracker's topics in the namespace ``space``."""
    return {
        space + MODEL: lambda m, c: feed.model(str(c.data), f"{m.topic} of {bag.path}"),
        space + "/tracking_state": lambda m, c: feed.state(m.time_ns, str(c.data)),
        space + _JOINTS: lambda _, c: feed.joints(stamp_ns_of(c), joints_of(c)),
        space + "/joint_states_stddev": lambda _, c: feed.deviations(stamp_ns_of(c), joints_of(c)),
        space + "/keypoint_states": lambda _, c: feed.keypoint_states(
            stamp_ns_of(c), [str(one.message) for one in c.status]
        ),
        space + "/keypoints": lambda _, c: feed.keypoints(stamp_ns_of(c), points_of(c)),
        space + "/overlay": lambda _, c: feed.image(stamp_ns_of(c), decode_bgr(*image_parts(c))),
    }


def _robots(bag: BagReader, feed: Feed, space: str) -> dict[str, Handler]:
    """Return the handlers of robots, each with description and joint states in its namespace."""
    handlers: dict[str, Handler] = {}
    for topic in bag.topics:
        if not topic.endswith(_ROBOT) or topic == space + _ROBOT:
            continue
        robot = topic.removesuffix(_ROBOT)
        name = robot.strip("/").replace("/", "_") or "robot"
        handlers[topic] = lambda _, c, name=name: feed.robot(name, str(c.data))  # type: ignore[misc]
        handlers[robot + _JOINTS] = lambda _, c, name=name: feed.robot_joints(  # type: ignore[misc]
            stamp_ns_of(c), name, joints_of(c)
        )
    return handlers
