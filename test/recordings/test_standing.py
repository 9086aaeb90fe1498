"""The span in which somebody stands upright is found, also if they come later."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.model_files import ModelFiles
from cardbox_tracker.detectors.pose_network import LANDMARKS, Detection
from cardbox_tracker.measuring.standing_camera import LEVELS, PITCH_PRIOR, USUAL_PITCH
from cardbox_tracker.recordings import standing
from cardbox_tracker.recordings.silhouettes import TimeSpan

CAMERA = Camera(640, 480, 500.0, 500.0, 319.5, 239.5)
PITCH_RAD = np.radians(10.0)
FIRST = TimeSpan(2.0, 3.0)


def standing_person() -> Detection:
    """Return the points of a person of 1.75 m who stands 3 m before the camera, 1.4 m high."""
    points = np.full((len(LANDMARKS), 2), 100.0)
    for level, share in LEVELS.items():
        below_m = 1.4 - share.height * 1.75
        depth_m = 3.0 - share.forward * 1.75
        c, s = np.cos(PITCH_RAD), np.sin(PITCH_RAD)
        v = CAMERA.cy + CAMERA.fy * (below_m * c - depth_m * s) / (below_m * s + depth_m * c)
        for name in LANDMARKS:
            if name.removeprefix("left_").removeprefix("right_") == level:
                points[LANDMARKS.index(name)] = (330.0 if "left" in name else 309.0, v)
    points[LANDMARKS.index("nose")][0] = 319.5
    scores = np.ones(len(LANDMARKS))
    return Detection(points, scores, *(None for _ in Detection._fields[2:]))  # type: ignore[arg-type]


def sitting_person() -> Detection:
    """Return the points of somebody whose joints are at one height, which no fit explains."""
    person = standing_person()
    return person._replace(
        points_px=np.column_stack([person.points_px[:, 0], [240.0] * len(LANDMARKS)])
    )


@pytest.fixture
def pictures() -> list[np.ndarray]:
    """Return what the camera sees first; grey images follow."""
    return []


@pytest.fixture
def seen(
    monkeypatch: pytest.MonkeyPatch, pictures: list[np.ndarray]
) -> dict[float, Detection | None]:
    """Return the people by time, 10 images a second for 20 s; at first there is nobody."""
    people: dict[float, Detection | None] = {number / 10: None for number in range(200)}

    class Source:
        camera = CAMERA

        def __init__(self, *_: Any) -> None:
            pass

        def detections(self, start_s: float, end_s: float, _: float) -> Iterator[Any]:
            for time_s, person in people.items():
                if start_s <= time_s <= end_s:
                    found = [] if person is None else [person]
                    yield SimpleNamespace(time_s=time_s, recorded=None), found

        def undistorted(self, _: Any) -> np.ndarray:
            return pictures.pop() if pictures else np.full((480, 640), 128, np.uint8)

    class Opened:
        def __enter__(self) -> None:
            pass

        def __exit__(self, *_: Any) -> None:
            pass

    monkeypatch.setattr(standing, "open_images", lambda *_: Opened())
    monkeypatch.setattr(standing, "DetectorSilhouetteSource", Source)
    return people


def edges_seen(pitch_rad: float) -> np.ndarray:
    """Return the image (H, W) of doors, 4 m before a camera that looks down."""
    image = np.full((480, 640), 90, np.uint8)
    view = CAMERA.with_pitch(pitch_rad)
    for left_m in (-1.6, -0.3, 1.1):
        corners = [
            (-4.0, left_m + across, up) for across, up in ((0, 2), (0.5, 2), (0.5, -3), (0, -3))
        ]
        px = view.project(view.reference_to_optical(np.array(corners)))
        cv2.fillPoly(image, [np.rint(px * 16).astype(np.int32)], 200, cv2.LINE_AA, 4)
    return image


def find(until_s: float) -> standing.Placed:
    detector = Detector(ModelFiles(Path(), Path()))
    return standing.placed_camera(Path("film"), detector, FIRST, until_s=until_s)


def test_somebody_who_stands_at_once_is_found_there(seen: dict[float, Detection | None]) -> None:
    seen.update(dict.fromkeys((2.4, 2.5, 9.0), standing_person()))
    for until_s in (0.0, 30.0):
        found = find(until_s)
        assert found.span == FIRST
        assert found.tilt.pitch_rad == pytest.approx(PITCH_RAD, abs=0.06)
        assert found.standing is not None
        assert found.standing.distance * 1.75 == pytest.approx(3.0, rel=0.1)


@pytest.mark.parametrize(("before", "from_s"), [(None, 7.6), (sitting_person(), 8.05)])
def test_somebody_who_comes_later_is_found_once_they_are_there_for_a_span(
    seen: dict[float, Detection | None], before: Detection | None, from_s: float
) -> None:
    times = list(seen)
    seen.update({time_s: before for time_s in times if time_s < from_s})
    seen.update({time_s: standing_person() for time_s in times if time_s >= from_s})
    found = find(30.0)
    assert found.span == TimeSpan(8.0, 9.0)
    assert found.tilt.pitch_rad == pytest.approx(PITCH_RAD, abs=0.06)
    for until_s in (0.0, 7.0):
        nobody = find(until_s)
        assert nobody.span is None and nobody.tilt.pitch_rad == pytest.approx(USUAL_PITCH, abs=0.01)
        assert nobody.tilt.pitch_stddev_rad == pytest.approx(PITCH_PRIOR, rel=0.1)


def test_the_edges_of_the_room_show_the_pitch_without_anybody(
    seen: dict[float, Detection | None], pictures: list[np.ndarray]
) -> None:
    pictures.extend([edges_seen(np.radians(24.0))] * 5)
    found = find(0.0)
    assert found.span is None and found.tilt.has_edges
    assert np.degrees(found.tilt.pitch_rad) == pytest.approx(24.0, abs=2.0)
