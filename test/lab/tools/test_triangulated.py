"""Two cameras beside OpenCV's triangulation, on points that are the truth or off by a known way."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.image_points import POINT_INDEX, POINT_NAMES, ImagePoints
from cardbox_tracker.person.skeleton import rotation_y
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.recordings.result_table import POINT_COLUMNS
from lab.tools.triangulated import HAND, keypoints_of, nearest, row_of, triangulated
from lab.tools.way_cases import Person

CAMERAS = Camera(320, 240, 300.0, 310.0, 160.0, 118.0), Camera(240, 320, 280.0, 280.0, 119.0, 161.0)
POSE = np.column_stack([rotation_y(np.array(0.6)), [-1.5, 0.1, 0.4]])
POINTS_M = np.random.default_rng(0).uniform(-0.5, 0.5, (len(POINT_NAMES), 3)) + np.array(
    [0.0, 0.0, 3.0]
)


def pixels(points_m: np.ndarray, camera: Camera) -> np.ndarray:
    focal, centre = [camera.fx, camera.fy], [camera.cx, camera.cy]
    return points_m[:, :2] / points_m[:, 2:] * focal + centre


def moved(points_m: np.ndarray) -> np.ndarray:
    return np.asarray(points_m @ POSE[:, :3].T + POSE[:, 3])


def test_points_of_both_cameras_become_the_points_in_space() -> None:
    seen = [pixels(POINTS_M, CAMERAS[0]), pixels(moved(POINTS_M), CAMERAS[1])]
    seen[1][4] = np.nan
    found = triangulated(seen, CAMERAS, POSE)
    assert np.isnan(found[4]).all()
    others = np.arange(len(POINTS_M)) != 4
    assert found[others] == pytest.approx(POINTS_M[others])


def test_a_hand_is_beyond_the_wrist_towards_the_knuckles() -> None:
    points_m = POINTS_M.copy()
    wrist = points_m[POINT_INDEX["left_wrist"]]
    points_m[POINT_INDEX["left_index"]] = wrist + np.array([0.03, 0.2, 0.0])
    points_m[POINT_INDEX["left_little_finger"]] = wrist + np.array([-0.03, 0.2, 0.0])
    found = keypoints_of(points_m, 2.0)
    assert found[2] == pytest.approx(wrist + np.array([0.0, 2.0 * HAND, 0.0]))
    assert found[4].tolist() == points_m[POINT_INDEX["right_elbow"]].tolist()


def test_who_is_found_counts_for_the_nearest_true_person() -> None:
    joints_m = keypoints_of(POINTS_M, 1.7)
    beside_m = joints_m + np.array([1.0, 0.0, 0.0])
    scores = np.ones(len(POINT_NAMES))
    him = ImagePoints(pixels(moved(POINTS_M), CAMERAS[1]), scores)
    like_him = ImagePoints(him.px + 3.0, scores)
    her = ImagePoints(pixels(moved(POINTS_M + np.array([1.1, 0.0, 0.0])), CAMERAS[1]), scores)
    nobody = ImagePoints(np.full_like(him.px, np.nan), np.zeros(len(POINT_NAMES)))
    for people in ([him, like_him, her, nobody], [nobody, her, like_him, him]):
        found = nearest(people, [joints_m, beside_m], CAMERAS[1], POSE)
        assert [one.tolist() for one in found] == [him.px.tolist(), her.px.tolist()]
    found = nearest([like_him], [beside_m, joints_m], CAMERAS[1], POSE)
    assert np.isnan(found[0]).all()
    assert found[1].tolist() == like_him.px.tolist()


def test_the_row_has_images_with_all_joints_of_both() -> None:
    true_m = keypoints_of(POINTS_M, 1.7)
    hand = true_m.copy()
    hand[5, 1] += 0.12
    ours = np.stack([true_m, true_m + np.array([0.0, 0.0, 0.03]), np.full((6, 3), np.nan), hand])
    columns = dict(zip(POINT_COLUMNS, ours.reshape(4, -1).T, strict=True))
    stamps = np.arange(4)
    found = Results(Path(), stamps, stamps / 1e9, ("tracking",) * 4, columns, {}, (None,) * 4)
    opencv_m = {0: hand, 1: true_m, 2: true_m, 3: np.full((6, 3), np.nan)}
    person = Person("he", 1.7, dict.fromkeys(range(4), true_m))
    row = row_of("name", person, found, opencv_m)
    assert row == "| name, he | 2 | 0.0 | 1.0 | 1.5 | 1.0 |"
