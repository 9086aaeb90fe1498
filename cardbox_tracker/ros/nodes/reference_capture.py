"""Capture of the reference postures, in silhouettes and for the distance, and the measurement."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

from sensor_msgs.msg import Image

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.depth_image import DepthImage, median_depth
from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.measuring.asked_outline import check_asked
from cardbox_tracker.measuring.config import InitializationConfig, InitializationResult
from cardbox_tracker.measuring.measure import initialize_body
from cardbox_tracker.measuring.references import Silhouette, average_silhouette, check_reference
from cardbox_tracker.measuring.scale import (
    SCALE_REFERENCES,
    DepthReference,
    Measure,
    depth_scale,
    measured_at_scale,
    measured_scale,
)
from cardbox_tracker.person.posture import REFERENCE_NAMES
from cardbox_tracker.ros.messages.conversions import ImageArray, image_of, silhouette_of, stamp_ns
from cardbox_tracker.ros.nodes.camera_poses import CameraPoses, silhouettes_of
from cardbox_tracker.ros.nodes.depth_input import DepthInput
from cardbox_tracker.ros.nodes.initializer_parameters import InitializerParameters
from cardbox_tracker.ros.nodes.input_stream import RecentImages
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode

KEPT = 5
"""Silhouettes that a capture combines: more have less noise, but need longer standing still."""
ONE_POSTURE_NS = 1_000_000_000
"""Older silhouettes may show the posture before."""
_OLD_S = 2.0


def alike_of(recent: RecentImages) -> list[Image]:
    """Return the images with the posture and size of the last one, which is among them."""
    messages = list(recent)
    latest = messages[-1]
    now_ns = stamp_ns(latest.header.stamp)
    return [
        message
        for message in messages
        if (message.width, message.height) == (latest.width, latest.height)
        and 0 <= now_ns - stamp_ns(message.header.stamp) <= ONE_POSTURE_NS
    ]


class ReferenceCapture:
    """The references captured so far, by name.

    Attributes:
        captured: reference silhouettes (H, W), 0 or 255.
        images: images (H, W, 3) bgr or (H, W) of the silhouettes whose image came in time.
    """

    def __init__(self, topic: str) -> None:
        self.captured: dict[str, Silhouette] = {}
        self.images: dict[str, list[ImageArray]] = {}
        self._topic = topic
        self._recent = RecentImages(KEPT)
        self._recent_images = RecentImages(KEPT)
        self._received_s = 0.0

    def add(self, message: Image) -> None:
        """Add the latest silhouette."""
        silhouette_of(message)
        self._recent.append(message)
        self._received_s = time.monotonic()

    def add_image(self, message: Image, _: int) -> None:
        """Add the image of the silhouette with the same stamp."""
        self._recent_images.append(message)

    def behind(self, message: Image) -> Image | None:
        """Return the image of a silhouette, or None if it has not arrived."""
        return self._recent_images.at(stamp_ns(message.header.stamp))

    @property
    def latest_ns(self) -> int | None:
        """Stamp of the latest silhouette; None before the first one."""
        latest = next(reversed(self._recent), None)
        return None if latest is None else stamp_ns(latest.header.stamp)

    @property
    def missing(self) -> list[str]:
        """Names of the references still to be captured."""
        return [name for name in REFERENCE_NAMES if name not in self.captured]

    @property
    def has_silhouettes(self) -> bool:
        """Whether a silhouette was received."""
        return bool(self._recent)

    def check_running(self) -> None:
        """Raise InitializationError if no silhouette was received yet."""
        if not self._recent:
            raise InitializationError(
                f"no silhouette was received yet on {self._topic}; start the background node, let "
                "it learn the empty scene, then step in front of the camera"
            )

    def capture(self, name: str, camera: Camera | None, config: InitializationConfig) -> str:
        """Keep most of the latest silhouettes as reference ``name``; return words on the rest.

        If the working camera is known, the posture is compared with the requested one.
        """
        self.check_running()
        alike = alike_of(self._recent)
        silhouettes = [silhouette_of(message) for message in alike]
        silhouette = average_silhouette(silhouettes)
        check_reference(name, silhouette)
        warning = ""
        if camera is not None and silhouette.shape == (camera.height, camera.width):
            warning = check_asked(name, silhouette, camera, config)
        stamps = {stamp_ns(message.header.stamp) for message in alike}
        images = [m for m in self._recent_images if stamp_ns(m.header.stamp) in stamps]
        self.captured[name] = silhouette
        # If stamps repeat, there can be more images than silhouettes.
        self.images[name] = [image_of(message) for message in images[-len(alike) :]]
        text = f"captured '{name}' from {len(silhouettes)} silhouettes{warning}"
        age_s = time.monotonic() - self._received_s
        if age_s > _OLD_S:
            text += (
                f"; the latest came {age_s:.0f} s ago, as it must while a recording is paused; of "
                "a camera, see whether it runs"
            )
        if self.missing:
            return f"{text}; missing: {', '.join(self.missing)}"
        return f"{text}; all three are there"


Progress = Callable[[float], None]
"""Callback that receives the finished fraction of a measurement."""

# A few depth images of a posture are enough, and each takes much memory.
_KEPT_DEPTHS = 5


class DepthDistance:
    """Keeps the depth of the reference postures in the view of the measuring camera."""

    def __init__(
        self,
        node: CardboxNode,
        topic: str,
        references: ReferenceCapture,
        camera: Callable[[], Camera | None],
    ) -> None:
        """Subscribe to depth on ``topic``; ``camera`` returns that of the silhouettes, if known."""
        self._topic, self._references, self._camera = node.resolve(topic), references, camera
        self._recent: deque[tuple[int, DepthImage]] = deque(maxlen=_KEPT_DEPTHS)
        self._captured: dict[str, DepthImage] = {}
        self._input = DepthInput(node, topic, self._add)

    def _add(self, message: Any, _: int) -> None:
        if (camera := self._camera()) is not None:
            depth_m = self._input.seen_by(camera, message)
            self._recent.append((stamp_ns(message.header.stamp), depth_m))

    def check(self) -> None:
        """Check before the reference postures that a measurement will be possible."""
        if not self._recent:
            raise InitializationError(
                f"no depth image was received yet on {self._topic}, so the person's distance "
                "cannot be measured; start its publisher, or give person_distance_m and set "
                "measure_distance to false"
            )

    def capture(self, name: str, now_ns: int) -> None:
        """Keep the depth of the reference ``name`` at the stamp of its silhouette."""
        alike = [
            depth_m
            for at_ns, depth_m in self._recent
            if abs(at_ns - now_ns) <= ONE_POSTURE_NS and depth_m.shape == self._recent[-1][1].shape
        ]
        if not alike:
            raise InitializationError(
                f"reference '{name}': no depth image has come on {self._topic} at the time of the "
                "silhouettes; is the depth camera running, with stamps of the same clock?"
            )
        self._captured[name] = median_depth(alike)

    def measure(self, measure: Measure, config: InitializationConfig) -> InitializationResult:
        """Measure a person by ``measure``, and the distance with the depth images."""
        camera, silhouettes = self._camera(), self._references.captured
        if camera is None or any(name not in self._captured for name in SCALE_REFERENCES):
            raise InitializationError(
                f"there are no depth images of the references {' and '.join(SCALE_REFERENCES)}: "
                "they were captured while measure_distance was false; capture them again"
            )
        seen = {
            name: DepthReference(silhouettes[name], self._captured[name])
            for name in SCALE_REFERENCES
        }
        if any(one.silhouette.shape != one.depth_m.shape for one in seen.values()):
            raise InitializationError(
                "the working resolution has changed since the references were captured; capture "
                "them again"
            )
        return measured_at_scale(measure, config, camera, partial(depth_scale, references=seen))


class SecondCamera:
    """Captures the reference postures in the view of the second of several cameras."""

    def __init__(self, node: CardboxNode, settings: InitializerParameters) -> None:
        cameras = settings.cameras[:2]
        self._poses = CameraPoses(node, cameras, settings.extrinsics_file, lambda: None)
        self._recent = RecentImages(KEPT)
        self._captured: dict[str, Silhouette] = {}
        topic = silhouettes_of(cameras)[1]
        self._topic = node.resolve(topic)
        node.subscribe(Image, topic, self._add, qos.SILHOUETTE_INPUT)

    def _add(self, message: Image, _: int) -> None:
        silhouette_of(message)
        self._recent.append(message)

    def check(self) -> None:
        """Check before the reference postures that a measurement will be possible."""
        self._poses.check()
        if self._poses.first is None or not self._recent:
            raise InitializationError(
                f"no silhouette was received yet on {self._topic}, or no CameraInfo of a camera, "
                "so the second camera cannot measure the person's distance; start its background "
                "node, or give person_distance_m and set measure_distance to false"
            )

    def capture(self, name: str, now_ns: int) -> None:
        """Keep this camera's silhouettes of ``name`` at the stamp of the first camera's."""
        alike = alike_of(self._recent) if self._recent else []
        if not alike or abs(stamp_ns(alike[-1].header.stamp) - now_ns) > ONE_POSTURE_NS:
            raise InitializationError(
                f"reference '{name}': nothing has come on {self._topic} at the time of the first "
                "camera's silhouettes; is the second camera running, and its background node?"
            )
        self._captured[name] = average_silhouette([silhouette_of(message) for message in alike])

    def measure(self, measure: Measure, config: InitializationConfig) -> InitializationResult:
        """Measure a person by ``measure`` with the first camera, and the distance with this one."""
        self.check()
        first = self._poses.first
        assert first is not None
        missing = [name for name in SCALE_REFERENCES if name not in self._captured]
        if missing:
            raise InitializationError(
                f"the second camera has no reference {', '.join(missing)}: it was captured while "
                "measure_distance was false; capture it again"
            )
        other = self._poses.others[0]
        scale = partial(measured_scale, other=other, references=self._captured)
        return measured_at_scale(measure, config, first, scale)


def measured(
    references: ReferenceCapture,
    distance: DepthDistance | SecondCamera | None,
    camera: Camera,
    config: InitializationConfig,
    progress: Progress,
) -> InitializationResult:
    """Measure the person of ``references`` with ``camera``, and the distance with ``distance``."""

    def measure(at: InitializationConfig, done: Progress) -> InitializationResult:
        return initialize_body(references.captured, camera, at, done, references.images)

    def half(at: InitializationConfig, is_last: bool) -> InitializationResult:
        return measure(at, lambda fraction: progress(0.5 * (fraction + is_last)))

    return measure(config, progress) if distance is None else distance.measure(half, config)
