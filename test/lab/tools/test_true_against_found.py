"""The comparison of a true state with a found one, on a drawn silhouette."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_STATE, POSTURE
from cardbox_tracker.terms.whole_body import WholeBodyCost
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig
from lab.tools import true_against_found as tool

BODY = BodyModel.of(distance_m=2.0)
CAMERA = Camera(320, 240, 330.0, 330.0, 159.5, 119.5)


def state(*left_deg: float) -> np.ndarray:
    values = np.zeros(N_STATE)
    values[4:8] = np.radians(left_deg)
    return values


TRUE = state(60.0, 10.0, 20.0, 15.0)
WRONG = state(10.0, 0.0, 0.0, 0.0)


def cost() -> WholeBodyCost:
    """The cost of an image in which the body holds ``TRUE``."""
    made = WholeBodyCost(BODY, CAMERA, WholeBodyCostConfig())
    made.see(render(cardbox_patches(BODY, TRUE[POSTURE]), CAMERA), TRUE)
    return made


def test_the_terms_add_up_to_the_rating() -> None:
    rated = cost()
    inside = state(-40.0, -30.0, -60.0, 0.0)  # an arm within the trunk
    for one in (TRUE, WRONG, inside):
        terms = tool.terms_of(rated, one)
        assert terms.sum() == pytest.approx(rated.bodies(one[None])[0][0])
        assert terms[-1] == pytest.approx(0.0, abs=1e-12)  # there is no further term
    assert tool.terms_of(rated, inside)[tool.TERMS.index("penetration")] > 0


def test_the_state_at_the_true_joints_reaches_them_beside_a_person_elsewhere() -> None:
    rated = cost()
    truth = rated.keypoints(TRUE) + np.array([0.3, 0.0, 0.5])
    posed = tool.state_at(rated, WRONG, truth, np.random.default_rng(0))
    off = rated.keypoints(posed) - rated.keypoints(TRUE)
    assert np.linalg.norm(off, axis=1).max() < 0.01


def test_the_truth_wins_against_a_wrong_arm() -> None:
    rated = cost()
    found = tool.compare(rated, WRONG, rated.keypoints(TRUE), np.random.default_rng(0))
    assert found.true.sum() < found.found.sum()
    assert found.away_m > tool.FAR_M
    assert found.missed_m < 0.06
    rows = tool.table("drawn", [found])
    assert len(rows) == 1
    assert rows[0].startswith("| drawn | hand beyond 20 cm | 1 |")
    assert ", 100 % |" in rows[0]


def test_the_search_near_the_truth_improves_it_and_stays_near() -> None:
    rated = cost()
    off = TRUE.copy()
    off[4] += 0.08
    near = tool.best_near(rated, off, np.random.default_rng(0))
    assert rated.bodies(near[None])[0] < rated.bodies(off[None])[0]
    moved = np.linalg.norm(rated.keypoints(near) - rated.keypoints(off), axis=1)
    assert moved.max() < 0.06
