"""A body from a stature: lengths as in the sources, and what is not known is said."""

from __future__ import annotations

import pytest

from cardbox_tracker.common.errors import BodyModelError
from cardbox_tracker.person.model import MEASURED, PROPORTIONS, BodyModel, body_from_proportions
from cardbox_tracker.person.model_file import dumps_body_model, loads_body_model
from cardbox_tracker.person.proportions import BREADTHS


@pytest.mark.parametrize("stature_m", [1.1, 1.6, 1.9, 2.2])
def test_lengths_are_those_of_the_sources(stature_m: float) -> None:
    size = body_from_proportions(stature_m).size
    # de Leva, 1996, men and women: upper arm, forearm and the hand to its knuckles.
    upper_arm = (0.2817 / 1.741 + 0.2751 / 1.735) / 2
    forearm = ((0.2689 + 0.0862) / 1.741 + (0.2643 + 0.0780) / 1.735) / 2
    assert size("upper_arm_length") / stature_m == pytest.approx(upper_arm, rel=0.01)
    assert size("forearm_length") / stature_m == pytest.approx(forearm, rel=0.01)
    # Drillis & Contini, 1966: shoulders 0.818, hips 0.530 of the stature above the floor.
    above_hips = size("waist_height") + size("torso_height") - size("shoulder_drop")
    assert above_hips / stature_m == pytest.approx(0.818 - 0.530, rel=0.04)


def test_what_is_given_is_known_and_the_rest_is_not() -> None:
    body = body_from_proportions(1.8, 2.5, shoulder_breadth_m=0.41, hip_height_m=-0.3)
    assert body.placement.distance_m == 2.5
    assert body.placement.hip_height_m == -0.3
    assert body.size("shoulder_breadth") == 0.41
    assert set(body.unknown) == set(BREADTHS) - {"shoulder_breadth"}
    assert {"distance_m", "hip_height_m", *BREADTHS} == set(body_from_proportions(1.8).unknown)


@pytest.mark.parametrize("stature_m", [0.9, 180.0, float("nan")])
def test_an_impossible_stature_is_refused(stature_m: float) -> None:
    with pytest.raises(BodyModelError, match="stature is"):
        body_from_proportions(stature_m)


def test_the_file_says_that_nobody_was_measured() -> None:
    body = body_from_proportions(1.8, 2.5)
    text = dumps_body_model(body)
    assert "source: proportions" in text
    assert "less exact" in text.splitlines()[0]
    assert loads_body_model(text) == body
    assert "not measured" in str(body)
    # A measured person is written as before, and read as measured.
    old = dumps_body_model(BodyModel())
    assert "source" not in old
    assert "unknown" not in old
    assert loads_body_model(old).source == MEASURED
    assert loads_body_model(old).doubt == ""


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("source: proportions", "source: guessed", "source .*'guessed'.*expected"),
        ("unknown: [", "unknown: [knee, ", "'knee'"),
        ("source: proportions", "source: 3", "source is 3"),
    ],
)
def test_what_is_wrong_in_the_file_is_named(old: str, new: str, text: str) -> None:
    written = dumps_body_model(body_from_proportions(1.8, 2.5))
    assert PROPORTIONS in written
    with pytest.raises(BodyModelError, match=text):
        loads_body_model(written.replace(old, new))
