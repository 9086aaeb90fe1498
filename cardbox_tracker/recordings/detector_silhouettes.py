"""Silhouettes of a recording from the masks of a person detector, without an empty scene."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cardbox_tracker.camera.encodings import brightness_of
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.landmarks import image_points
from cardbox_tracker.detectors.point_table import PointTable
from cardbox_tracker.recordings.image_recording import ImageRecording
from cardbox_tracker.recordings.silhouettes import RecordedFrame, SilhouetteSource


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
        self._open(bag, bag.working_size, camera)
        self._find_points(None if isinstance(points, Detector) else points, camera)
        self._has_own_points = isinstance(points, Detector)
        self._has_points = points is not None
        self._detector = self._started(detector)
        self._finds_people = detector.people > 0

    def frames(self, start_s: float = 0.0, end_s: float = float("inf")) -> Iterator[RecordedFrame]:
        """Yield every image from ``start_s`` to ``end_s``, in order, with the person's mask.

        The detector starts anew at ``start_s``, so that a frame depends on the span alone.
        """
        self._start_points(start_s, end_s)
        for prepared in self._images_until(end_s, start_s):
            stamp_ns, time_s, image, recorded, _, found = prepared
            if time_s < start_s:
                continue
            silhouette = np.zeros(image.shape[:2], np.uint8)
            for one in found:
                silhouette |= one.silhouette()
            seen = brightness_of(image), silhouette, image
            frame = RecordedFrame(stamp_ns, time_s, *seen, recorded=recorded)
            if self._finds_people:
                own = tuple(image_points(one) for one in found)
                people = own if self._given is None else self._people(prepared)
                yield frame._replace(people=people)
            elif found and self._has_own_points:
                yield frame._replace(points=image_points(found[0]))
            else:
                yield frame._replace(points=self._points(prepared, silhouette))
        self._end_points()
