"""Pitch and roll of a camera from a person who stands upright, projected by hand."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.pose_network import LANDMARKS, Detection
from cardbox_tracker.measuring.standing_camera import (
    LEVELS,
    USUAL_PITCH,
    middles,
    standing_camera,
)

CAMERA = Camera(320, 240, 280.0, 280.0, 159.5, 119.5)
STATURE_M = 1.8


def seen_from(
    pitch_deg: float,
    distance_m: float,
    roll_deg: float = 0.0,
    aside_m: float = 0.0,
    hips_forward: float = 0.0,
) -> dict[str, np.ndarray]:
    """Project the line of a standing person whose hips are on the optical axis of the camera."""
    camera = CAMERA.with_pitch(np.radians(pitch_deg))
    hips_m = -distance_m * np.tan(np.radians(pitch_deg))
    turn = np.radians(roll_deg)
    points = {}
    for name, level in LEVELS.items():
        above_m = STATURE_M * (level.height - LEVELS["hip"].height)
        forward = level.forward + (hips_forward if name not in ("ankle", "knee") else 0.0)
        there = (-distance_m + STATURE_M * forward, aside_m, hips_m + above_m)
        px = camera.project(camera.reference_to_optical(np.array(there)))
        u, v = px - (CAMERA.cx, CAMERA.cy)
        # The world turns against a camera that is turned clockwise.
        points[name] = np.array(
            [
                CAMERA.cx + np.cos(turn) * u + np.sin(turn) * v,
                CAMERA.cy - np.sin(turn) * u + np.cos(turn) * v,
            ]
        )
    return points


def test_the_person_above_by_hand() -> None:
    """Shoulders are 0.304 statures, 0.547 m, above the hips: 280 px * 0.547 m / 3 m."""
    points = seen_from(0.0, 3.0)
    assert points["hip"] == pytest.approx([159.5, 119.5])
    assert points["shoulder"] == pytest.approx([159.5, 119.5 - 280 * 0.5472 / 3.0])
    assert points["ankle"][1] == pytest.approx(119.5 + 280 * 0.444 * STATURE_M / 3.0)


@pytest.mark.parametrize("pitch_deg", [-10.0, 0.0, 8.0, 15.0, 20.0, 30.0])
@pytest.mark.parametrize("distance_m", [2.0, 3.0])
def test_a_whole_person_shows_the_pitch(pitch_deg: float, distance_m: float) -> None:
    found = standing_camera(seen_from(pitch_deg, distance_m), CAMERA)
    assert found is not None
    # Without a doubt about people's proportions it would be exact; so it is drawn to what is usual.
    usual_deg, stddev_deg = np.degrees(USUAL_PITCH), np.degrees(found.pitch_stddev_rad)
    off = (np.degrees(found.pitch_rad) - usual_deg) / (pitch_deg - usual_deg or 1.0)
    assert pitch_deg == usual_deg or 0.4 < off < 1.05
    assert abs(np.degrees(found.pitch_rad) - pitch_deg) < 1.6 * stddev_deg < 1.6 * 8.0
    assert abs(found.distance * STATURE_M / distance_m - 1) < 0.4
    assert found.roll_rad == 0.0


@pytest.mark.parametrize("pitch_deg", [0.0, 12.0])
def test_a_trunk_hardly_shows_the_pitch(pitch_deg: float) -> None:
    points = seen_from(pitch_deg, 2.0)
    trunk = {name: points[name] for name in ("ear", "shoulder", "hip")}
    found = standing_camera(trunk, CAMERA)
    assert found is not None
    assert np.degrees(found.pitch_stddev_rad) > 9.0
    sure = standing_camera(trunk, CAMERA, (np.radians(pitch_deg), np.radians(0.5)))
    assert sure is not None
    assert np.degrees(sure.pitch_rad) == pytest.approx(pitch_deg, abs=0.5)
    assert sure.distance * STATURE_M == pytest.approx(2.0, rel=0.02)


def test_people_whose_legs_lean_forward_are_not_taken_for_a_steep_camera() -> None:
    """Hips 0.04 statures before the ankles, as a real man before a camera that looks down."""
    points = seen_from(12.0, 2.5, hips_forward=0.04)
    found = standing_camera(points, CAMERA)
    assert found is not None
    assert np.degrees(found.pitch_rad) == pytest.approx(12.0, abs=4.0)


@pytest.mark.parametrize("roll_deg", [-6.0, 5.0])
def test_the_line_of_the_person_shows_the_roll(roll_deg: float) -> None:
    found = standing_camera(seen_from(5.0, 2.5, roll_deg), CAMERA)
    assert found is not None
    assert np.degrees(found.roll_rad) == pytest.approx(roll_deg, abs=0.6)


def test_a_small_roll_can_be_the_persons_own() -> None:
    found = standing_camera(seen_from(5.0, 2.5, 1.5), CAMERA)
    assert found is not None
    assert found.roll_rad == 0.0


def test_the_line_of_a_person_aside_is_no_roll() -> None:
    found = standing_camera(seen_from(15.0, 2.5, aside_m=0.6), CAMERA)
    assert found is not None
    assert found.roll_rad == 0.0


def test_who_does_not_stand_upright_is_refused() -> None:
    assert standing_camera(seen_from(0.0, 2.5, 20.0), CAMERA) is None
    sitting = seen_from(0.0, 2.5)
    sitting["knee"] = sitting["hip"] + (3.0, 8.0)
    assert standing_camera(sitting, CAMERA) is None
    upside_down = {name: np.array([159.5, 239.0 - px[1]]) for name, px in seen_from(0, 2.5).items()}
    assert standing_camera(upside_down, CAMERA) is None
    assert standing_camera({}, CAMERA) is None
    two = {name: seen_from(0.0, 2.5)[name] for name in ("hip", "shoulder")}
    assert standing_camera(two, CAMERA) is None


def test_points_count_where_both_are_seen_in_most_images() -> None:
    def image(ear_u: float, ankle_score: float) -> Detection:
        points, scores = np.zeros((len(LANDMARKS), 2)), np.ones(len(LANDMARKS))
        points[LANDMARKS.index("nose")] = 7.0, 8.0
        points[LANDMARKS.index("left_ear")] = ear_u, 4
        points[LANDMARKS.index("right_ear")] = ear_u + 2, 6
        scores[LANDMARKS.index("left_ankle")] = ankle_score
        return Detection(points, scores, np.zeros((2, 2), np.uint8))

    found = middles([image(10, 0.1), image(20, 0.1), image(90, 0.9)])
    assert found["ear"] == pytest.approx([21, 5])
    assert set(found) == {"nose", "ear", "shoulder", "hip", "knee"}
    assert found["nose"] == pytest.approx([7.0, 8.0])
    assert middles([]) == {}
