"""Whose points are whose in a recording, before its scene is measured."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.figure import figure_of_points
from cardbox_tracker.detectors.image_points import POINT_NAMES, ImagePoints
from cardbox_tracker.detectors.person_choice import PersonChoice
from cardbox_tracker.measuring.scene_watch import Spread
from cardbox_tracker.recordings.films import Person, assign
from cardbox_tracker.recordings.measured_scene import frames_of, watch
from cardbox_tracker.recordings.recording import FrameSet
from cardbox_tracker.recordings.silhouettes import RecordedFrame

RED, BLUE = (40, 40, 220), (220, 60, 40)
SHAPE = 240, 320
# Places of joints beside the middle of the shoulders, px.
BESIDE = {"shoulder": (18, 0), "elbow": (24, 30), "wrist": (24, 55), "hip": (12, 60)}


def standing(column: float) -> ImagePoints:
    px = np.full((len(POINT_NAMES), 2), (column, 60.0))
    for number, name in enumerate(POINT_NAMES):
        side, _, joint = name.partition("_")
        if joint in BESIDE:
            aside, down = BESIDE[joint]
            px[number] += (aside if side == "left" else -aside, down)
    return ImagePoints(px, np.ones(len(POINT_NAMES)))


def frame(*people: tuple[float, tuple[int, int, int]], found: int) -> RecordedFrame:
    """Return an image of people at columns in a colour, of whom the first ``found`` are found."""
    image = np.full((*SHAPE, 3), 128, np.uint8)
    for column, colour in reversed(people):
        cv2.rectangle(image, (round(column) - 20, 60), (round(column) + 20, 120), colour, -1)
    points = tuple(standing(column) for column, _ in people[:found])
    silhouette = np.full(SHAPE, 255, np.uint8)
    return RecordedFrame(0, 0.0, image, silhouette, people=points)


@pytest.mark.parametrize("step", [6.0, -6.0])
def test_who_walks_past_another_is_not_mixed_with_them(step: float) -> None:
    """While one hides the other, the detector finds only the former, at the other's place."""
    people: list[Person] = []
    walked = [160.0 + step * (k - 20) for k in range(41)]
    for k, column in enumerate(walked):
        both = abs(column - 160.0) > 25.0
        assign(people, frame((column, RED), (160.0, BLUE), found=1 + both), k / 15)
    columns = [
        [float(figure_of_points(points).middle_px[0]) for _, points in person.seen]
        for person in people
    ]
    assert len(columns) == 2
    assert columns[0] == pytest.approx(walked)
    assert set(columns[1]) == {160.0}


def test_who_comes_after_two_seconds_is_a_new_person() -> None:
    people: list[Person] = []
    for time_s in (0.0, 0.1, 2.1):
        assign(people, frame((160.0, RED), found=1), time_s)
    assert [[time_s for time_s, _ in person.seen] for person in people] == [[0.0, 0.1], [2.1]]


def test_references_show_the_silhouette_of_whom_is_chosen_alone() -> None:
    camera = Camera(SHAPE[1], SHAPE[0], 260.0, 260.0, 159.5, 119.5)
    frames = [
        frame((90.0, RED), (220.0, BLUE), found=1 + (number > 3))._replace(
            stamp_ns=number * 33_333_333, time_s=number / 30
        )
        for number in range(14)
    ]
    frames = [
        one._replace(silhouette=(one.image != 128).any(axis=2) * np.uint8(255)) for one in frames
    ]
    chosen = frames_of(PersonChoice("right"), frames, camera)
    # Who comes later is known after three images.
    assert [one.stamp_ns for one in chosen] == [one.stamp_ns for one in frames[6:]]
    for one in chosen:
        columns = np.nonzero(one.silhouette.any(axis=0))[0]
        assert (columns.min(), columns.max()) == (200, 240)
    assert frames_of(PersonChoice("left"), [], camera) == []


def test_times_without_an_image_of_the_first_camera_show_no_scene() -> None:
    """Pictures have the size of the recording, the black ones of such times a smaller one."""
    camera = Camera(SHAPE[1], SHAPE[0], 260.0, 260.0, 159.5, 119.5)
    seen = frame((160.0, RED), found=1)
    sets = [
        FrameSet(i, i / 15, (seen if i else None, seen), seen, picture=lambda: seen.image)
        for i in range(4)
    ]
    recording: Any = SimpleNamespace(
        sources=[], first=SimpleNamespace(camera=camera), others=[], frames=lambda *_: sets
    )
    assert [time_s for time_s, _ in watch(recording).pictures] == [i / 15 for i in (1, 2, 3)]


def test_items_that_are_left_out_do_not_count_where_one_is_due() -> None:
    spread, made = Spread[int](2), list[int]()
    for item in (0, 1, 2, 3, 4, 0, 5):

        def make(item: int = item) -> int | None:
            made.append(item)
            return item or None

        spread.add(make)
    # After 1, 2 and 3, every second one is due, and 4 is the third.
    assert made == [0, 1, 2, 3, 0, 5]
    assert spread.items == [1, 5]
