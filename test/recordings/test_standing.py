"""The span in which somebody stands upright is found, also if they come later."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.landmarks import LANDMARKS
from cardbox_tracker.detectors.model_files import ModelFiles
from cardbox_tracker.detectors.pose_network import Detection
from cardbox_tracker.measuring.standing_camera import LEVELS
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
        for side, u in (("left", 330.0), ("right", 309.0)):
            points[LANDMARKS.index(f"{side}_{level}")] = (u, v)
    scores = np.ones(len(LANDMARKS))
    return Detection(points, scores, *(None for _ in Detection._fields[2:]))  # type: ignore[arg-type]


def sitting_person() -> Detection:
    """Return the points of somebody whose joints are at one height, which no fit explains."""
    person = standing_person()
    return person._replace(
        points_px=np.column_stack([person.points_px[:, 0], [240.0] * len(LANDMARKS)])
    )


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> dict[float, Detection | None]:
    """Return the people by time, 10 images a second for 20 s; at first there is nobody."""
    people: dict[float, Detection | None] = {number / 10: None for number in range(200)}

    class Source:
        camera = CAMERA

        def __init__(self, *_: Any) -> None:
            pass

        def detections(self, start_s: float, end_s: float) -> Iterator[Any]:
            for time_s, person in people.items():
                if start_s <= time_s <= end_s:
                    yield SimpleNamespace(time_s=time_s), [] if person is None else [person]

    class Opened:
        def __enter__(self) -> None:
            pass

        def __exit__(self, *_: Any) -> None:
            pass

    monkeypatch.setattr(standing, "open_images", lambda *_: Opened())
    monkeypatch.setattr(standing, "DetectorSilhouetteSource", Source)
    return people


def find(until_s: float) -> standing.Standing | None:
    detector = Detector(ModelFiles(Path(), Path()))
    return standing.camera_of_standing(Path("film"), detector, FIRST, until_s=until_s)


def test_somebody_who_stands_at_once_is_found_there(seen: dict[float, Detection | None]) -> None:
    seen.update(dict.fromkeys((2.4, 2.5, 9.0), standing_person()))
    for until_s in (0.0, 30.0):
        found = find(until_s)
        assert found is not None and found.span == FIRST
        assert found.camera.pitch_rad == pytest.approx(PITCH_RAD, abs=0.06)


@pytest.mark.parametrize(("before", "from_s"), [(None, 7.6), (sitting_person(), 8.05)])
def test_somebody_who_comes_later_is_found_once_they_are_there_for_a_span(
    seen: dict[float, Detection | None], before: Detection | None, from_s: float
) -> None:
    times = list(seen)
    seen.update({time_s: before for time_s in times if time_s < from_s})
    seen.update({time_s: standing_person() for time_s in times if time_s >= from_s})
    found = find(30.0)
    assert found is not None and found.span == TimeSpan(8.0, 9.0)
    assert found.camera.pitch_rad == pytest.approx(PITCH_RAD, abs=0.06)
    assert find(0.0) is None
    assert find(7.0) is None
