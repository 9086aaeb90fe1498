"""What several cameras and a depth image show at one time, from the messages of each."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from cardbox_tracker.errors import CameraError, CardboxError
from cardbox_tracker.estimation.cost.terms import DepthImage
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.messages.conversions import ImageArray
from cardbox_tracker.ros.nodes.camera_poses import silhouettes_of
from cardbox_tracker.ros.nodes.depth_input import DepthInput
from cardbox_tracker.ros.nodes.image_pairing import ImagePairing
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.pairing import TOLERANCE_NS, Arrivals
from cardbox_tracker.vision.stamps import StreamStatistics

_SILENT_S = 3.0
# The stamps of cameras are compared only while all of them send: one that pauses is behind.
_RECENT_S = 0.5
_OTHER_CLOCK_NS = 1_000_000_000


@dataclass(frozen=True)
class Views:
    """What all cameras saw at one time; None of one that has nothing for it.

    Attributes:
        header: stamp of the first camera's image, or of the earliest one, in the first camera's
            frame.
        headers: of each camera's silhouette, the first camera's first.
        silhouettes: (H, W), 0 or 255, of each.
        images: (H, W, 3) bgr or (H, W), of each.
        depth_m: (H, W) of the first camera, metres.
        sent_ns: when the last silhouette left its sender, ns since the epoch.
        nothing: (H, W), a black image of the first camera.
    """

    header: Header
    headers: list[Header | None]
    silhouettes: list[ImageArray | None]
    images: list[ImageArray | None]
    depth_m: DepthImage | None
    sent_ns: int
    nothing: ImageArray

    @property
    def picture(self) -> ImageArray:
        """The first camera's image, or else its silhouette; black if it has neither."""
        seen = self.silhouettes[0] if self.images[0] is None else self.images[0]
        return self.nothing if seen is None else seen

    @property
    def seen(
        self,
    ) -> tuple[list[ImageArray | None], list[ImageArray | None], DepthImage | None]:
        """What the tracker sees of it: silhouettes, images and depth."""
        return self.silhouettes, self.images, self.depth_m


@dataclass(frozen=True)
class Seen:
    """A silhouette with its image, or a depth image, as they came."""

    message: Image
    image: Image | None
    sent_ns: int


class _Source:
    """One camera, or the depth image: what arrives of it, and what was wrong with it."""

    def __init__(self, name: str, topic: str) -> None:
        self.name, self.topic = name, topic
        self.stream = StreamStatistics()
        self.problem = ""
        self.newest_ns = 0
        self._arrived_s = self._counted_s = time.monotonic()
        self._counted = 0

    @property
    def age_s(self) -> float:
        """Seconds since the last message came, or since the start."""
        return time.monotonic() - self._arrived_s

    def arrived(self, stamp_ns: int) -> bool:
        """Take note of a message; return whether it can be used."""
        self._arrived_s, self.newest_ns = time.monotonic(), stamp_ns
        return self.stream.add(stamp_ns).is_usable

    def values(self) -> dict[str, str]:
        """Return the rate since the last call, and the age of what came last."""
        now_s, count = time.monotonic(), self.stream.received
        rate = (count - self._counted) / max(now_s - self._counted_s, 1e-3)
        self._counted_s, self._counted = now_s, count
        return {
            f"{self.name} rate (Hz)": f"{rate:.1f}",
            f"{self.name} age (s)": f"{self.age_s:.1f}" if count else "never",
        }


class CameraViews:
    """Puts together what belongs to one time, and hands it on in order."""

    def __init__(
        self,
        node: CardboxNode,
        cameras: Sequence[str],
        depth: str,
        use_image: bool,
        deliver: Callable[[Image, Sequence[Seen | None]], None],
    ) -> None:
        """Subscribe with ``node`` to each of ``cameras``, and to the topic ``depth`` if any.

        Raises:
            CardboxError: a name is none that ROS allows.
        """
        topics = silhouettes_of(cameras)
        self._sources = [
            _Source(camera.strip("/") or "camera", node.resolve(topic))
            for camera, topic in zip(cameras, topics, strict=True)
        ]
        self._count = len(self._sources)
        if depth:
            self._sources.append(_Source("depth", node.resolve(depth)))
        self._deliver = deliver
        self._arrivals: Arrivals[Seen] = Arrivals(len(self._sources), TOLERANCE_NS)
        self._pairings = [ImagePairing(partial(self._add, source)) for source in range(self._count)]
        for topic, pairing in zip(topics, self._pairings, strict=True):
            if use_image:
                image = f"{topic}/image"
                node.subscribe(Image, image, pairing.add_image, qos.SILHOUETTE_INPUT)
            node.subscribe(Image, topic, pairing.add_silhouette, qos.SILHOUETTE_INPUT)
        if depth:
            self._depth_input = DepthInput(node, depth, self._on_depth)

    @property
    def topics(self) -> list[str]:
        """Where the silhouettes of each camera come from."""
        return [source.topic for source in self._sources[: self._count]]

    @property
    def waits(self) -> bool:
        """Whether silhouettes wait for the images that they are cut out of."""
        return self._pairings[0].waits

    @waits.setter
    def waits(self, waits: bool) -> None:
        for pairing in self._pairings:
            pairing.waits = waits

    def _lead_of(self, seen: Sequence[Seen | None]) -> Image:
        """Return the silhouette whose stamp stands for all: the first camera's, or the earliest."""
        there = [one.message for one in seen[: self._count] if one is not None]
        return there[0] if seen[0] is not None else min(there, key=_stamp_ns)

    def _on_depth(self, message: Any, sent_ns: int) -> None:
        self._add(self._count, message, None, sent_ns)

    def _add(self, number: int, message: Image, image: Image | None, sent_ns: int) -> None:
        stamp_ns = _stamp_ns(message)
        if not self._sources[number].arrived(stamp_ns):
            return
        self._arrivals.tolerance_ns = self._sources[0].stream.period_ns // 2 or TOLERANCE_NS
        self._arrivals.add(number, stamp_ns, Seen(message, image, sent_ns))
        for seen in self._arrivals.sets():
            # The last one may be a depth image, which says nothing alone.
            if any(one is not None for one in seen[: self._count]):
                self._deliver(self._lead_of(seen), seen)

    def views(self, seen: Sequence[Seen | None], cameras: Sequence[Camera], frame: str) -> Views:
        """Return what was delivered as arrays; what cannot be read is left out, and said.

        Args:
            seen: as it was delivered.
            cameras: working cameras, the first one first.
            frame: name of the first camera's optical frame.

        Raises:
            CameraError: none of the silhouettes can be read.
        """
        pictures = [
            self._picture(source, one, camera)
            for source, one, camera in zip(self._sources, seen, cameras, strict=False)
        ]
        if all(silhouette is None for silhouette, _ in pictures):
            raise CameraError("; ".join(source.problem for source in self._sources))
        lead = self._lead_of(seen)
        return Views(
            Header(stamp=lead.header.stamp, frame_id=frame),
            [None if one is None else one.message.header for one in seen[: self._count]],
            [silhouette for silhouette, _ in pictures],
            [image for _, image in pictures],
            self._depth(seen[self._count :], cameras[0]),
            max(one.sent_ns for one in seen[: self._count] if one is not None),
            np.zeros((cameras[0].height, cameras[0].width), np.uint8),
        )

    def _picture(
        self, source: _Source, seen: Seen | None, camera: Camera
    ) -> tuple[ImageArray | None, ImageArray | None]:
        if seen is None:
            return None, None
        try:
            silhouette = conversions.silhouette_of(seen.message)
            height, width = silhouette.shape
            if (width, height) != (camera.width, camera.height):
                raise CameraError(
                    f"the silhouette is {width}x{height} but {source.topic}/camera_info describes "
                    f"{camera.width}x{camera.height}; expected the same size"
                )
            image = conversions.image_behind(silhouette, seen.image)
        except CardboxError as error:
            source.problem = str(error)
            return None, None
        source.problem = ""
        return silhouette, image

    def _depth(self, seen: Sequence[Seen | None], camera: Camera) -> DepthImage | None:
        if not seen or seen[0] is None:
            return None
        source = self._sources[-1]
        try:
            depth_m = self._depth_input.seen_by(camera, seen[0].message)
        except CardboxError as error:
            source.problem = str(error)
            return None
        source.problem = ""
        return depth_m

    def values(self, ious: Sequence[float | None]) -> dict[str, str]:
        """Return rate, age and fit of each camera, for the diagnostics."""
        values: dict[str, str] = {}
        for number, source in enumerate(self._sources):
            values |= source.values()
            if number < len(ious) and number < self._count:
                iou = ious[number]
                values[f"{source.name} iou"] = "sees nobody" if iou is None else f"{iou:.3f}"
            values[f"{source.name} late"] = str(self._arrivals.late[number])
        return values

    def warnings(self) -> dict[str, str]:
        """Return what is wrong with single cameras while the others go on, by kind."""
        first, *others = self._sources
        texts = {}
        for source in self._sources:
            if source.age_s > _SILENT_S:
                texts[f"silence of {source.name}"] = (
                    f"nothing has come on {source.topic} for {source.age_s:.0f} s; tracking goes "
                    "on without it: is that camera running, and every node behind it?"
                )
            elif source.problem:
                texts[f"{source.name} cannot be read"] = f"{source.topic}: {source.problem}"
        for source in others:
            apart_ns = abs(source.newest_ns - first.newest_ns)
            is_stamped = source.newest_ns and first.newest_ns
            is_recent = max(source.age_s, first.age_s) < _RECENT_S
            if is_stamped and is_recent and apart_ns > _OTHER_CLOCK_NS:
                texts[f"clock of {source.name}"] = (
                    f"the stamps on {source.topic} and {first.topic} are {apart_ns / 1e9:.1f} s "
                    "apart, so that nothing belongs together; set the clocks of both computers by "
                    "one, such as with chrony"
                )
        return texts


def _stamp_ns(message: Image) -> int:
    return conversions.stamp_ns(message.header.stamp)
