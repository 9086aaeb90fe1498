"""Shows results in a :class:`~.scene.Scene`: those in bags, or those of a running tracker."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from cardbox_tracker.applications.viewing.scene import Scene
from cardbox_tracker.camera.encodings import SentImage, decode_bgr
from cardbox_tracker.common.errors import BagError
from cardbox_tracker.recordings.bag_reader import BagReader, stamp_ns_of
from cardbox_tracker.recordings.result_reader import MODEL, joints_of, namespace_of, points_of

_ROBOT, _JOINTS, _OVERLAY = "/robot_description", "/joint_states", "/overlay"


def show_results(
    path: Path, scene: Scene, progress: Callable[[float], None], person: int | None = None
) -> int:
    """Show a bag of results; return the number of images with joints.

    Raises:
        BagError: the bag has no results of the tracker, or is damaged.
    """
    count = 0
    with BagReader(path) as bag:
        space = namespace_of(bag, person)
        handlers = _handlers(bag, scene, space)
        total_s = max(bag.duration_s, 1e-9)
        for message in bag.messages([topic for topic in bag.topics if topic in handlers]):
            content = bag.deserialize(message)
            try:
                handlers[message.topic](message.time_ns, content)
            except (AttributeError, TypeError, ValueError) as error:
                # A recording contains the definitions of its types.
                raise BagError(
                    f"{message.topic} of {bag.path} has a malformed message: {error}; record it "
                    "again"
                ) from None
            count += message.topic == space + _JOINTS
            progress((message.time_ns - bag.start_ns) / 1e9 / total_s)
    return count


Handler = Callable[[int, Any], None]
"""Callback that receives the time of a message, ns, and the message."""


def handlers_of(scene: Scene, source: str) -> dict[str, Handler]:
    """Return the handlers of the tracker's topics below its namespace; ``source`` names it."""
    return {
        MODEL: lambda _, m: scene.model(str(m.data), f"{MODEL} of {source}"),
        "/tracking_state": lambda time_ns, m: scene.state(time_ns, str(m.data)),
        _JOINTS: lambda _, m: scene.joints(stamp_ns_of(m), joints_of(m)),
        "/joint_states_stddev": lambda _, m: scene.deviations(stamp_ns_of(m), joints_of(m)),
        "/keypoint_states": lambda _, m: scene.keypoint_states(
            stamp_ns_of(m), [str(one.message) for one in m.status]
        ),
        "/keypoints": lambda _, m: scene.keypoints(stamp_ns_of(m), points_of(m)),
        _OVERLAY: lambda _, m: scene.image(stamp_ns_of(m), decode_bgr(SentImage.of(m))),
    }


def _handlers(bag: BagReader, scene: Scene, space: str) -> dict[str, Handler]:
    """Return the handlers of the topics of the tracker in ``space``, and of robots in others."""
    own = handlers_of(scene, str(bag.path))
    handlers = {space + topic: handler for topic, handler in own.items()}
    for topic in bag.topics:
        is_person = topic.removesuffix(_ROBOT) + MODEL in bag.topics
        if topic.endswith(_ROBOT) and not is_person and topic != space + _ROBOT:
            robot = topic.removesuffix(_ROBOT)
            name = robot.strip("/").replace("/", "_") or "robot"
            handlers[topic] = lambda _, m, name=name: scene.robot(name, str(m.data))  # type: ignore[misc]
            handlers[robot + _JOINTS] = lambda _, m, name=name: scene.robot_joints(  # type: ignore[misc]
                stamp_ns_of(m), name, joints_of(m)
            )
    return handlers
