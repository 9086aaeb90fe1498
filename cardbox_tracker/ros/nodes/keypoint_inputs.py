"""2D points for the tracker, from a topic of each camera or from a table."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from rclpy.subscription import Subscription
from sensor_msgs.msg import CameraInfo, PointCloud2
from std_msgs.msg import Header

from cardbox_tracker.camera.camera import Calibration, Camera
from cardbox_tracker.camera.camera_info import calibration_from_info, info_content
from cardbox_tracker.camera.pairing import TOLERANCE_NS
from cardbox_tracker.camera.stamps import StampOrder
from cardbox_tracker.common.errors import CameraError, CardboxError, quoted, reason_of
from cardbox_tracker.common.files import user_path
from cardbox_tracker.common.health import WATCHES, Verdict
from cardbox_tracker.detectors.figure import figure_of_points
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.detectors.person_choice import person_in
from cardbox_tracker.detectors.point_checks import check_places
from cardbox_tracker.detectors.point_table import COLUMNS, Image, PointTable, placed, why_not
from cardbox_tracker.ros.messages.conversions import ImageArray, stamp_ns
from cardbox_tracker.ros.messages.keypoints import CONVERSIONS, POINT_CLOUD, Size
from cardbox_tracker.ros.messages.types import optional_class
from cardbox_tracker.ros.nodes.input_stream import InputStream
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.diagnostics import every_second
from cardbox_tracker.ros.runtime.node import CardboxNode

MOST_AGE_NS = 300_000_000
"""Points that are older than the silhouette by more are not used."""
SAME_TIME_NS = 50_000_000
"""Points that are newer than the silhouette by at most this are of the same time."""

# Points are moved on by their motion for at most this time, ns, if those before are at most so much
# older, and for at most so many times the time between both, since the motion is noisy. Points of
# one person are at most so far apart, lengths of the trunk.
_MOVED_NS, _MOTION_NS, _MOST_SPANS, _SAME_PERSON = 150_000_000, 250_000_000, 2, 0.5
_KEPT = 8
# Weight of an image in the share of images whose points come before the next image, and the share
# from which on images wait for theirs.
_LEARN_RATE, _KEEPS_UP = 0.1, 0.8


class Taken(NamedTuple):
    """Points of all persons in one image, in pixels of the camera's own image."""

    stamp_ns: int  #: stamp of the image
    frame_id: str  #: frame of the image; empty if it is not known
    persons: list[ImagePoints]  #: points of each person


class _Motion(NamedTuple):
    """The same people at two times, who go on as they moved."""

    newest: Taken
    before: list[ImagePoints]  #: points of each person of ``newest`` in the image before
    span_ns: int  #: time between both

    @classmethod
    def of(cls, before: Taken | None, newest: Taken) -> _Motion | None:
        """Return the motion between two sets of points; None if one person has none."""
        span_ns = 0 if before is None else newest.stamp_ns - before.stamp_ns
        if before is None or not 0 < span_ns <= _MOTION_NS:
            return None
        same = []
        for one in newest.persons:
            apart = [one.apart_px(other) for other in before.persons]
            most_px = _SAME_PERSON * figure_of_points(one).trunk_px
            if not apart or not min(apart) <= most_px:
                return None
            same.append(before.persons[int(np.argmin(apart))])
        return cls(newest, same, span_ns)

    def at(self, at_ns: int) -> Taken | None:
        """Return the points at a time, ns; None if they are too old for it."""
        ahead_ns = at_ns - self.newest.stamp_ns
        if ahead_ns > _MOVED_NS:
            return None
        moved_ns = min(max(ahead_ns, 0), _MOST_SPANS * self.span_ns)
        pairs = zip(self.newest.persons, self.before, strict=True)
        moved = [one.moved_on(before, moved_ns / self.span_ns) for one, before in pairs]
        return self.newest._replace(stamp_ns=self.newest.stamp_ns + moved_ns, persons=moved)


class KeypointTopic:
    """Keeps the points that arrive for one camera until a silhouette takes them.

    Attributes:
        stream: statistics of the messages.
        size: width and height of the camera's image, px; None until they are known.
    """

    def __init__(
        self, node: CardboxNode, name: str, topic: str, arrived: Callable[[], None]
    ) -> None:
        self.stream = InputStream(name, node.resolve(topic))
        self._arrived = arrived
        self._newest_ns = self._expected_ns = 0
        self._in_time = 1.0
        self._last: Taken | None = None
        self._motion: _Motion | None = None
        self.size: Size | None = None
        self._node, self._topic = node, topic
        self._kept: deque[Taken] = deque()
        self._asked_ns = self._apart_ns = 0
        self._used = self._unused = 0
        self._other_time = Verdict("other time")
        self._wrong_type = ""
        self._type = ""
        self._subscription: Subscription | None = None
        self._use(POINT_CLOUD, PointCloud2)
        self._look()
        # The publisher may start later, or be replaced by one of another type.
        self._timer = every_second(node, self._look)

    def expect(self, at_ns: int) -> None:
        """Take notice of the next silhouette; the points of the one before came until now."""
        came = self._newest_ns >= self._expected_ns
        self._in_time += _LEARN_RATE * (came - self._in_time)
        self._expected_ns = at_ns

    @property
    def is_due(self) -> bool:
        """Whether the points of the newest silhouette will come before the next one."""
        return self._in_time > _KEEPS_UP and self._newest_ns < self._expected_ns

    def take(self, at_ns: int, frame_id: str) -> Taken | None:
        """Return the newest points for a silhouette of this stamp and frame, or None.

        Points of images before are moved on, or else returned once.
        """
        self._asked_ns, newest, before = at_ns, None, self._last
        while self._kept and self._kept[0].stamp_ns <= at_ns + SAME_TIME_NS:
            before, newest = newest or before, self._kept.popleft()
        if newest is None:
            return self._motion.at(at_ns) if self._motion is not None else None
        self._last, self._motion = newest, None
        if at_ns - newest.stamp_ns > MOST_AGE_NS:
            self._leave_out(newest)
            return None
        if newest.frame_id and frame_id and newest.frame_id != frame_id:
            self._report(
                f"points are in the frame {quoted(newest.frame_id)}; expected the camera's, "
                f"{quoted(frame_id)}: give each camera's detector the images of that camera"
            )
            return None
        self._used += 1
        self._other_time.count(False)
        self._apart_ns = at_ns - newest.stamp_ns
        self._motion = _Motion.of(before, newest)
        moved = self._motion.at(at_ns) if self._motion is not None else None
        return moved or newest

    def values(self) -> dict[str, str]:
        """Return rate, age and use of the points for the diagnostics."""
        name = self.stream.name
        behind = f"{max(self._apart_ns, 0) / 1e6:.0f}"
        return self.stream.values() | {
            f"{name} behind the image (ms)": behind,
            f"{name} used": str(self._used),
            f"{name} not used": str(self._unused),
        }

    def warnings(self) -> dict[str, str]:
        """Return warnings about the points, while tracking goes on, by kind."""
        stream, name = self.stream, self.stream.name
        if self._wrong_type:
            return {f"type of {name}": self._wrong_type}
        silence = WATCHES["no points"].remark(stream.age_s, topic=stream.topic)
        if silence and stream.statistics.received:
            return {f"silence of {name}": silence}
        if self._other_time.holds:
            apart_s, than = abs(self._apart_ns) / 1e9, "older" if self._apart_ns > 0 else "newer"
            text = self._other_time.remark(
                topic=stream.topic, apart_s=apart_s, than=than, most_s=MOST_AGE_NS / 1e9
            )
            return {f"clock of {name}": text}
        return {f"{name} cannot be used": stream.problem} if stream.problem else {}

    def _look(self) -> None:
        """Subscribe with the type of the publisher, if it is one that can be read."""
        ends = self._node.get_publishers_info_by_topic(self.stream.topic)
        types = sorted({str(end.topic_type) for end in ends})
        self._wrong_type = ""
        if not types or self._type in types:
            return
        for type_ in types:
            package, _, name = type_.partition("/msg/")
            kind = optional_class(package, name) if type_ in CONVERSIONS else None
            if kind is not None:
                self._use(type_, kind)
                return
        known = [type_ for type_ in types if type_ in CONVERSIONS]
        if known:
            package = known[0].partition("/")[0]
            remedy = f"install that package (ros-jazzy-{package.replace('_', '-')}, or its source)"
        else:
            remedy = f"expected one of {', '.join(CONVERSIONS)}"
        self._wrong_type = (
            f"the points on {self.stream.topic} are {', '.join(types)}, which cannot be read: "
            f"{remedy}"
        )

    def _use(self, type_: str, kind: Any) -> None:
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
        self._type, self._convert = type_, CONVERSIONS[type_]
        self._kept.clear()
        self._subscription = self._node.subscribe(
            kind, self._topic, self._add, qos.SENSOR_DATA, has_one_type=False
        )

    def _add(self, message: Any, _: int) -> None:
        at_ns = stamp_ns(message.header.stamp)
        order = self.stream.arrived(at_ns)
        if not order.is_usable or self.size is None:
            return
        if order is StampOrder.UNSTAMPED:
            self._report("points have no stamp (it is zero); expected the stamp of their image")
            return
        if order is StampOrder.RESTART:
            self._kept.clear()
            self._last = self._motion = None
        try:
            persons = self._convert(message, self.size)
        except CardboxError as error:
            self._report(str(error))
            return
        except (AttributeError, TypeError) as error:
            # Another release of a foreign package may have other fields.
            self._report(f"the fields of {self._type} are not as expected: {reason_of(error)}")
            return
        self.stream.problem = ""
        self._newest_ns = at_ns
        self._kept.append(Taken(at_ns, message.header.frame_id.lstrip("/"), persons))
        if len(self._kept) > _KEPT:
            oldest = self._kept.popleft()
            if self._asked_ns:
                self._leave_out(oldest)
        self._arrived()

    def _leave_out(self, taken: Taken) -> None:
        self._unused += 1
        self._other_time.count(True)
        self._apart_ns = self._asked_ns - taken.stamp_ns

    def _report(self, problem: str) -> None:
        self._unused += 1
        self.stream.problem = f"{self.stream.topic}: {problem}"
        kind = f"{self.stream.name} cannot be used"
        self._node.diagnostics.say(kind, self.stream.problem, warning=True)


# Relative difference of focal length and principal point up to which cameras are the same.
_SAME_CAMERA = 1e-3
# Images at the start, in which a detector may not have looked at any yet.
_STARTING = 30


class KeypointInputs:
    """The points of all ``cameras``; none without a source."""

    def __init__(
        self,
        node: CardboxNode,
        settings: TrackerParameters,
        arrived: Callable[[], None] = lambda: None,
    ) -> None:
        """Subscribe with ``node`` if ``keypoints`` is given; raise CardboxError if it is wrong.

        ``arrived`` is called after each message with points.
        """
        cameras = (settings.cameras or [""]) if settings.keypoints else []
        self.cameras = [CameraKeypoints(node, settings, name, arrived) for name in cameras]
        self._topics = [one.topic for one in self.cameras if one.topic is not None]

    def expect(self, at_ns: int) -> None:
        """Take notice of the next silhouettes, of a time."""
        for one in self._topics:
            one.expect(at_ns)

    @property
    def are_due(self) -> bool:
        """Whether points of the newest silhouettes will come before the next ones."""
        return any(one.is_due for one in self._topics)

    def values(self) -> dict[str, str]:
        """Return rate, age and use of each camera's points for the diagnostics."""
        return {name: text for one in self.cameras for name, text in one.values().items()}

    def warnings(self) -> dict[str, str]:
        """Return warnings about the points, by kind."""
        texts = {kind: text for one in self.cameras for kind, text in one.warnings().items()}
        waits = [one.stream for one in self._topics if not one.stream.statistics.received]
        # One camera of several may be without a detector.
        is_silent = waits and len(waits) == len(self._topics)
        if is_silent and not texts and WATCHES["no points"].is_beyond(waits[0].age_s):
            names = ", ".join(stream.topic for stream in waits)
            texts["no keypoints"] = (
                f"no points have come on {names}; tracking goes on without. Is the detector "
                "running, and is this its topic?"
            )
        return texts


class CameraKeypoints:
    """The points of one camera, and the calibration that leads from its image to silhouettes."""

    def __init__(
        self,
        node: CardboxNode,
        settings: TrackerParameters,
        camera: str,
        arrived: Callable[[], None],
    ) -> None:
        source, below = settings.keypoints, f"{camera.rstrip('/')}/" if camera else ""
        self.topic: KeypointTopic | None = None
        self._name = f"{camera.strip('/')} keypoints".lstrip()
        self._images = self._used = 0
        self._beside = Verdict("beside")
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
            self.topic = KeypointTopic(node, self._name, topic, arrived)
        self._info_topic = node.resolve(f"{below}camera_info")
        self._image_topic = node.resolve(f"{below}image_raw")
        self._roll_rad = np.radians(settings.camera_roll_deg)
        self._calibration: Calibration | None = None
        self._content: tuple[Any, ...] = ()
        self._camera: Camera | None = None
        self._began_s = time.monotonic()
        node.subscribe_info(f"{below}camera_info", self._on_info)

    def _on_info(self, message: CameraInfo, _: int) -> None:
        """Follow another calibration unless the silhouettes, whose node sees the images, do not."""
        before, content = self._calibration, info_content(message)
        if before is not None and content == self._content:
            return
        try:
            found = calibration_from_info(message, self._image_topic, self._info_topic)
            found = replace(found, roll_rad=self._roll_rad)
            is_seen = self._is_seen(found)
        except CameraError:
            if before is None:
                raise
            return
        if before is None or is_seen or not self._is_seen(before):
            self._calibration, self._content = found, content
            if self.topic is not None:
                self.topic.size = found.width, found.height

    def _is_seen(self, calibration: Calibration) -> bool:
        """Return whether the last silhouette is of a calibration, or raise CameraError."""
        here, size = self._camera, self._camera or calibration
        there = calibration.camera(size.width, size.height)
        if here is None:
            return False
        k, own = ((one.fx, one.fy, one.cx, one.cy) for one in (there, here))
        return np.allclose(k, own, rtol=_SAME_CAMERA)

    def points(
        self,
        header: Header,
        camera: Camera,
        silhouette: ImageArray,
        tolerance_ns: int = TOLERANCE_NS,
    ) -> ImagePoints | None:
        """Return the points for a silhouette (H, W), 0 or 255, px of it, if there are any.

        Of several people it chooses the one in the silhouette; points of a table join within
        ``tolerance_ns``.
        """
        found = self._placed(header, camera, tolerance_ns)
        person = None if found is None else person_in(silhouette, found)
        if person is None:
            return None
        self._reason = why_not(silhouette, person)
        self._beside.count(bool(self._reason))
        if self._reason:
            return None
        self._used += 1
        return person

    def people(self, header: Header, camera: Camera) -> list[ImagePoints] | None:
        """Return the points of all people in the image; None before a detector has found any."""
        found = self._placed(header, camera, TOLERANCE_NS)
        if found is None:
            # Once a detector has found people, or may soon, regions of the silhouette are none.
            return [] if self._used or self._images <= _STARTING else None
        self._used += 1
        return [one for one in found if not one.is_empty]

    def _placed(
        self, header: Header, camera: Camera, tolerance_ns: int
    ) -> list[ImagePoints] | None:
        """Return the points of all persons in px of the silhouette; None if there are none yet."""
        calibration, at_ns = self._calibration, stamp_ns(header.stamp)
        self._camera = camera
        taken = self._taken(at_ns, header.frame_id, tolerance_ns)
        self._images += 1
        if taken is None or calibration is None:
            return None
        size, of_ns = (camera.width, camera.height), min(taken.stamp_ns, at_ns)
        found = (placed(one, calibration, size) for one in taken.persons)
        return [replace(one, stamp_ns=of_ns) for one in found]

    def _taken(self, at_ns: int, frame_id: str, tolerance_ns: int) -> Taken | None:
        if self.topic is not None:
            return self.topic.take(at_ns, frame_id)
        calibration = self._calibration
        if calibration is None:
            return None
        found = self._given.persons(Image(at_ns), tolerance_ns)
        try:
            for person in found:
                check_places(person, (calibration.width, calibration.height))
        except CardboxError as error:
            self._fault = str(error)
            return None
        return Taken(at_ns, "", found) if found else None

    def values(self) -> dict[str, str]:
        """Return rate, age and use of the points for the diagnostics."""
        return ({} if self.topic is None else self.topic.values()) | {
            f"{self._name} in images": f"{self._used} of {self._images}"
        }

    def warnings(self) -> dict[str, str]:
        """Return warnings about the points, by kind."""
        texts = {} if self.topic is None else self.topic.warnings()
        if self._fault:
            texts[f"{self._name} cannot be used"] = self._fault
        if self._beside.holds:
            texts[f"place of {self._name}"] = self._beside.remark(reason=self._reason)
        is_late = WATCHES["no points"].is_beyond(time.monotonic() - self._began_s)
        if self._calibration is None and is_late:
            texts[f"calibration on {self._info_topic}"] = (
                f"no CameraInfo has come on {self._info_topic}, so keypoints cannot be placed in "
                "the silhouette; remap camera_info of the tracker to that of the camera"
            )
        return texts
