"""Doubt: probabilities by hand, states, vetoes, memory, and the evidence of a known result."""

from __future__ import annotations

from math import exp, log

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import TORSO_X, reference_posture
from cardbox_tracker.person.skeleton import KeypointState
from cardbox_tracker.search import doubt
from cardbox_tracker.search.doubt import Doubt, Model, Models, Source
from cardbox_tracker.terms.kernel_arguments import body_tuple

CAMERA = Camera(320, 240, 300.0, 310.0, 159.5, 119.5)
BODY = BodyModel.of(distance_m=2.3)
POSABLE = body_tuple(BODY, CAMERA)
STATE = np.append(reference_posture("front"), [0.0, 0.0])
SEEN = np.zeros(6, np.bool_)


def logit(chance: float) -> float:
    return log(chance / (1.0 - chance))


@pytest.fixture
def by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    """Models whose evidence is the logit itself."""
    own = {kind: Model(0.0, {kind: 1.0}) for kind in ("shoulder", "elbow", "hand", "whole")}
    monkeypatch.setattr(doubt, "models", lambda: dict.fromkeys(Source, Models(0.15, 0.15, own)))


def evidence(hand: float = 0.01, whole: float = 0.01, elbow: float = 0.01) -> dict[str, np.ndarray]:
    values = {"shoulder": 0.01, "elbow": elbow, "hand": hand, "whole": whole}
    return {name: np.full(6, logit(chance)) for name, chance in values.items()}


def test_a_probability_is_the_logistic_function_of_its_evidence(by_hand: None) -> None:
    judged = Doubt().judge(evidence(hand=0.3, elbow=0.1), Source.POINTS, SEEN)
    assert judged.chances.tolist() == pytest.approx([0.01, 0.1, 0.3] * 2)
    assert [state.value for state in judged.states] == ["tracked", "tracked", "uncertain"] * 2
    assert judged.is_uncertain and not judged.is_poor


@pytest.mark.parametrize(
    ("chance", "state"), [(0.14, "tracked"), (0.16, "uncertain"), (0.51, "lost")]
)
def test_states_follow_from_the_probability(by_hand: None, chance: float, state: str) -> None:
    judged = Doubt().judge(evidence(hand=chance), Source.OUTLINE, SEEN)
    assert judged.states[2].value == state
    assert judged.is_uncertain == (state != "tracked")


def test_the_papers_state_only_says_whether_it_is_lost(by_hand: None) -> None:
    judged = Doubt().judge(evidence(hand=0.6), Source.PAPER, SEEN)
    assert judged.states[2] is KeypointState.LOST and not judged.is_uncertain
    assert Doubt().judge(evidence(whole=0.6), Source.PAPER, SEEN).is_uncertain


def test_the_packages_models_are_complete() -> None:
    assert set(doubt.models()) == set(Source)
    for source, (uncertain_from, doubtful_from, by_kind) in doubt.models().items():
        of_images = {doubt.IMAGE} if source is Source.POINTS else set()
        assert set(by_kind) == {"shoulder", "elbow", "hand", "whole"} | of_images
        # ``tracking`` has no uncertain hand.
        assert 0.0 < doubtful_from <= uncertain_from < doubt.LOST_FROM


def test_the_doubt_about_a_hand_rises_at_once_and_fades_slowly(by_hand: None) -> None:
    one = Doubt()
    chances = [0.1, 0.3, *[0.1] * 12]
    judged = [one.judge(evidence(hand=chance), Source.MEASURED, SEEN) for chance in chances]
    # 0.1 + 0.2 * 0.85 ^ n is 0.154 after eight images, 0.146 after nine.
    assert [judgement.is_uncertain for judgement in judged] == [False, *[True] * 9, *[False] * 4]
    # The other keypoints have no memory, and the hand has the state of the posture.
    for judgement in judged:
        hand = KeypointState.UNCERTAIN if judgement.is_uncertain else KeypointState.TRACKED
        assert judgement.states[2] is hand
    one.judge(evidence(hand=0.4), Source.MEASURED, SEEN)
    one.forget()
    assert not one.judge(evidence(hand=0.1), Source.MEASURED, SEEN).is_uncertain


def test_a_doubt_about_the_limit_does_not_change_the_state_with_each_image(by_hand: None) -> None:
    """The limit is 0.15: a posture becomes sure below it, and stays so to 0.1875."""
    one = Doubt()
    one._models = {name: of._replace(uncertain_from=0.25) for name, of in one._models.items()}
    chances = [0.13, 0.16, 0.14, 0.185, 0.19, 0.14, 0.14]
    judged = [one.judge(evidence(hand=chance), Source.POINTS, SEEN) for chance in chances]
    assert [one.is_uncertain for one in judged] == [*[False] * 4, *[True] * 3]


def test_an_image_is_judged_by_hands_elbows_and_what_the_model_does_not_cover(
    by_hand: None,
) -> None:
    one = Doubt()
    image = Model(0.0, {"hand": 0.5, "elbow": 0.5, "left over": 4.0})
    models = one._models[Source.POINTS]
    models = models._replace(uncertain_from=0.25, by_kind={**models.by_kind, doubt.IMAGE: image})

    def is_sure(hand: float, elbow: float, left_over: float) -> bool:
        one = Doubt()
        one._models = {Source.POINTS: models}
        values = evidence(hand, elbow=elbow) | {"left over": np.full(6, left_over)}
        return not one.judge(values, Source.POINTS, SEEN).is_uncertain

    # The geometric mean of the odds is that of 0.15 at hands of 0.2 and elbows of 0.11.
    assert is_sure(0.2, 0.1, 0.0) and not is_sure(0.2, 0.12, 0.0)
    assert is_sure(0.2, 0.1, -0.2) and not is_sure(0.1, 0.1, 0.2)
    # An uncertain hand makes the image uncertain, whatever the rest says.
    assert is_sure(0.24, 0.01, 0.0) and not is_sure(0.26, 0.01, 0.0)


def arms_of(left_hand_m: tuple[float, float, float]) -> np.ndarray:
    """Keypoints of somebody 2 m away, arms hanging, but for the left forearm."""
    points_m = np.array([[0.2, 0.0, 2.0], [0.2, 0.3, 2.0], [0.2, 0.6, 2.0]] * 2)
    points_m[3:, 0] *= -1.0
    points_m[2] = left_hand_m
    return points_m


def test_evidence_of_arms_by_hand() -> None:
    """The left forearm points forwards and aside, so it may as well point backwards."""
    result_m, behind_m = arms_of((0.4, 0.3, 1.8)), arms_of((0.4, 0.3, 2.2))
    rated = np.array([result_m, arms_of((0.2, 0.6, 2.0))]), np.array([0.10, 0.22])
    mirrored = np.array([result_m, behind_m, behind_m, *[result_m] * 3])
    for rating in (0.10, 0.16):
        ratings = np.array([0.10, rating, rating, 0.10, 0.10, 0.10])
        found = doubt.evidence_of_arms(result_m, result_m, 0.13, rated, (mirrored, ratings))
        # The best rating is 0.10. The mirrored hand is 0.4 m away, the hanging one 0.41.
        better = rating - 0.10
        assert found["better"][2] == pytest.approx(log(max(better, 1e-3) / 0.03))
        # Nothing moves the right hand.
        assert found["better"][[1, 4, 5]] == pytest.approx([log(0.5 / 0.03)] * 3)
        assert found["sure"][5] == pytest.approx(log(0.5 / 0.03) * log(0.30 / 0.02))
        weight = exp(-max(rating - 0.13, 0.0) / 0.05)
        moved_m = 0.4 * np.sqrt(2.0 * weight / (2.0 + 2.0 * weight))
        sure = max(log(max(better, 1e-3) / 0.03), 0.0) * max(log(0.30 / moved_m), 0.0)
        assert found["sure"][2] == pytest.approx(sure)
    # The upper arm hangs 0.3 m of 2 m below the optical axis; the elbow is on the trunk's edge.
    along = 0.3 / np.hypot(np.hypot(0.2, 0.3), 2.0)
    assert found["slope"][[1, 2, 4, 5]] == pytest.approx([along] * 4)
    assert found["beside trunk"][[1, 2]] == pytest.approx([0.0, 0.0])
    # Raised above the shoulders, 0.1 m at the depth of the shoulders.
    raised_m = arms_of((0.2, -0.1, 2.0))
    raised_m[1] = 0.4, -0.2, 2.0
    found = doubt.evidence_of_arms(raised_m, raised_m, 0.13, rated, (mirrored, ratings))
    assert found["beside trunk"][[1, 2]] == pytest.approx([0.2, 0.1])


def test_an_uncertain_elbow_alone_leaves_the_result_as_it_is(by_hand: None) -> None:
    judged = Doubt().judge(evidence(elbow=0.3), Source.OUTLINE, SEEN)
    assert judged.states[1] is KeypointState.UNCERTAIN and not judged.is_uncertain


def test_the_state_of_the_papers_filter_only_says_whether_it_is_lost(by_hand: None) -> None:
    judged = Doubt().judge(evidence(hand=0.3), Source.PAPER, SEEN)
    assert judged.states[2] is KeypointState.UNCERTAIN and not judged.is_uncertain
    assert Doubt().judge(evidence(hand=0.3, whole=0.6), Source.PAPER, SEEN).is_uncertain


def test_a_veto_makes_everything_uncertain_but_what_is_hidden(by_hand: None) -> None:
    hidden = np.array([False, False, True, False, False, False])
    judged = Doubt().judge(evidence(), Source.OUTLINE, hidden, [False, True])
    assert judged.is_uncertain
    assert judged.states[2] is KeypointState.HIDDEN
    assert {judged.states[i] for i in (0, 1, 3, 4, 5)} == {KeypointState.UNCERTAIN}


def test_the_probability_of_loss_is_smoothed(by_hand: None) -> None:
    one = Doubt()
    poor = [one.judge(evidence(whole=chance), Source.OUTLINE, SEEN) for chance in (0.02, 0.98)]
    assert [judged.is_uncertain for judged in poor] == [False, False]
    # (0.5 + 0.98) / 2 = 0.74, 0.86, 0.92
    after = [one.judge(evidence(whole=0.98), Source.OUTLINE, SEEN) for _ in range(3)]
    assert [judged.is_uncertain for judged in after] == [True] * 3
    assert [judged.is_poor for judged in after] == [False, False, True]
    one.forget()
    assert not one.judge(evidence(whole=0.4), Source.OUTLINE, SEEN).is_uncertain


def test_unknown_evidence_does_not_count(by_hand: None) -> None:
    judged = Doubt().judge({}, Source.PAPER, SEEN)
    assert judged.chances.tolist() == [0.5] * 6


@given(
    st.sampled_from(list(Source)),
    st.lists(st.floats(-1e6, 1e6), min_size=24, max_size=24),
)
def test_the_packages_models_give_probabilities_for_any_evidence(
    source: Source, values: list[float]
) -> None:
    names = {
        name for model in doubt.models()[source].by_kind.values() for name in model.coefficients
    }
    given_values = {name: np.resize(values, 6) for name in names}
    judged = Doubt().judge(given_values, source, SEEN)
    assert ((judged.chances >= 0.0) & (judged.chances <= 1.0)).all()


def test_evidence_of_a_search_by_hand() -> None:
    state, deviations = STATE.copy(), np.zeros(14)
    state[3], deviations[TORSO_X] = -0.4, 0.1
    found = doubt.evidence_of_search(
        (1000.0, 800.0, 900.0, 300.0), 0.05, (0.1, 0.2, 0.3, 0.4), (state, deviations), POSABLE, 15
    )
    # 800 pixels are common: (1000 + 900 - 300) / 2.
    assert found["residual"].tolist() == pytest.approx([0.3] * 6)
    assert found["left over"][0] == pytest.approx(0.2)
    assert found["outside"][0] == pytest.approx(0.1)
    assert found["area"][0] == pytest.approx(log(1000.0 / 800.0))
    assert found["yaw"][0] == pytest.approx(0.4) and found["prior"][0] == pytest.approx(0.05)
    assert found["freshness"][0] == pytest.approx(exp(-1.0))
    assert found["arm spread"].tolist() == [0.1, 0.1, 0.2, 0.3, 0.3, 0.4]
    # The distance moves all joints alike, so none moves beside the shoulders' middle.
    assert found["spread"].tolist() == pytest.approx([log(1e-3 / 0.1)] * 6)


def test_a_spread_is_the_deviation_of_a_joint_beside_the_shoulders() -> None:
    deviations = np.zeros(14)
    deviations[7] = 0.2  # the left elbow's flexion
    found = doubt.evidence_of_particles(0.8, 1.0, STATE[:12], deviations[:12], POSABLE)
    hand_m = BODY.size("forearm_length") * 0.2
    assert found["spread"][2] == pytest.approx(log(hand_m / 0.1), abs=1e-3)
    assert found["spread"][[0, 1, 3, 4, 5]].tolist() == pytest.approx([log(0.01)] * 5)
    assert found["misfit"][0] == pytest.approx(0.2) and found["area"][0] == 0.0
    # An arm that points forwards moves its hand as far.
    forwards = STATE[:12].copy()
    forwards[5] = 0.8
    again = doubt.evidence_of_particles(0.8, 1.0, forwards, deviations[:12], POSABLE)
    assert again["spread"][2] == pytest.approx(log(hand_m / 0.1), abs=1e-3)


def test_deviations_cover_errors_that_no_particle_shows() -> None:
    assert (doubt.deviations_of(np.zeros(14)) > 0.0).all()
    wide = doubt.deviations_of(np.full(14, 1.0))
    assert wide[0] == pytest.approx(np.hypot(2.0, 0.02)) and wide[5] == pytest.approx(
        np.hypot(3.0, 0.2)
    )
