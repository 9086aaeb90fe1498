"""The distance of the person, and so the size, from depth images of the references."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

from cardbox_tracker.errors import InitializationError
from cardbox_tracker.estimation.initialization.config import (
    InitializationConfig,
    InitializationResult,
)
from cardbox_tracker.estimation.initialization.scale import (
    SCALE_REFERENCES,
    DepthReference,
    Measure,
    depth_scale,
    measured_at_scale,
)
from cardbox_tracker.ros.messages.conversions import stamp_ns
from cardbox_tracker.ros.nodes.depth_input import DepthInput
from cardbox_tracker.ros.nodes.reference_capture import ONE_POSTURE_NS, ReferenceCapture
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.depth_image import DepthImage, median_depth

# A few depth images of a posture are enough, and each takes much memory.
_KEPT = 10


class DepthDistance:
    """Keeps the depth of the reference postures in the view of the measuring camera."""

    def __init__(
        self,
        node: CardboxNode,
        topic: str,
        references: ReferenceCapture,
        camera: Callable[[], Camera | None],
    ) -> None:
        """Subscribe with ``node``, the initializer, to depth images on ``topic``.

        ``camera`` returns the camera of the silhouettes in ``references``, or None until it is
        known.
        """
        self._topic, self._references, self._camera = node.resolve(topic), references, camera
        self._recent: deque[tuple[int, DepthImage]] = deque(maxlen=_KEPT)
        self._captured: dict[str, DepthImage] = {}
        self._input = DepthInput(node, topic, self._add)

    def _add(self, message: Any, _: int) -> None:
        if (camera := self._camera()) is not None:
            depth_m = self._input.seen_by(camera, message)
            self._recent.append((stamp_ns(message.header.stamp), depth_m))

    def check(self) -> None:
        """Check before the reference postures that a measurement will be possible.

        Raises:
            InitializationError: no depth image was received.
        """
        if not self._recent:
            raise InitializationError(
                f"no depth image was received yet on {self._topic}, so the person's distance "
                "cannot be measured; start its publisher, or give person_distance_m and set "
                "measure_distance to false"
            )

    def capture(self, name: str, frames: int, now_ns: int | None) -> None:
        """Keep the depth of the reference ``name``, if it is needed.

        Args:
            name: name of the reference.
            frames: largest number of depth images to combine.
            now_ns: stamp of the camera's latest silhouette.

        Raises:
            InitializationError: no depth image has the time of the silhouettes.
        """
        if name not in SCALE_REFERENCES or now_ns is None:
            return
        alike = [
            depth_m
            for at_ns, depth_m in list(self._recent)[-frames:]
            if abs(at_ns - now_ns) <= ONE_POSTURE_NS and depth_m.shape == self._recent[-1][1].shape
        ]
        if not alike:
            raise InitializationError(
                f"reference '{name}': no depth image has come on {self._topic} at the time of the "
                "silhouettes; is the depth camera running, with stamps of the same clock?"
            )
        self._captured[name] = median_depth(alike)

    def measure(self, measure: Measure, config: InitializationConfig) -> InitializationResult:
        """Measure a person, and the distance with the depth images.

        Args:
            measure: measurement with the camera at a given distance.
            config: settings; the search begins at their distance.

        Raises:
            InitializationError: ``measure`` failed, or the depth images do not fit the person.
        """
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
