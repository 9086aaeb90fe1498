"""The bag that ``cardbox track --bag`` writes: what the tracker node would have published."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.model_file import dumps_body_model
from cardbox_tracker.body.posture import JOINT_NAMES
from cardbox_tracker.body.urdf import urdf_from_body
from cardbox_tracker.estimation.tracker import Estimate, Tracker
from cardbox_tracker.offline.silhouettes import Frame
from cardbox_tracker.ros.bag_writer import BagWriter


class ResultBag:
    """Context that collects estimates in a bag; without a path it does nothing."""

    def __init__(self, path: Path | None, body: BodyModel, frame_id: str) -> None:
        """Set up; the file is opened on entry and appears, whole, on exit."""
        self._writer = None if path is None else BagWriter(path)
        self._body = body
        self._frame_id = frame_id
        self._is_first = True

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
        """Close the bag; after an error nothing is left of it."""
        if self._writer is not None:
            self._writer.__exit__(kind, error, trace)

    def add(self, frame: Frame, estimate: Estimate, tracker: Tracker) -> None:
        """Write what is known of one picture."""
        if self._writer is None:
            return
        stamp = frame.stamp_ns
        if self._is_first:
            self._is_first = False
            self._writer.write_string("body_model", stamp, dumps_body_model(self._body))
            self._writer.write_string("robot_description", stamp, urdf_from_body(self._body))
        if estimate.posture is None or estimate.keypoints_m is None:
            return
        self._writer.write_joint_state(
            "joint_states", stamp, "camera_level", JOINT_NAMES, estimate.posture
        )
        self._writer.write_pose_array("keypoints", stamp, self._frame_id, estimate.keypoints_m)
