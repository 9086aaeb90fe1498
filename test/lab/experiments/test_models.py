"""The cardbox and the volumetric model under the same drawing."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_JOINTS, TORSO, clip_to_limits, reference_posture
from cardbox_tracker.terms.term import ARMS
from lab.experiments.models import (
    MODELS,
    PlaneSilhouette,
    make_silhouette_term,
    microseconds_a_particle,
)
from lab.experiments.reference import ReferenceSilhouette
from lab.experiments.sessions import Session


def postures(count: int) -> np.ndarray:
    noise = np.random.default_rng(1).normal(0.0, 0.2, (count, N_JOINTS))
    return clip_to_limits(reference_posture("front") + noise)


def test_the_paper_counts_fewer_planes_for_the_cardbox() -> None:
    assert {name: planes.n_planes for name, planes in MODELS.items()} == {
        "cardbox": 15,
        "volumetric": 42,
    }


def test_planes_that_reach_behind_the_camera_are_cut_as_the_reference_cuts_them() -> None:
    # Half a metre before the camera: an arm points past it, or the trunk is bent past it.
    body, camera = BodyModel.of(distance_m=0.5), Camera(160, 120, 80.0, 80.0, 79.5, 59.5)
    some = np.zeros((2, N_JOINTS))
    some[0, 3], some[0, 5] = -0.5, np.pi / 2
    some[1, 2] = 0.8
    nobody = np.zeros((120, 160), np.uint8)
    drawn = make_silhouette_term("cardbox", body, camera).look(nobody).postures(some)
    reference = ReferenceSilhouette(body, camera).look(nobody).postures(some)
    np.testing.assert_allclose(drawn, reference, rtol=0.05)


@pytest.mark.parametrize("name", MODELS)
def test_trunk_and_arms_are_all_planes(name: str) -> None:
    planes = MODELS[name]
    covered = np.zeros(planes.n_planes, int)
    for part in (planes.trunk, *planes.arms.values()):
        covered[part] += 1
    assert np.all(covered == 1)


def test_drawn_cardbox_costs_what_the_reference_says_but_for_its_outline(session: Session) -> None:
    """OpenCV paints every pixel an edge touches, so the outline may differ, and only that."""
    silhouette = session.silhouettes[0]
    drawn = make_silhouette_term("cardbox", session.body, session.camera).look(silhouette)
    reference = ReferenceSilhouette(session.body, session.camera).look(silhouette)
    some = postures(12)
    outline_px = 1500
    np.testing.assert_allclose(drawn.postures(some), reference.postures(some), atol=outline_px / 4)
    np.testing.assert_allclose(
        drawn.torsos_beside(None)(some[:, TORSO]),
        reference.torsos_beside(None)(some[:, TORSO]),
        atol=outline_px / 4,
    )
    assert np.corrcoef(drawn.postures(some), reference.postures(some))[0, 1] > 0.95


@pytest.mark.parametrize("name", MODELS)
def test_the_parts_of_the_cost_agree_with_the_whole(name: str, session: Session) -> None:
    """A torso beside fixed arms, in the posture of both, is the full model."""
    term = make_silhouette_term(name, session.body, session.camera)
    seen = term.look(session.silhouettes[3])
    posture = postures(1)[0]
    torso = posture[None, TORSO]
    whole = seen.postures(posture[None])[0]
    assert seen.torsos_beside(posture)(torso)[0] == whole
    assert seen.overlap(posture)[0] == whole
    alone = seen.torsos_beside(None)(torso)[0]
    rate_arms = seen.arms_beside(posture[TORSO])
    arms = {side: rate_arms(side, posture[None, joints])[0] for side, joints in ARMS.items()}
    # The arms do not overlap in the image, so each changes the cost by itself.
    assert whole == arms["left"] + arms["right"] - alone


def test_a_volumetric_model_covers_the_cardbox(session: Session) -> None:
    empty = np.zeros_like(session.silhouettes[0])
    areas = {}
    for name in MODELS:
        term = make_silhouette_term(name, session.body, session.camera)
        areas[name] = term.look(empty).postures(postures(5))
    assert np.all(areas["volumetric"] >= areas["cardbox"])


def test_a_silhouette_of_another_size_is_refused(session: Session) -> None:
    term = PlaneSilhouette(MODELS["cardbox"], session.body, session.camera)
    with pytest.raises(ValueError, match=r"silhouette .*shape"):
        term.look(np.zeros((5, 5), np.uint8))


def test_timing_names_every_model(session: Session) -> None:
    times = microseconds_a_particle(session.body, session.camera, session.silhouettes[0], 20, 2)
    assert set(times) == {"compiled", "cardbox", "volumetric"}
    assert all(time > 0 for time in times.values())
