"""The camera of a scene from all that shows it: people, edges of the room, and what is given."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.measuring.camera_tilt import camera_tilt
from cardbox_tracker.measuring.people_camera import (
    PITCH_PRIOR,
    USUAL_PITCH,
    Sightings,
    people_camera,
)
from cardbox_tracker.measuring.room_edges import edge_likelihoods
from cardbox_tracker.measuring.scene import FOUND, GIVEN, USUAL, SceneCamera, Value
from cardbox_tracker.measuring.standing_camera import StandingCamera

# A given pitch contradicts the one found from so many standard deviations and so many rad on.
_SURE, _LEAST = 2.5, math.radians(6.0)


class FoundCamera(NamedTuple):
    """A camera, and what it was found from.

    Attributes:
        camera: its numbers.
        sources: what shows pitch and roll, in words.
        distances_m: level distance of each person when they are first seen, m.
        contradiction: what contradicts a given pitch; empty if nothing does.
    """

    camera: SceneCamera
    sources: tuple[str, ...] = ()
    distances_m: tuple[float, ...] = ()
    contradiction: str = ""


def scene_camera(
    people: Sequence[Sightings],
    statures_m: Sequence[float],
    pictures: Sequence[NDArray[np.uint8]],
    camera: Camera,
    pitch: tuple[float, float] | None = None,
) -> FoundCamera:
    """Return the camera of a scene.

    Args:
        people: times and points of each person.
        statures_m: stature of each person.
        pictures: undistorted images.
        camera: intrinsics of the points with their deviation.
        pitch: given mean and standard deviation, rad; None if it is to be found.
    """
    shown = people_camera(people, statures_m, camera, pitch or (USUAL_PITCH, PITCH_PRIOR))
    standing = None
    sources = []
    if shown is not None:
        stddevs = np.sqrt(np.diag(shown.covariance))
        values = shown.values[0], stddevs[0], shown.values[1], stddevs[1], shown.distances_m[0]
        standing = StandingCamera(*map(float, values))
        sources.append("the people who stand and walk")
    tilt = camera_tilt(edge_likelihoods(list(pictures), camera), standing)
    if tilt.has_edges:
        sources.insert(0, "the vertical edges of the room")
    fov = 2 * math.atan(camera.width / 2 / camera.fx)
    origin = FOUND if sources else USUAL
    found = Value(tilt.pitch_rad, tilt.pitch_stddev_rad, origin)
    contradiction = ""
    if pitch is not None:
        away = abs(tilt.pitch_rad - pitch[0])
        if away > max(_LEAST, _SURE * math.hypot(tilt.pitch_stddev_rad, pitch[1])):
            contradiction = (
                f"{math.degrees(tilt.pitch_rad):.0f} degrees down (standard deviation "
                f"{math.degrees(tilt.pitch_stddev_rad):.0f})"
            )
        found = Value(*pitch, GIVEN)
    height = None
    if shown is not None and shown.shows_floor:
        height = Value(float(shown.values[2]), float(np.sqrt(shown.covariance[2, 2])))
    lens = Value(fov, fov * camera.focal_stddev, USUAL if camera.focal_stddev >= 0.2 else GIVEN)
    roll = Value(tilt.roll_rad, math.radians(1.0), origin)
    distances_m = () if shown is None else shown.distances_m
    return FoundCamera(
        SceneCamera(lens, found, roll, height), tuple(sources), distances_m, contradiction
    )
