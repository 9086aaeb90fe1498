"""Pitch and roll of a camera from lines and a person, by likelihoods that are made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.measuring.camera_tilt import Tilt, camera_tilt
from cardbox_tracker.measuring.room_edges import PITCHES_RAD, ROLLS_RAD
from cardbox_tracker.measuring.standing_camera import (
    PITCH_PRIOR,
    USUAL_PITCH,
    StandingCamera,
)

NO_LINES = np.zeros((len(PITCHES_RAD), len(ROLLS_RAD)))


def lines(pitch_deg: float, roll_deg: float, gain: float = 30.0) -> np.ndarray:
    """Return the log-likelihoods of lines that agree on a pitch and a roll."""
    pitches, rolls = np.meshgrid(PITCHES_RAD, ROLLS_RAD, indexing="ij")
    away = np.hypot(np.degrees(pitches) - pitch_deg, np.degrees(rolls) - roll_deg)
    return gain * np.exp(-(away**2) / 2)


def person(pitch_deg: float, stddev_deg: float, roll_deg: float = 0.0) -> StandingCamera:
    values = np.radians([pitch_deg, stddev_deg, roll_deg, 2.0]).tolist()
    return StandingCamera(*values, 1.5)


def degrees(tilt: Tilt) -> tuple[float, float, float]:
    values = tilt.pitch_rad, tilt.pitch_stddev_rad, tilt.roll_rad
    pitch_deg, stddev_deg, roll_deg = np.degrees(values).tolist()
    return pitch_deg, stddev_deg, roll_deg


def test_without_lines_and_person_the_pitch_is_the_usual_one() -> None:
    tilt = camera_tilt(NO_LINES, None)
    assert tilt.pitch_rad == pytest.approx(USUAL_PITCH, abs=0.01)
    assert tilt.pitch_stddev_rad == pytest.approx(PITCH_PRIOR, rel=0.1)
    assert tilt.roll_rad == 0.0 and not tilt.has_edges


@pytest.mark.parametrize("pitch_deg", [-10.0, 6.0, 20.0, 30.0])
def test_edges_are_surer_than_a_person(pitch_deg: float) -> None:
    found = camera_tilt(lines(pitch_deg, 0.0), person(pitch_deg - 8.0, 8.0))
    assert found.has_edges
    assert degrees(found)[0] == pytest.approx(pitch_deg, abs=1.0)
    assert degrees(found)[1] < 4.0


def test_a_sure_person_overrules_lines_that_are_parallel_to_the_image() -> None:
    """Pictures and bars are so at any pitch; other lines mean something."""
    pitch_deg, stddev_deg, _ = degrees(camera_tilt(lines(0.0, 0.0), person(16.0, 5.0)))
    assert pitch_deg == pytest.approx(16.0, abs=2.0)
    assert stddev_deg > 4.0
    assert degrees(camera_tilt(lines(6.0, 0.0), person(16.0, 5.0)))[0] == pytest.approx(6, abs=2)
    assert degrees(camera_tilt(lines(0.0, 0.0), person(5.0, 5.0)))[0] == pytest.approx(0, abs=1)


def test_a_roll_needs_edges_or_a_person_who_does_not_lean() -> None:
    assert degrees(camera_tilt(lines(8.0, 5.0, 60.0), None))[2] == pytest.approx(5.0, abs=0.5)
    assert degrees(camera_tilt(NO_LINES, person(8.0, 6.0, 5.0)))[2] == pytest.approx(5.0, abs=0.1)
    assert degrees(camera_tilt(lines(8.0, 0.0), person(8.0, 6.0, 5.0)))[2] == 0.0


def test_a_person_who_leans_aside_says_little_of_the_pitch() -> None:
    pitch_deg, _, _ = degrees(camera_tilt(lines(7.0, 0.0), person(35.0, 7.0, -7.0)))
    assert pitch_deg == pytest.approx(7.0, abs=1.0)
