"""Writer of the bag of ``cardbox track --bag``, with the topics of the tracker node.

``cardbox demo`` records the same topics from the nodes with :func:`result_writer`.
"""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.model_file import dumps_body_model
from cardbox_tracker.description.urdf import urdf_from_body
from cardbox_tracker.drawing.overlay import draw_overlay
from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.outputs import (
    JointValues,
    Markers,
    OutputStream,
    Points,
    Text,
    Value,
    joint_values,
    positions_of,
)
from cardbox_tracker.recordings.bag_markers import write_markers
from cardbox_tracker.recordings.bag_transforms import BagTransforms
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.silhouettes import RecordedFrame

_LATCHED = ("/body_model", "/robot_description")


def result_writer(path: Path, overwrite: bool = False) -> BagWriter:
    """Return the writer of a bag of results.

    With ``overwrite`` a recording of that name is replaced.

    Raises:
        BagError: ``path`` exists and may not be replaced.
    """
    return BagWriter(path, "mcap", overwrite, compress=True, latched=_LATCHED)


class ResultBag:
    """Context that writes estimates to a bag, or does nothing if it has no path."""

    def __init__(self, path: Path | None, frame_id: str, overwrite: bool = False) -> None:
        """Prepare the bag, which is opened on entry and appears on exit.

        With ``overwrite`` a recording of that name is replaced.
        """
        self._writer = None if path is None else result_writer(path, overwrite)
        self._transforms = None if self._writer is None else BagTransforms(self._writer)
        self._frame_id = frame_id
        self._described: BodyModel | None = None
        self._outputs = OutputStream()

    def __enter__(self) -> ResultBag:
        """Open the bag."""
        if self._writer is not None:
            self._writer.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the bag, or remove it after an error."""
        if self._writer is not None:
            self._writer.__exit__(kind, error, trace)

    def add(self, frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        """Write the outputs of one image."""
        if self._writer is None or self._transforms is None:
            return
        self._write(self._writer, self._transforms, frame, estimate, tracker)

    def _write(
        self,
        bag: BagWriter,
        transforms: BagTransforms,
        frame: RecordedFrame,
        estimate: Estimate,
        tracker: Tracker,
    ) -> None:
        stamp, optical = frame.stamp_ns, self._frame_id
        body, camera = tracker.body, tracker.camera
        if body is not self._described:
            bag.write_string("/body_model", stamp, dumps_body_model(body))
            urdf = urdf_from_body(body, optical or None)
            bag.write_string("/robot_description", stamp, urdf)
            transforms.describe(urdf)
        self._described = body
        bag.write_image("/silhouette", stamp, optical, frame.silhouette, "mono8")
        bag.write_camera_info("/silhouette/camera_info", stamp, optical, camera)
        overlay = draw_overlay(frame.picture, body, camera, estimate)
        bag.write_image("/overlay", stamp, optical, overlay, "bgr8")
        for output, value in self._outputs.values(estimate, tracker):
            _write_value(bag, f"/{output.topic}", stamp, optical, value)
        joints = joint_values(estimate)
        if joints is not None:
            transforms.write(stamp, positions_of(joints))


def _write_value(bag: BagWriter, topic: str, stamp_ns: int, frame_id: str, value: Value) -> None:
    """Write an output with the header of its image, like the node."""
    match value:
        case JointValues(names, values):
            bag.write_joint_state(topic, stamp_ns, frame_id, names, values)
        case Points(points_m):
            bag.write_pose_array(topic, stamp_ns, frame_id, points_m)
        case Markers():
            write_markers(bag, topic, stamp_ns, frame_id, value)
        case Text(text):
            bag.write_string(topic, stamp_ns, text)
