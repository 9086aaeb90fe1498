"""2D points for the tracker, from a topic of each camera or from a table."""

from __future__ import annotations

import time

import numpy as np
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header

from cardbox_tracker.camera.calibration_watch import CalibrationWatch
from cardbox_tracker.camera.camera import Calibration, Camera
from cardbox_tracker.common.files import user_path
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.detectors.person_choice import person_in
from cardbox_tracker.detectors.point_table import PointTable
from cardbox_tracker.ros.messages.conversions import ImageArray, stamp_ns
from cardbox_tracker.ros.nodes.keypoint_topic import KeypointTopic, Taken
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.ros.runtime.node import CardboxNode

_PATIENCE_S = 3.0
# With this calibration a table's points stay where they are.
_ANY_SIZE = (640, 480)
_ANY = Calibration(
    *_ANY_SIZE, np.array([(600.0, 0.0, 320.0), (0.0, 600.0, 240.0), (0.0, 0.0, 1.0)]), np.zeros(0)
)


class KeypointInputs:
    """The points of all cameras; the tracker never waits for them."""

    def __init__(self, node: CardboxNode, settings: TrackerParameters) -> None:
        """Subscribe with ``node``, the tracker, if its parameter ``keypoints`` is given.

        Raises:
            CardboxError: the table cannot be read, or the topic's name is not allowed.
        """
        cameras = (settings.cameras or [""]) if settings.keypoints else []
        self._cameras = [_CameraKeypoints(node, settings, name) for name in cameras]
        self._topics = [one.topic for one in self._cameras if one.topic is not None]

    def points(
        self, number: int, header: Header, camera: Camera, silhouette: ImageArray
    ) -> ImagePoints | None:
        """Return the points for a silhouette of a camera, px of the silhouette, if there are any.

        Args:
            number: which camera.
            header: header of the silhouette.
            camera: camera of the silhouette.
            silhouette: (H, W), 0 or 255, in which the person is looked for among several.
        """
        if not self._cameras:
            return None
        return self._cameras[number].points(header, camera, silhouette)

    def values(self) -> dict[str, str]:
        """Return rate and age of each camera's points for the diagnostics."""
        return {name: text for one in self._topics for name, text in one.values().items()}

    def warnings(self) -> dict[str, str]:
        """Return warnings about the points, by kind."""
        texts = {kind: text for one in self._cameras for kind, text in one.warnings().items()}
        waits = [one.stream for one in self._topics if not one.stream.statistics.received]
        # One camera of several may be without a detector.
        is_silent = waits and len(waits) == len(self._topics) and waits[0].age_s > _PATIENCE_S
        if is_silent and not texts:
            names = ", ".join(stream.topic for stream in waits)
            texts["no keypoints"] = (
                f"no points have come on {names}; tracking goes on without. Is the detector "
                "running, and is this its topic?"
            )
        return texts


class _CameraKeypoints:
    """The points of one camera, and the calibration that leads from its image to silhouettes."""

    def __init__(self, node: CardboxNode, settings: TrackerParameters, camera: str) -> None:
        source, below = settings.keypoints, f"{camera.rstrip('/')}/" if camera else ""
        self.topic: KeypointTopic | None = None
        if settings.has_point_table:
            table = PointTable(user_path(source))
            self._find = table.read(camera.strip("/") or None, _ANY, _ANY_SIZE)
        else:
            name = f"{camera.strip('/')} keypoints".lstrip()
            topic = source if source.startswith("/") else f"{below}{source}"
            self.topic = KeypointTopic(node, name, topic)
        self._info_topic = node.resolve(f"{below}camera_info")
        self._watch = CalibrationWatch(
            self._info_topic,
            node.resolve(f"{below}image_raw"),
            np.radians(settings.camera_roll_deg),
        )
        self._began_s = time.monotonic()
        node.subscribe_info(f"{below}camera_info", self._on_info)

    def _on_info(self, message: CameraInfo, _: int) -> None:
        if self._watch.see(message) and self.topic is not None and self._watch.current is not None:
            self.topic.size = self._watch.current.width, self._watch.current.height

    def points(self, header: Header, camera: Camera, silhouette: ImageArray) -> ImagePoints | None:
        calibration, at_ns = self._watch.current, stamp_ns(header.stamp)
        taken = self._taken(at_ns, header.frame_id)
        if taken is None or calibration is None:
            return None
        placed = [_placed(person, calibration, camera) for person in taken.persons]
        person = person_in(silhouette, placed)
        if person is None:
            return None
        return ImagePoints(person.px, person.scores, min(taken.stamp_ns, at_ns))

    def _taken(self, at_ns: int, frame_id: str) -> Taken | None:
        if self.topic is not None:
            return self.topic.take(at_ns, frame_id)
        points = self._find(at_ns, _NOTHING)
        return None if points is None else Taken(at_ns, "", [points])

    def warnings(self) -> dict[str, str]:
        texts = {} if self.topic is None else self.topic.warnings()
        if self._watch.current is None and time.monotonic() - self._began_s > _PATIENCE_S:
            texts[f"calibration on {self._info_topic}"] = (
                f"no CameraInfo has come on {self._info_topic}, so keypoints cannot be placed in "
                "the silhouette; remap camera_info of the tracker to that of the camera"
            )
        return texts


def _placed(person: ImagePoints, calibration: Calibration, camera: Camera) -> ImagePoints:
    """Return the points in the working image."""
    size = np.array([camera.width, camera.height])
    px = calibration.rectified(person.px, camera.width, camera.height)
    # Beyond its image, a lens with distortion is not calibrated.
    is_near = ((px > -size) & (px < 2 * size)).all(axis=1)
    return ImagePoints(px, np.where(is_near, person.scores, 0.0))


_NOTHING = np.zeros((1, 1), np.uint8)
