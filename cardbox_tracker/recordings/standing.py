"""Pitch and roll of a recording's camera, from a person who stands upright in it."""

from __future__ import annotations

from pathlib import Path

from cardbox_tracker.detection.landmarks import LANDMARKS
from cardbox_tracker.estimation.standing_camera import StandingCamera, middles, standing_camera
from cardbox_tracker.recordings.detector import Detector
from cardbox_tracker.recordings.detector_silhouettes import DetectorSilhouetteSource
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.open_images import open_images
from cardbox_tracker.recordings.silhouettes import TimeSpan

# Further images of one posture add no information.
_MOST_IMAGES = 30


def camera_of_standing(
    path: Path,
    detector: Detector,
    span: TimeSpan,
    camera: GivenCamera | None = None,
    name: str | None = None,
) -> StandingCamera | None:
    """Return pitch and roll of the camera; None if no standing person is found in the span.

    Args:
        path: a recording as :func:`open_images` takes it.
        detector: the installed detector.
        span: span in which the person stands upright.
        camera: properties of the camera that the recording does not have.
        name: namespace of the camera; without it, the recording has only one.

    Raises:
        BagError: the recording cannot be read.
        CameraError: the camera is not calibrated.
        CardboxError: the networks cannot be loaded.
    """
    found = []
    with open_images(path, camera) as images:
        source = DetectorSilhouetteSource(images, detector, name)
        for _, person in source.detections(*span):
            if person is not None:
                points = dict(zip(LANDMARKS, person.points_px, strict=True))
                scores = dict(zip(LANDMARKS, person.scores.tolist(), strict=True))
                found.append((points, scores))
            if len(found) == _MOST_IMAGES:
                break
        return standing_camera(middles(found), source.camera)
