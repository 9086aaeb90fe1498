"""Silhouettes of a recording without an empty scene: of depth, a detector, or a person in view."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.depth_image import DepthImage, at_size, depth_from_image
from cardbox_tracker.camera.pairing import TOLERANCE_NS, side_by_side
from cardbox_tracker.common.errors import BagError, CardboxError
from cardbox_tracker.common.health import WATCHES
from cardbox_tracker.detectors.detector import Detector, KeptDetections
from cardbox_tracker.detectors.point_table import PointTable
from cardbox_tracker.detectors.pose_network import silhouette_of
from cardbox_tracker.person.model import PLACEMENT
from cardbox_tracker.recordings.bag_reader import IMAGE_TYPES, BagReader
from cardbox_tracker.recordings.open_images import ImageRecording
from cardbox_tracker.recordings.silhouettes import PreparedImage, RecordedFrame, SilhouetteSource
from cardbox_tracker.segmentation.learning import Learning, PersonInViewLearning
from cardbox_tracker.segmentation.silhouettes import nearest_m, silhouette_within


def depth_images(
    path: str | os.PathLike[str], topic: str, camera: Camera
) -> Iterator[tuple[int, DepthImage]]:
    """Yield stamp, ns, and depth (H, W), metres, of each depth image, at the size of ``camera``.

    Raises BagError if the topic is missing or has other messages, EncodingError if one is no depth.
    """
    with BagReader(path) as bag:
        kind = bag.topics.get(topic, IMAGE_TYPES[0])
        if kind not in IMAGE_TYPES:
            raise BagError(
                f"{topic} has messages of {kind}; expected depth images: "
                f"{' or '.join(IMAGE_TYPES)} (compressedDepth)"
            )
        for stamp_ns, _, image in bag.stamped(topic):
            yield stamp_ns, at_size(depth_from_image(image), camera.width, camera.height)


class Within(NamedTuple):
    """Segmentation by depth: pixels nearer than a limit belong to the person."""

    topic: str  #: topic of depth images with the camera's field of view
    metres: float  #: the limit along the optical axis


class DepthSilhouetteSource(SilhouetteSource):
    """One camera of a recording whose silhouettes are cut out by depth images."""

    def __init__(
        self,
        bag: ImageRecording,
        within: Within,
        camera: str | None = None,
        points: Detector | PointTable | None = None,
    ) -> None:
        """Prepare to read; see :class:`SilhouetteSource`, and CardboxError for a wrong limit."""
        least_m, most_m, *_ = PLACEMENT["distance_m"]
        if not least_m <= within.metres <= most_m:
            raise CardboxError(
                f"the limit of the depth is {within.metres:g} m; expected {least_m:g} to "
                f"{most_m:g} m, between the person and the wall"
            )
        self._open(bag, camera)
        self._find_points(points, camera)
        self._within, self.depth_topic = within, within.topic
        self._without, self._nearest_m, self._is_near = 0, math.inf, False
        self._mostly_near = self._with_depth = 0

    def frames(self, start_s: float = 0.0, end_s: float = float("inf")) -> Iterator[RecordedFrame]:
        """Yield every image from ``start_s`` to ``end_s`` that has a depth image, in order."""
        depths = depth_images(self._bag.path, self._within.topic, self.camera)
        streams: list[Iterator[Any]] = [self.images(end_s), depths]
        self._without = self._mostly_near = self._with_depth = 0
        self._start_points(start_s, end_s)
        for seen, measured in side_by_side(streams, lambda item: int(item[0]), TOLERANCE_NS):
            if seen is None:
                continue
            if seen.time_s > end_s:
                break
            if seen.time_s < start_s:
                continue
            if measured is None:
                self._without += 1
                continue
            silhouette = silhouette_within(measured[1], self._within.metres)
            self._with_depth += 1
            self._mostly_near += WATCHES["near"].is_beyond(float(np.mean(silhouette > 0)))
            self._is_near = self._is_near or bool(silhouette.any())
            if not self._is_near:
                self._nearest_m = min(self._nearest_m, nearest_m(measured[1]))
            yield self._frame(self._looked_at(seen), silhouette, measured[1])
        self._end_points()

    @property
    def remarks(self) -> list[str]:
        """Warnings about the images read so far."""
        found, topic = super().remarks, self._within.topic
        if self._without:
            found.append(
                f"{self._without} images have no depth image of the same time on {topic} and are "
                "skipped"
            )
        if 2 * self._mostly_near > self._with_depth:
            found.append(
                f"most of {topic} is nearer than --within {self._within.metres:g} m in "
                f"{self._mostly_near} images: choose it between the person and the wall, and "
                "correct the unit if 16UC1 is not in millimetres or 32FC1 not in metres"
            )
        if self._is_near:
            return found
        if self._nearest_m < math.inf:
            found.append(
                f"nothing on {topic} is nearer than --within {self._within.metres:g} m: the "
                f"nearest depths are {self._nearest_m:.1f} m, if 16UC1 is in millimetres and 32FC1 "
                "in metres"
            )
        elif self._used > self._without:
            found.append(f"{topic} has no depth: all values are 0 or below, or not finite")
        return found


class DetectorSilhouetteSource(SilhouetteSource):
    """One camera of a recording whose silhouettes are the masks of a person detector."""

    def __init__(
        self,
        bag: ImageRecording,
        detector: Detector,
        camera: str | None = None,
        points: Detector | PointTable | None = None,
    ) -> None:
        """Load the networks and prepare to read; see :class:`SilhouetteSource`.

        A detector as ``points`` finds points and mask at once. Raises CardboxError if the networks
        cannot be loaded.
        """
        self._open(bag, camera)
        self._find_points(detector if isinstance(points, Detector) else points, camera)
        self._detector = self._detector or KeptDetections(detector.start())
        self._finds_people = detector.people > 0

    def _silhouette(self, prepared: PreparedImage) -> NDArray[np.uint8]:
        """Return the masks of all whom the detector finds."""
        return silhouette_of(prepared.found, prepared.image.shape)


# A standing person sways too slowly to be seen in images at a higher rate than the live nodes'.
_LEARNING_HZ = 15.0


@dataclass(frozen=True)
class PersonInView:
    """Segmentation against the scene around the person, learned from the whole recording."""


class PersonInViewSource(SilhouetteSource):
    """One camera of a recording without an empty scene, whose person steps aside at some time."""

    def __init__(
        self,
        bag: ImageRecording,
        camera: str | None = None,
        points: Detector | PointTable | None = None,
    ) -> None:
        """Learn the scene from the first images that show all of it, each part at its own time.

        See :class:`SilhouetteSource`. Raises CardboxError if the person hides a part of the scene
        in all images.
        """
        self._open(bag, camera, learning=PersonInViewLearning)
        self._find_points(points, camera)
        learning = self._pipeline.learning
        every = max(1, round(1e9 / (_LEARNING_HZ * self.period_ns())))
        for number, prepared in enumerate(self.images()):
            if number % every == 0:
                learning.add(prepared.image)
            if learning.has_enough():
                break
        if not learning.has_enough():
            raise CardboxError(self._missing(learning))
        self._pipeline.finish_learning()

    def _missing(self, learning: Learning) -> str:
        """Return which part of the scene was not seen, and the remedy."""
        needed_s = learning.images / _LEARNING_HZ
        if learning.count < learning.images:
            what = f"{self.path} has less than {needed_s:.0f} s"
        else:
            hidden = learning.values()["hidden by the person (% of the image)"]
            what = f"the person hides {hidden} % of {self.path} all the time"
        return (
            f"{what}, so the scene behind them is unknown. Film someone who steps aside by twice "
            f"their width for {2 * needed_s:.0f} s, or leaves the image; for this recording give "
            "--detector mediapipe, which needs no scene, or --background T0:T1 if nobody is in "
            "view for a while"
        )
