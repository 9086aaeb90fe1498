"""Writer of the bag of ``cardbox track --bag`` and ``demo``, with the topics of the tracker."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import dumps_body_model
from cardbox_tracker.person.urdf import LinkTransforms, urdf_from_body
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.messages import message_of
from cardbox_tracker.recordings.outputs import OutputStream, joint_values, person_space
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.recordings.track import Observer
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.tracker import Tracker


class BagTransforms:
    """Writes ``/tf`` for joint states from their URDF, as robot_state_publisher does live."""

    def __init__(self, writer: BagWriter) -> None:
        """Use ``writer``; nothing is written before :meth:`describe`."""
        self._writer = writer
        self._links: LinkTransforms | None = None

    def describe(self, urdf: str) -> None:
        """Write the links of ``urdf`` from now on."""
        self._links = LinkTransforms(urdf)

    def write(self, stamp_ns: int, positions: Mapping[str, float]) -> None:
        """Write the transforms at ``positions`` of all joints of the URDF, rad and metres."""
        if self._links is None:
            return
        new, transforms = self._writer.new, []
        for link in self._links.at(positions):
            x, y, z = link.translation_m
            turn = new(
                "geometry_msgs/msg/Quaternion", **dict(zip("xyzw", link.rotation, strict=True))
            )
            place = new("geometry_msgs/msg/Vector3", x=x, y=y, z=z)
            moved = new("geometry_msgs/msg/Transform", translation=place, rotation=turn)
            header = self._writer.header(stamp_ns, link.parent)
            transforms.append(
                new(
                    "geometry_msgs/msg/TransformStamped",
                    header=header,
                    child_frame_id=link.child,
                    transform=moved,
                )
            )
        message = new("tf2_msgs/msg/TFMessage", transforms=transforms)
        self._writer.write("/tf", message, stamp_ns)


Draw = Callable[[RecordedFrame, Estimate, Tracker], NDArray[np.uint8]]
"""Draws an estimate over the picture (H, W, ...) of the first camera; returns bgr."""

_LATCHED = ("/body_model", "/robot_description")


def result_writer(path: Path, overwrite: bool = False) -> BagWriter:
    """Return the writer of a bag of results, which with ``overwrite`` replaces a recording."""
    return BagWriter(path, "mcap", overwrite, compress=True, latched=_LATCHED)


@contextmanager
def result_bag(
    path: Path, frame_id: str, overwrite: bool = False, draw: Draw | None = None
) -> Iterator[Observer]:
    """Context of an observer that writes the outputs of each image to a bag.

    The bag ``path`` appears on exit; after an error there is none. ``frame_id`` is the optical
    frame of the first camera, and ``draw`` makes the pictures of ``/overlay``. Raises BagError if
    ``path`` exists and may not be replaced.
    """
    with result_writer(path, overwrite) as writer:
        people: dict[int | None, _ResultBag] = {}

        def observe(frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
            if estimate.person not in people:
                space = "" if estimate.person is None else person_space(estimate.person)
                people[estimate.person] = _ResultBag(writer, frame_id, draw, space, not people)
            people[estimate.person](frame, estimate, tracker)

        yield observe


class _ResultBag:
    """Writes the topics of one person, and the silhouettes if ``is_first``."""

    def __init__(
        self, bag: BagWriter, frame_id: str, draw: Draw | None, space: str, is_first: bool
    ) -> None:
        self._bag, self._frame_id, self._draw = bag, frame_id, draw
        self._space, self._is_first = space, is_first
        self._transforms = BagTransforms(bag)
        self._described: BodyModel | None = None
        self._outputs = OutputStream()

    def __call__(self, frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        bag, transforms = self._bag, self._transforms
        stamp, optical = frame.stamp_ns, self._frame_id
        body, camera = tracker.body, tracker.camera
        if body is not self._described:
            bag.write_string(f"{self._space}/body_model", stamp, dumps_body_model(body))
            urdf = urdf_from_body(body, optical or None, hands=estimate.hands is not None)
            bag.write_string(f"{self._space}/robot_description", stamp, urdf)
            # The links of several people have the same names.
            if not self._space:
                transforms.describe(urdf)
        self._described = body
        if self._is_first:
            bag.write_image("/silhouette", stamp, optical, frame.silhouette, "mono8")
            bag.write_camera_info("/silhouette/camera_info", stamp, optical, camera)
        if self._draw is not None:
            overlay = self._draw(frame, estimate, tracker)
            bag.write_image(f"{self._space}/overlay", stamp, optical, overlay, "bgr8")
        for topic, value in self._outputs.values(stamp, estimate, tracker):
            message = message_of(bag.new, bag.header(stamp, optical), value)
            bag.write(f"{self._space}/{topic}", message, stamp)
        joints = joint_values(estimate)
        if joints is not None:
            transforms.write(stamp, joints.by_name)
