"""The camera of a recording, from the people and the room in all of it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.detectors.landmarks import image_points
from cardbox_tracker.measuring.scene_camera import FoundCamera, Picture, scene_camera
from cardbox_tracker.recordings.detector_silhouettes import DetectorSilhouetteSource
from cardbox_tracker.recordings.given_camera import GivenCamera
from cardbox_tracker.recordings.open_images import open_images

# Least time between two images that are searched, s, and most of them; those whose edges count.
_PERIOD_S, _MOST_IMAGES, _MOST_PICTURES = 0.1, 150, 12


def recorded_camera(
    path: Path,
    detector: Detector,
    camera: GivenCamera | None = None,
    name: str | None = None,
    stature_m: float | None = None,
    pitch_rad: float | None = None,
    start_s: float = 0.0,
    end_s: float = math.inf,
) -> FoundCamera:
    """Return the camera as one person and the room show it between two times.

    Args:
        path: a recording as :func:`open_images` takes it.
        detector: the installed detector.
        camera: properties of the camera that the recording does not have; its images are turned
            back by a roll that is given.
        name: namespace of the camera; without it, the recording has only one.
        stature_m: of the person; None if it is not known.
        pitch_rad: downward pitch that is given.
        start_s: seconds from the start of the recording.
        end_s: the same.

    Raises:
        BagError: the recording cannot be read.
        CameraError: the camera is not calibrated.
        CardboxError: the networks cannot be loaded.
    """
    sights, pictures = list[tuple[float, ImagePoints]](), list[Picture]()
    with open_images(path, camera) as images:
        source = DetectorSilhouetteSource(images, detector._replace(people=0), name)
        length_s = max(0.0, min(end_s, source.duration_s) - start_s)
        period_s = max(_PERIOD_S, length_s / _MOST_IMAGES)
        next_s = start_s
        for prepared, found in source.detections(start_s, end_s, period_s):
            sights += [(prepared.time_s, image_points(one)) for one in found[:1]]
            if prepared.time_s >= next_s:
                next_s += length_s / _MOST_PICTURES
                seen = np.asarray(source.undistorted(prepared.recorded), np.uint8)
                pictures.append((prepared.time_s, seen))
    roll_rad = None if camera is None or camera.roll_rad is None else 0.0
    return scene_camera([sights], pictures, source.camera, [stature_m], pitch_rad, roll_rad)
