"""Pitch and roll of a recording's camera, from the room and a person who stands upright in it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.pose_network import Detection
from cardbox_tracker.measuring.camera_tilt import Tilt, camera_tilt
from cardbox_tracker.measuring.room_edges import edge_likelihoods
from cardbox_tracker.measuring.standing_camera import StandingCamera, middles, standing_camera
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.recordings.detector_silhouettes import DetectorSilhouetteSource
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.open_images import open_images
from cardbox_tracker.recordings.silhouettes import TimeSpan

# Time between two images that are searched, s, since further images of one posture add nothing.
_PERIOD_S = 0.1
# Spans from the first one with a standing person on, of which those with one are averaged.
_MOST_SPANS = 5
# Images in which edges are sought, and the time between two of them, s.
_MOST_PICTURES, _PICTURE_S = 10, 0.3
# Standard deviation of a pitch that is given, rad.
_GIVEN = np.radians(0.5)


class Placed(NamedTuple):
    """A camera, and what the person shows of it.

    Attributes:
        tilt: pitch and roll of the camera.
        span: first span in which the person stood upright; None without one.
        standing: the person there, seen with the pitch of ``tilt``.
    """

    tilt: Tilt
    span: TimeSpan | None = None
    standing: StandingCamera | None = None


def placed_camera(
    path: Path,
    detector: Detector,
    span: TimeSpan,
    camera: GivenCamera | None = None,
    name: str | None = None,
    until_s: float = 0.0,
    pitch_rad: float | None = None,
) -> Placed:
    """Return pitch and roll of the camera from the room and from a person who stands upright.

    Args:
        path: a recording as :func:`open_images` takes it.
        detector: the installed detector.
        span: span in which the person stands upright.
        camera: properties of the camera that the recording does not have.
        name: namespace of the camera; without it, the recording has only one.
        until_s: if nobody stands upright in ``span``, the spans of the same length that follow up
            to this time are searched, too, seconds from the start.
        pitch_rad: the pitch with which ``Placed.standing`` is seen; None for the one found.

    Raises:
        BagError: the recording cannot be read.
        CameraError: the camera is not calibrated.
        CardboxError: the networks cannot be loaded.
    """
    pictures: list[NDArray[np.uint8]] = []
    upright: list[tuple[TimeSpan, dict[str, FloatArray], StandingCamera]] = []
    spans = 0
    with open_images(path, camera) as images:
        source = DetectorSilhouetteSource(images, detector._replace(people=0), name)

        def seen() -> Iterator[tuple[float, Detection | None]]:
            next_s = span.start_s
            times = span.start_s, max(span.end_s, until_s), _PERIOD_S
            for prepared, found in source.detections(*times):
                if prepared.time_s >= next_s and len(pictures) < _MOST_PICTURES:
                    pictures.append(source.undistorted(prepared.recorded))
                    next_s = prepared.time_s + _PICTURE_S
                yield prepared.time_s, (*found, None)[0]

        for searched, people in _spans(seen(), span):
            # Somebody who comes into view is seen in a part of the span only.
            there = [person for person in people if person is not None]
            if there and (searched == span or len(there) == len(people)):
                points = middles(there)
                found = standing_camera(points, source.camera)
                if found is not None:
                    upright.append((searched, points, found))
            spans += bool(upright)
            if spans == _MOST_SPANS:
                break
    likelihoods = edge_likelihoods(pictures, source.camera)
    if not upright:
        return Placed(camera_tilt(likelihoods, None))
    mean = StandingCamera(*np.mean([found for *_, found in upright], axis=0).tolist())
    tilt = camera_tilt(likelihoods, mean)
    first, points, found = upright[0]
    prior = (tilt.pitch_rad, tilt.pitch_stddev_rad) if pitch_rad is None else (pitch_rad, _GIVEN)
    return Placed(tilt, first, standing_camera(points, source.camera, prior) or found)


def _spans(
    detections: Iterable[tuple[float, Detection | None]], first: TimeSpan
) -> Iterator[tuple[TimeSpan, list[Detection | None]]]:
    """Yield spans of the length of ``first`` one after the other, each with its detections."""
    span, people = first, list[Detection | None]()
    for time_s, person in detections:
        while time_s > span.end_s:
            yield span, people
            span, people = TimeSpan(span.end_s, 2 * span.end_s - span.start_s), []
        people.append(person)
    yield span, people
