"""The tracker's input: synchronized observations of its cameras, with their images and depth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.depth_image import DepthImage
from cardbox_tracker.camera.pairing import TOLERANCE_NS, Arrivals
from cardbox_tracker.camera.view import OtherCamera
from cardbox_tracker.common.errors import CameraError, CardboxError
from cardbox_tracker.common.health import WATCHES, Verdict
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.messages.conversions import ImageArray
from cardbox_tracker.ros.nodes.camera_poses import CameraPoses, silhouettes_of
from cardbox_tracker.ros.nodes.depth_input import DepthInput
from cardbox_tracker.ros.nodes.input_stream import InputStream, RecentImages
from cardbox_tracker.ros.nodes.keypoint_inputs import KeypointInputs
from cardbox_tracker.ros.nodes.tracker_parameters import TrackerParameters
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.tracking.observation import Observation

Deliver = Callable[[Image, Image | None, int], None]
"""Callback that receives a silhouette, its image or None, and the silhouette's send time, ns."""

_KEPT = 5
# After so many consecutive silhouettes without an image, the next ones do not wait.
_PATIENCE = 5


class ImagePairing:
    """Delivers every silhouette once and in order, with its image if that comes in time.

    The background node sends an image before its silhouette, so the image has usually arrived. If
    not, the silhouette waits for it, but not longer than until the next silhouette.

    Attributes:
        waits: False to deliver silhouettes at once, with or without image.
    """

    def __init__(self, deliver: Deliver) -> None:
        self.waits = True
        self._deliver = deliver
        self._images = RecentImages(_KEPT)
        self._waiting: tuple[Image, int] | None = None
        # Silhouettes wait only after the first image, because there may be no publisher.
        self._patience = 0

    def add_image(self, image: Image, _: int) -> None:
        """Add an image, and deliver the silhouette that waits for it."""
        self._images.append(image)
        self._patience = _PATIENCE
        if self._waiting is not None and _stamp_ns(self._waiting[0]) == _stamp_ns(image):
            self._hand_on(image)

    def add_silhouette(self, silhouette: Image, sent_ns: int) -> None:
        """Add a silhouette, and deliver the previous one if it still waits."""
        try:
            if self._waiting is not None:
                self._patience -= 1
                self._hand_on(None)
        finally:
            self._waiting = silhouette, sent_ns
            image = self._images.at(_stamp_ns(silhouette))
            if image is not None or not self.waits or self._patience <= 0:
                self._hand_on(image)

    def _hand_on(self, image: Image | None) -> None:
        if self._waiting is not None:
            silhouette, sent_ns = self._waiting
            self._waiting = None
            if image is not None:
                while len(self._images) and self._images.popleft() is not image:
                    pass
            self._deliver(silhouette, image, sent_ns)


# A paused camera falls behind, so stamps are compared only while both cameras send.
_RECENT_S = 0.5


class Received(NamedTuple):
    """Messages of one stream: a silhouette with its image, or a depth image."""

    message: Image
    image: Image | None
    sent_ns: int


@dataclass(frozen=True)
class ObservationSet:
    """Observations of all cameras at one time."""

    #: header in the first camera's frame, with the stamp of its silhouette, or of the earliest one
    header: Header
    #: header of each camera's silhouette, the first camera's first; None without one
    headers: list[Header | None]
    observations: list[Observation]  #: observation of each camera, as a tracker takes them
    sent_ns: int  #: send time of the last silhouette, ns since the epoch
    nothing: ImageArray  #: black image (H, W) of the first camera

    def picture(self, number: int = 0) -> ImageArray:
        """Return a camera's image, or its silhouette, or a black image."""
        one = self.observations[number]
        seen = one.silhouette if one.image is None else one.image
        return self.nothing if seen is None else seen


class CameraInputs:
    """Subscribes to all cameras, and delivers messages of the same time in order.

    :class:`ImagePairing` pairs each silhouette with its image. With several cameras or depth
    images, :class:`~cardbox_tracker.camera.pairing.Arrivals` then synchronizes the streams by their
    stamps. While the detector keeps up, silhouettes wait for their points, but not longer than
    until the next silhouette.
    """

    def __init__(
        self,
        node: CardboxNode,
        settings: TrackerParameters,
        changed: Callable[[Camera | None, Sequence[OtherCamera]], None],
        deliver: Callable[[Received, Sequence[Received | None]], None],
    ) -> None:
        """Subscribe with ``node``, the tracker.

        ``changed`` is called with the first and the further cameras when all are known or one has
        changed, and with None if their poses are no longer known; ``deliver`` with the silhouette
        whose stamp represents the set, and the messages of one time, for :meth:`observed`. Raises
        CardboxError if the file of the extrinsics cannot be read, or a name is not allowed.
        """
        cameras = settings.cameras or [""]
        self._deliver = deliver
        topics = silhouettes_of(cameras)
        self._streams = [
            InputStream(camera.strip("/") or "camera", node.resolve(topic))
            for camera, topic in zip(cameras, topics, strict=True)
        ]
        self._count = len(self._streams)
        if settings.depth:
            self._streams.append(InputStream("depth", node.resolve(settings.depth)))
        self._stuck = [Verdict("stuck") for _ in self._streams]
        # Differences of stamps that arrive together, and of clocks: images of the same moment
        # arrive at almost the same time, and late ones do not change the median.
        self._clocks = [Verdict("clock", lambda stamps_s, _: abs(stamps_s)) for _ in self._streams]
        self._is_named = bool(settings.cameras or settings.depth)
        self._arrivals: Arrivals[Received] = Arrivals(len(self._streams), TOLERANCE_NS)
        self._pairings = [ImagePairing(partial(self._add, number)) for number in range(self._count)]
        for topic, pairing in zip(topics, self._pairings, strict=True):
            if settings.use_image:
                image = f"{topic}/image"
                node.subscribe(Image, image, pairing.add_image, qos.SILHOUETTE_INPUT)
            # The newest silhouette; of several streams, those of one time must be found.
            profile = qos.SILHOUETTE if len(self._streams) == 1 else qos.SILHOUETTE_INPUT
            node.subscribe(Image, topic, pairing.add_silhouette, profile)
        # Of messages that arrive together, silhouettes are taken before their CameraInfo.
        self._poses = CameraPoses(
            *(node, cameras, settings.extrinsics_file),
            lambda: changed(self._poses.first, self._poses.others),
        )
        if settings.depth:
            self._depth_input = DepthInput(node, settings.depth, self._on_depth)
        self._keypoints = KeypointInputs(node, settings, self._release)
        self._held: Sequence[Received | None] | None = None
        self._tracks_people = settings.people > 0

    @property
    def source(self) -> str:
        """Topics of the silhouettes."""
        return ", ".join(stream.topic for stream in self._streams[: self._count])

    @property
    def missing(self) -> str:
        """Topics of CameraInfo on which nothing was received yet."""
        return ", ".join(self._poses.missing)

    def check(self) -> None:
        """Raise CameraError if all cameras are known, but not their poses."""
        self._poses.check()

    def wait_for_images(self, waits: bool) -> None:
        """Set whether silhouettes wait for their images."""
        for pairing in self._pairings:
            pairing.waits = waits

    def _on_depth(self, message: Any, sent_ns: int) -> None:
        self._add(self._count, message, None, sent_ns)

    def _add(self, number: int, message: Image, image: Image | None, sent_ns: int) -> None:
        stamp_ns, received = _stamp_ns(message), Received(message, image, sent_ns)
        is_usable = self._streams[number].arrived(stamp_ns, sent_ns).is_usable
        first, other = self._streams[0], self._streams[number]
        if number and first.newest_ns and other.newest_ns and first.age_s < _RECENT_S:
            transit_s = first.transit_s - other.transit_s
            self._clocks[number].see(first.delay_s - other.delay_s, transit_s)
        if len(self._streams) == 1:
            # The node itself drops and counts repeated and late messages.
            self._hold([received])
            return
        self._stuck[number].count(not is_usable)
        if not is_usable:
            return
        self._arrivals.tolerance_ns = self._streams[0].statistics.period_ns // 2 or TOLERANCE_NS
        self._arrivals.add(number, stamp_ns, received)
        for one_time in self._arrivals.sets():
            # A set with only a depth image cannot be tracked.
            if any(one is not None for one in one_time[: self._count]):
                self._hold(one_time)

    def _hold(self, received: Sequence[Received | None]) -> None:
        """Deliver messages of one time, with their points if these come before the next ones."""
        try:
            self._release(is_last=True)
        finally:
            self._held = received
            self._keypoints.expect(_stamp_ns(self._lead_of(received).message))
            self._release()

    def _release(self, is_last: bool = False) -> None:
        received = self._held
        if received is not None and (is_last or not self._keypoints.are_due):
            self._held = None
            self._deliver(self._lead_of(received), received)

    def _lead_of(self, received: Sequence[Received | None]) -> Received:
        """Return the silhouette whose stamp represents the set: the first camera's or earliest."""
        first = received[0]
        there = [one for one in received[: self._count] if one is not None]
        return first or min(there, key=lambda one: _stamp_ns(one.message))

    def observed(self, received: Sequence[Received | None]) -> ObservationSet:
        """Convert delivered messages to arrays, without unreadable ones, which are reported.

        Raises CameraError if no silhouette can be read.
        """
        first = self._poses.first
        assert first is not None
        lead, messages = self._lead_of(received), received[: self._count]
        cameras = [first, *(other.camera for other in self._poses.others)]
        streams = self._streams[: self._count]
        observations = [
            self._with_points(number, one, Observation(*_picture(stream, one, camera)), camera)
            for number, (stream, one, camera) in enumerate(
                zip(streams, messages, cameras, strict=True)
            )
        ]
        if all(one.silhouette is None for one in observations):
            problems = [stream.problem for stream in streams if stream.problem]
            raise CameraError("; ".join(problems))
        depth_m = self._depth(received[self._count :], first)
        stamp_ns = _stamp_ns(lead.message)
        observations[0] = observations[0].having(depth_m=depth_m, stamp_ns=stamp_ns)
        header = lead.message.header
        if received[0] is None:
            header = Header(stamp=header.stamp, frame_id=self._poses.frame_id)
        return ObservationSet(
            header,
            [
                one.message.header if one is not None and seen.silhouette is not None else None
                for one, seen in zip(messages, observations, strict=True)
            ],
            observations,
            max(one.sent_ns for one in messages if one is not None),
            np.zeros((first.height, first.width), np.uint8),
        )

    def _with_points(
        self, number: int, received: Received | None, seen: Observation, camera: Camera
    ) -> Observation:
        """Return an observation with the points that have arrived; it does not wait for points."""
        if received is None or seen.silhouette is None or not self._keypoints.cameras:
            return seen
        header, source = received.message.header, self._keypoints.cameras[number]
        if self._tracks_people:
            return seen.having(people=source.people(header, camera))
        period_ns = self._streams[number].statistics.period_ns
        half_ns = period_ns // 2 or TOLERANCE_NS
        points = source.points(header, camera, seen.silhouette, half_ns)
        return seen.having(points=points)

    def _depth(self, received: Sequence[Received | None], camera: Camera) -> DepthImage | None:
        if not received or received[0] is None:
            return None
        stream = self._streams[-1]
        try:
            depth_m = self._depth_input.seen_by(camera, received[0].message)
        except CardboxError as error:
            stream.problem = str(error)
            return None
        stream.problem = ""
        return depth_m

    def values(self, ious: Sequence[float | None]) -> dict[str, str]:
        """Return rate and age of points and of each stream that has a name, and its fit."""
        values = self._keypoints.values()
        for number, stream in enumerate(self._streams if self._is_named else ()):
            values |= stream.values()
            if self._count > 1 and number < min(len(ious), self._count):
                iou = ious[number]
                values[f"{stream.name} iou"] = "sees nobody" if iou is None else f"{iou:.3f}"
            if len(self._streams) > 1:
                values[f"{stream.name} late"] = str(self._arrivals.late[number])
        return values

    def warnings(self) -> dict[str, str]:
        """Return warnings about points and single streams while the others continue, by kind."""
        texts = self._keypoints.warnings()
        if len(self._streams) == 1:
            return texts
        # If nothing comes at all, the node says so itself.
        silence = WATCHES["silence"]
        is_going_on = not all(silence.is_beyond(stream.age_s) for stream in self._streams)
        first = self._streams[0]
        for stream, stuck, clock in zip(self._streams, self._stuck, self._clocks, strict=True):
            name, topic = stream.name, stream.topic
            if stuck.holds:
                texts[f"stamps of {name}"] = stuck.remark(topic=topic)
            elif is_going_on and silence.is_beyond(stream.age_s):
                texts[f"silence of {name}"] = silence.remark(stream.age_s, topic=topic)
            elif stream.problem:
                texts[f"{name} cannot be read"] = f"{topic}: {stream.problem}"
            is_paused = stream.age_s >= _RECENT_S
            if clock.holds and not is_paused and clock.value > first.statistics.period_ns / 2e9:
                others_s = abs(clock.medians[1])
                remedy = (
                    f"the clocks of the computers that send them are {others_s:.2f} s apart: "
                    "synchronize them, for example with chrony"
                    if clock.watch.is_beyond(others_s)
                    else "one of them takes so much longer to be made: send smaller or fewer images"
                )
                texts[f"clock of {name}"] = clock.remark(
                    topic=topic, first=first.topic, remedy=remedy
                )
        return texts


def _picture(
    stream: InputStream, received: Received | None, camera: Camera
) -> tuple[ImageArray | None, ImageArray | None]:
    """Return silhouette and image of a camera; None for each that is missing or unreadable."""
    if received is None:
        return None, None
    try:
        silhouette = conversions.silhouette_of(received.message)
        height, width = silhouette.shape
        if (width, height) != (camera.width, camera.height):
            raise CameraError(
                f"the silhouette is {width}x{height} but {stream.topic}/camera_info describes "
                f"{camera.width}x{camera.height}; expected the same size"
            )
        image = conversions.image_behind(silhouette, received.image)
    except CardboxError as error:
        stream.problem = str(error)
        return None, None
    stream.problem = ""
    return silhouette, image


def _stamp_ns(message: Image) -> int:
    return conversions.stamp_ns(message.header.stamp)
