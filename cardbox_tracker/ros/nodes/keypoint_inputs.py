"""2D points for the tracker, from a topic of each camera or from a table."""

from __future__ import annotations

import time

import numpy as np
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header

from cardbox_tracker.camera.calibration_watch import CalibrationWatch
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.pairing import TOLERANCE_NS
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import user_path
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.detectors.person_choice import person_in
from cardbox_tracker.detectors.point_checks import check_places
from cardbox_tracker.detectors.point_table import COLUMNS, Image, PointTable, placed, why_not
from cardbox_tracker.ros.messages.conversions import ImageArray, stamp_ns
from cardbox_tracker.ros.nodes.keypoint_topic import KeypointTopic, Taken
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.ros.runtime.node import CardboxNode

_PATIENCE_S = 3.0
# Images in a row whose points lie beside the silhouette, after which a warning follows.
_BESIDE = 10


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
        self,
        number: int,
        header: Header,
        camera: Camera,
        silhouette: ImageArray,
        tolerance_ns: int = TOLERANCE_NS,
    ) -> ImagePoints | None:
        """Return the points for a silhouette of a camera, px of the silhouette, if there are any.

        Args:
            number: which camera.
            header: header of the silhouette.
            camera: camera of the silhouette.
            silhouette: (H, W), 0 or 255, in which the person is looked for among several.
            tolerance_ns: half the time between images, within which points of a table join.
        """
        if not self._cameras:
            return None
        return self._cameras[number].points(header, camera, silhouette, tolerance_ns)

    def people(self, header: Header, camera: Camera) -> list[ImagePoints] | None:
        """Return the points of all people in the image of a silhouette; None without a detector."""
        return self._cameras[0].people(header, camera) if self._cameras else None

    def values(self) -> dict[str, str]:
        """Return rate, age and use of each camera's points for the diagnostics."""
        return {name: text for one in self._cameras for name, text in one.values().items()}

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
        self._name = f"{camera.strip('/')} keypoints".lstrip()
        self._images = self._used = self._beside = 0
        self._fault = self._reason = ""
        if settings.has_point_table:
            table = PointTable(user_path(source))
            self._given = table.read(camera.strip("/") or None)
            if self._given.kind != COLUMNS[0]:
                raise CardboxError(
                    f"{source} has no column {COLUMNS[0]}, by which images are known"
                )
        else:
            topic = source if source.startswith("/") else f"{below}{source}"
            self.topic = KeypointTopic(node, self._name, topic)
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

    def points(
        self, header: Header, camera: Camera, silhouette: ImageArray, tolerance_ns: int
    ) -> ImagePoints | None:
        calibration, at_ns = self._watch.current, stamp_ns(header.stamp)
        taken = self._taken(at_ns, header.frame_id, tolerance_ns)
        self._images += 1
        if taken is None or calibration is None:
            return None
        size = camera.width, camera.height
        person = person_in(silhouette, [placed(one, calibration, size) for one in taken.persons])
        if person is None:
            return None
        self._reason = why_not(silhouette, person)
        if self._reason:
            self._beside += 1
            return None
        self._used, self._beside = self._used + 1, 0
        return ImagePoints(person.px, person.scores, min(taken.stamp_ns, at_ns))

    def people(self, header: Header, camera: Camera) -> list[ImagePoints] | None:
        calibration, at_ns = self._watch.current, stamp_ns(header.stamp)
        taken = self._taken(at_ns, header.frame_id, TOLERANCE_NS)
        self._images += 1
        if taken is None or calibration is None:
            # Once a detector has found people, regions of the silhouette are none.
            return [] if self._used else None
        self._used += 1
        size, age_ns = (camera.width, camera.height), min(taken.stamp_ns, at_ns)
        found = (placed(one, calibration, size) for one in taken.persons)
        return [ImagePoints(one.px, one.scores, age_ns) for one in found if not one.is_empty]

    def _taken(self, at_ns: int, frame_id: str, tolerance_ns: int) -> Taken | None:
        if self.topic is not None:
            return self.topic.take(at_ns, frame_id)
        if self._watch.current is None:
            return None
        found = self._given.persons(Image(at_ns), tolerance_ns)
        try:
            for person in found:
                check_places(person, (self._watch.current.width, self._watch.current.height))
        except CardboxError as error:
            self._fault = str(error)
            return None
        return Taken(at_ns, "", found) if found else None

    def values(self) -> dict[str, str]:
        return ({} if self.topic is None else self.topic.values()) | {
            f"{self._name} in images": f"{self._used} of {self._images}"
        }

    def warnings(self) -> dict[str, str]:
        texts = {} if self.topic is None else self.topic.warnings()
        if self._fault:
            texts[f"{self._name} cannot be used"] = self._fault
        if self._beside > _BESIDE:
            texts[f"place of {self._name}"] = (
                f"the points of the last {self._beside} images are not used: {self._reason}"
            )
        if self._watch.current is None and time.monotonic() - self._began_s > _PATIENCE_S:
            texts[f"calibration on {self._info_topic}"] = (
                f"no CameraInfo has come on {self._info_topic}, so keypoints cannot be placed in "
                "the silhouette; remap camera_info of the tracker to that of the camera"
            )
        return texts
