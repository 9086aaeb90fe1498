"""Shows results in a :class:`~.scene.Scene`: those in bags, or those of a running tracker."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from cardbox_tracker.applications.drawing.overlay import draw_camera_overlay
from cardbox_tracker.applications.viewing.scene import Scene
from cardbox_tracker.camera.encodings import SentImage, decode_bgr
from cardbox_tracker.common.errors import BagError
from cardbox_tracker.person.model_file import dumps_body_model
from cardbox_tracker.recordings.bag_reader import BagReader, stamp_ns_of
from cardbox_tracker.recordings.outputs import joint_deviations, joint_values
from cardbox_tracker.recordings.result_reader import MODEL, joints_of, namespace_of, points_of
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.tracker import Tracker

_ROBOT, _JOINTS, _OVERLAY = "/robot_description", "/joint_states", "/overlay"


class ShownTracking:
    """Observer of :func:`~cardbox_tracker.recordings.track.track_recording` that shows each image.

    Attributes:
        count: number of images with a posture.
    """

    def __init__(self, scene: Scene) -> None:
        """Start with no images."""
        self._scene = scene
        self._described: object = None
        self.count = 0

    def __call__(self, frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        """Show one image."""
        scene, stamp_ns, tilt = self._scene, frame.stamp_ns, tracker.body.camera_pose
        if tracker.body is not self._described:
            scene.model(dumps_body_model(tracker.body), "the tracker")
        self._described = tracker.body
        scene.state(stamp_ns, estimate.state)
        scene.image(stamp_ns, draw_camera_overlay(frame.picture, 0, estimate, tracker))
        joints, deviations = joint_values(estimate), joint_deviations(estimate)
        if joints is not None and deviations is not None:
            self.count += 1
            scene.joints(stamp_ns, joints)
            scene.deviations(stamp_ns, deviations)
        if estimate.keypoint_states is not None:
            scene.keypoint_states(stamp_ns, estimate.keypoint_states)
        if estimate.keypoints_m is not None:
            standing = estimate.as_camera_stands(tilt.roll_rad)
            scene.keypoints(stamp_ns, np.asarray(standing.keypoints_m))


def show_results(
    path: Path, scene: Scene, progress: Callable[[float], None], person: int | None = None
) -> int:
    """Show a bag of results; return the number of images with joints.

    Args:
        path: the bag.
        scene: where it is shown.
        progress: called with the finished fraction, 0 to 1.
        person: number of one of several people.

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


def image_stamps(path: Path, person: int | None = None) -> set[int]:
    """Return the stamps of the images in a bag of results, ns.

    Without overlays these are the images with joints.

    Raises:
        BagError: the bag cannot be read, or has no results of the tracker.
    """
    with BagReader(path) as bag:
        space = namespace_of(bag, person)
        named = (space + _OVERLAY, space + _JOINTS)
        topic = next((topic for topic in named if topic in bag.topics), None)
        messages = [] if topic is None else bag.messages([topic])
        return {stamp_ns_of(bag.deserialize(message)) for message in messages}
