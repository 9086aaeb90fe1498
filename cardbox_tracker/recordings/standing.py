"""Pitch and roll of a recording's camera, from a person who stands upright in it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.landmarks import LANDMARKS
from cardbox_tracker.detectors.pose_network import Detection
from cardbox_tracker.measuring.standing_camera import StandingCamera, middles, standing_camera
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.recordings.detector_silhouettes import DetectorSilhouetteSource
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.open_images import open_images
from cardbox_tracker.recordings.silhouettes import TimeSpan

# Further images of one posture add no information.
_MOST_IMAGES = 30


class Standing(NamedTuple):
    """A camera, and the span in which the person stood upright before it."""

    camera: StandingCamera
    span: TimeSpan


def camera_of_standing(
    path: Path,
    detector: Detector,
    span: TimeSpan,
    camera: GivenCamera | None = None,
    name: str | None = None,
    until_s: float = 0.0,
) -> Standing | None:
    """Return pitch and roll of the camera; None if no standing person is found.

    Args:
        path: a recording as :func:`open_images` takes it.
        detector: the installed detector.
        span: span in which the person stands upright.
        camera: properties of the camera that the recording does not have.
        name: namespace of the camera; without it, the recording has only one.
        until_s: if nobody stands upright in ``span``, the spans of the same length that follow up
            to this time are searched, too, seconds from the start.

    Raises:
        BagError: the recording cannot be read.
        CameraError: the camera is not calibrated.
        CardboxError: the networks cannot be loaded.
    """
    with open_images(path, camera) as images:
        source = DetectorSilhouetteSource(images, detector._replace(people=0), name)
        detections = source.detections(span.start_s, max(span.end_s, until_s))
        timed = ((prepared.time_s, (*found, None)[0]) for prepared, found in detections)
        for searched, people in _spans(timed, span):
            # Somebody who comes into view is seen in a part of the span only.
            there = [person for person in people if person is not None]
            is_first = searched == span
            if there and (is_first or len(there) == len(people)):
                found = standing_camera(middles([_points(one) for one in there]), source.camera)
                if found is not None:
                    return Standing(found, searched)
    return None


def _points(person: Detection) -> tuple[dict[str, FloatArray], dict[str, float]]:
    points = dict(zip(LANDMARKS, person.points_px, strict=True))
    return points, dict(zip(LANDMARKS, person.scores.tolist(), strict=True))


def _spans(
    detections: Iterable[tuple[float, Detection | None]], first: TimeSpan
) -> Iterator[tuple[TimeSpan, list[Detection | None]]]:
    """Yield spans of the length of ``first`` one after the other, each with its detections."""
    span, people = first, list[Detection | None]()
    for time_s, person in detections:
        while time_s > span.end_s:
            yield span, people
            span, people = TimeSpan(span.end_s, 2 * span.end_s - span.start_s), []
        if sum(one is not None for one in people) < _MOST_IMAGES:
            people.append(person)
    yield span, people
