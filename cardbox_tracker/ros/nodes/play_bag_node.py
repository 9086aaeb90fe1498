"""The node ``play_bag``: play a rosbag2 recording with its original stamps.

It pauses at the times of ``--pause-at`` and on the service ``play_bag/pause``, and continues on
``play_bag/resume``. The latched topic ``play_bag/status`` is ``waiting``, ``playing``,
``paused at 4.500 s`` or ``finished``. A script can thus pause the recording at a reference posture,
call ``initializer/capture_front``, and resume. The exit code is 0 at the end of the bag.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Any

import yaml
from rcl_interfaces.msg import Log
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from std_msgs.msg import String

from cardbox_tracker.common.errors import BagError, CardboxError
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.ros.messages.types import message_classes
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.command_line import node_help
from cardbox_tracker.ros.runtime.node import CardboxNode, own_arguments, run
from cardbox_tracker.ros.runtime.parameter_fields import NodeParameters, at_start, parameter
from cardbox_tracker.ros.runtime.parameters import LiveParameters

_COMPRESSED = "/compressed"


def find_topics(bag: str, wanted: Iterable[str], cameras: Sequence[str] = ()) -> dict[str, str]:
    """Return the topics of a bag as launch arguments: ``image``, its transport, ``camera_info``.

    Those of several ``cameras`` are relative to each namespace.
    """
    with BagReader(bag) as reader:
        images = reader.image_topics
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
    """Return the topics of one camera; if ``camera`` is empty, those of the only camera."""
    folder = f"/{camera}/" if camera else ""
    found = {}
    if "image" in wanted:
        topic = reader.image_topic(camera or None).removeprefix(folder)
        found["image"] = topic.removesuffix(_COMPRESSED)
        found["image_transport"] = "compressed" if topic.endswith(_COMPRESSED) else "raw"
    if "camera_info" in wanted:
        found["camera_info"] = reader.camera_info_topic(camera or None).removeprefix(folder)
    return found


_PROGRESS_S = 5.0
# The nodes of a second camera may start this much later.
_OTHER_CAMERAS_S = 3.0
_IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
# These messages are recorded once, and late subscribers need them too.
_LATCHED_ENDINGS = ("tf_static", "body_model", "robot_description", "background/mean", "/stddev")


@dataclass(frozen=True)
class PlayBagParameters(NodeParameters):
    """Play a recording."""

    bag: str = at_start("", "rosbag2 folder or .mcap file to play")
    rate: float = parameter(
        1.0, "speed; 2 plays twice as fast", limits=(0.01, 100.0), effect="at once"
    )
    loop: bool = parameter(
        False, "play again and again; the stamps start over too", effect="end of the bag"
    )
    topics: list[str] = at_start([], "topics to play; all if empty")
    start_s: float = at_start(
        0.0, "play from this time on, from the bag's start", unit="s", limits=(0.0, 1e6)
    )
    duration_s: float = at_start(
        0.0, "play this long; 0: to the end of the bag", unit="s", limits=(0.0, 1e6)
    )
    pause_at: list[float] = at_start(
        [], "pause at these times from the bag's start, s, until play_bag/resume"
    )
    wait_for_subscribers: bool = at_start(
        True, "begin when somebody subscribes to a played image topic"
    )
    wait_for_topics: list[str] = at_start(
        [],
        "begin when these topics have a publisher; with keypoints, the player waits for the "
        "tracker, which compiles for one to two minutes at its very first start",
    )
    delay_s: float = at_start(
        0.5,
        "send the first message when no subscriber has come or gone for this time, so that none "
        "misses the beginning; at least 3 s while images of a further camera have no subscriber",
        unit="s",
        limits=(0.0, 600.0),
    )

    def check(self) -> None:
        """Raise ValueError if values contradict each other."""
        if not self.bag:
            raise ValueError("no bag is given; run 'play_bag BAG' or set the parameter 'bag'")


class PlayBagNode(CardboxNode):
    """Publishes the messages of a bag as they were recorded, byte for byte."""

    def __init__(self, **options: Any) -> None:
        super().__init__("play_bag", **options)
        self.parameters = LiveParameters(self, PlayBagParameters, lambda _: self._set_anchor())
        settings = self.parameters.value
        self._resources = ExitStack()
        self._reader = self._resources.enter_context(BagReader(settings.bag))
        self._position_s = settings.start_s
        self._paused = False
        self._anchor = (0.0, 0.0)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self)
        self._status = self.advertise(String, "~/status", qos.LATCHED)
        self.offer("~/pause", self._pause)
        self.offer("~/resume", self._resume)
        unknown = [topic for topic in settings.topics if topic not in self._reader.topics]
        if unknown:
            raise BagError(
                f"{settings.bag} has no topic {', '.join(unknown)}; it has "
                f"{', '.join(sorted(self._reader.topics))}"
            )
        classes = message_classes(self._reader.topics, settings.topics, self.diagnostics.warn)
        self._publishers_of = {
            name: self.advertise(
                of, name, qos.LATCHED if name.endswith(_LATCHED_ENDINGS) else qos.PLAYED
            )
            for name, of in classes.items()
            if not self._is_own(name, of)
        }
        self._watched = [
            publisher
            for topic, publisher in self._publishers_of.items()
            if self._reader.topics[topic] in _IMAGES
        ] or self._all()

    def _is_own(self, topic: str, of: Any) -> bool:
        """Return whether this node itself has the topic, as its status or with another type."""
        own = {"/rosout": Log} | {one.topic_name: one.msg_type for one in self.publishers}
        name = self.resolve(topic)
        is_own = name == self._status.topic_name or own.get(name, of) is not of
        if is_own:
            self.diagnostics.warn(f"not played: {name} is a topic of the player itself")
        return is_own

    def play(self) -> None:
        """Play the bag to its end, or forever with ``loop``."""
        settings = self.parameters.value
        if settings.wait_for_subscribers:
            topics = ", ".join(publisher.topic_name for publisher in self._watched)
            compressed = any(name.endswith("/compressed") for name in topics.split(", "))
            hint = " (background takes it with image_transport:=compressed)" if compressed else ""
            self._wait_for(f"a subscriber of {topics}{hint}", partial(self._is_watched, any))
        for topic in map(self.resolve, settings.wait_for_topics):
            self._wait_for(f"a publisher of {topic}", partial(self.count_publishers, topic))
        self._settle(settings.delay_s)
        self._play_once()
        while self.parameters.value.loop:
            self._play_once()
        for publisher in self._all():
            publisher.wait_for_all_acked(Duration(seconds=5))
        self._say("finished")
        self.get_logger().info(f"end of {settings.bag}")

    def _is_watched(self, how_many: Callable[[Iterable[bool]], bool]) -> bool:
        return how_many(publisher.get_subscription_count() > 0 for publisher in self._watched)

    def _wait_for(self, what: str, is_there: Callable[[], bool | int]) -> None:
        self._say("waiting")
        self.diagnostics.wait_for(what)
        while not is_there():
            self._executor.spin_once(timeout_sec=0.1)

    def _play_once(self) -> None:
        settings = self.parameters.value
        end_s = settings.start_s + (settings.duration_s or float("inf"))
        pauses = sorted(at_s for at_s in settings.pause_at if at_s >= settings.start_s)
        progress_s = time.monotonic()
        self._position_s = settings.start_s
        self._set_anchor()
        self._say("playing")
        start_ns, length_s = self._reader.start_ns, self._reader.duration_s
        for message in self._reader.messages(list(self._publishers_of)):
            at_s = (message.time_ns - start_ns) / 1e9
            if at_s < settings.start_s:
                continue
            if at_s > end_s:
                break
            while pauses and pauses[0] <= at_s:
                self._position_s = pauses.pop(0)
                self._pause()
            self._wait_until_due(at_s)
            self._publishers_of[message.topic].publish(message.raw)
            self.diagnostics.working()
            self._position_s = at_s
            if time.monotonic() - progress_s >= _PROGRESS_S:
                progress_s = time.monotonic()
                self.get_logger().info(f"at {at_s:.1f} of {length_s:.1f} s")

    def _wait_until_due(self, at_s: float) -> None:
        """Serve calls until the message of that bag time is due and nothing is paused."""
        while True:
            since, from_s = self._anchor
            left_s = since + (at_s - from_s) / self.parameters.value.rate - time.monotonic()
            if left_s <= 0 and not self._paused:
                return
            self._executor.spin_once(timeout_sec=0.1 if self._paused else min(left_s, 0.1))

    def _settle(self, delay_s: float) -> None:
        """Serve calls until subscribers rest for ``delay_s``, longer while a camera has none."""
        subscribers, since_s = list[int](), time.monotonic()
        others_s = _OTHER_CAMERAS_S if delay_s and self.parameters.value.wait_for_subscribers else 0
        while True:
            patience_s = delay_s if self._is_watched(all) else max(delay_s, others_s)
            if (left_s := since_s + patience_s - time.monotonic()) <= 0:
                return
            self._executor.spin_once(timeout_sec=min(left_s, 0.1))
            found = [publisher.get_subscription_count() for publisher in self._all()]
            if found != subscribers:
                subscribers, since_s = found, time.monotonic()

    def _set_anchor(self) -> None:
        """Let bag time run on from the current position."""
        self._anchor = (time.monotonic(), self._position_s)

    def _all(self) -> list[Publisher]:
        return list(self._publishers_of.values())

    def _say(self, text: str) -> None:
        self._status.publish(String(data=text))

    def _pause(self) -> str:
        self._paused = True
        text = f"paused at {self._position_s:.3f} s"
        self._say(text)
        self.get_logger().info(f"{text}; to continue, call {self.resolve('~/resume')}")
        return text

    def _resume(self) -> str:
        if not self._paused:
            raise BagError(f"not paused; playing at {self._position_s:.3f} s")
        self._paused = False
        self._set_anchor()
        self._say("playing")
        return f"playing from {self._position_s:.3f} s"

    def close(self) -> None:
        """Close the bag."""
        self._resources.close()


def overrides_from(arguments: list[str]) -> list[Parameter]:
    """Turn the command line (without ROS arguments) into values of the node's parameters."""
    parser = argparse.ArgumentParser(
        prog="play_bag",
        description="Play a rosbag2 recording (sqlite3 or mcap) with its original stamps.",
        **node_help(
            "play_bag", PlayBagParameters, "Every option is also a parameter: -p bag:=BAG."
        ),
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
        help="with --find-topics: namespace of a camera; repeat it for several cameras",
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


def main(args: list[str] | None = None) -> int:
    """Play a bag; the exit code is 0 at its end, 1 for a bag that cannot be played."""
    command_line = list(sys.argv) if args is None else ["play_bag", *args]
    overrides = overrides_from(own_arguments(command_line))
    return run(partial(PlayBagNode, parameter_overrides=overrides), command_line, PlayBagNode.play)
