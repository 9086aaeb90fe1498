"""Sessions are tracked as people use the tracker: measured or not, with images or without."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.body.model import PROPORTIONS
from cardbox_tracker.body.proportions import sizes_of_stature
from cardbox_tracker.evaluation.recorded.session import RecordedSession
from cardbox_tracker.evaluation.truth import GroundTruth
from tools.tracked_ways import COVERED_S, TURN_S, covered, way_of


@pytest.fixture(params=[f"session_{number}" for number in range(9)])
def session(request: pytest.FixtureRequest) -> RecordedSession:
    truth = GroundTruth({}, {}, 0, 2.0, 6.0, "left", stature_m=1.6)
    nothing = np.empty(0, np.int64), np.empty(0, np.str_), np.empty((0, 6, 3)), np.empty((0, 3))
    return RecordedSession(request.param, Path(), None, truth, {}, 0.0, *nothing, {}, None)


def test_the_ways_take_turns(session: RecordedSession) -> None:
    as_it_is, poorer, guessed, with_depth = (way_of(session, seed) for seed in range(4))
    assert as_it_is.has_images and not as_it_is.covers and as_it_is.body is None
    assert poorer.covers and poorer.body is None
    assert guessed.body is not None and guessed.body.source == PROPORTIONS
    assert with_depth.has_depth and not with_depth.covers
    assert way_of(session, 4) == as_it_is
    assert way_of(session, 6).body != guessed.body


def test_people_say_about_how_tall_and_how_far_away_they_are(session: RecordedSession) -> None:
    body = way_of(session, 2).body
    assert body is not None
    assert np.allclose(body.sizes, sizes_of_stature(1.6), rtol=0.1)
    assert body.camera_pose.pitch_rad == pytest.approx(np.radians(6.0))
    if "distance_m" not in body.unknown:
        assert body.placement.distance_m == pytest.approx(2.0, rel=0.25)


def test_one_camera_after_the_other_is_covered_at_the_end_of_a_turn() -> None:
    assert covered(0.0) is None and covered(TURN_S - COVERED_S - 0.01) is None
    assert covered(TURN_S - 0.01) == 0
    assert covered(TURN_S) is None
    assert covered(2 * TURN_S - 0.01) == 1
    assert covered(3 * TURN_S - 0.01) == 0
