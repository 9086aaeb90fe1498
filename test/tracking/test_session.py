"""Several people: identities, crossings, and pixels that belong to somebody else."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import permutations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.camera.view import OtherCamera, View
from cardbox_tracker.detectors.identity import OTHER, cheapest
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel, body_from_proportions
from cardbox_tracker.person.posture import N_STATE, TORSO_Y, reference_posture
from cardbox_tracker.person.skeleton import KeypointState
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.terms.outline import Outline
from cardbox_tracker.terms.term import Posed
from cardbox_tracker.terms.whole_body import WholeBodyCost
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.tracking import session
from cardbox_tracker.tracking.estimate import (
    CONTRADICTED,
    LOST,
    NO_PERSON,
    TRACKING,
    UNCERTAIN,
    Estimate,
)
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.session import Session

CAMERA = Camera(320, 240, 260.0, 260.0, 159.5, 119.5)
BODY = BodyModel.of(distance_m=2.6, hip_height_m=-0.25)
# A second camera that looks at the point 2.6 m in front of the first one.
_TURN = np.array([(0.5, 0.0, 0.75**0.5), (0.0, 1.0, 0.0), (-(0.75**0.5), 0.0, 0.5)])
_MIDDLE_M = np.array([0.0, 0.0, 2.6])
ASIDE = OtherCamera(CAMERA, Extrinsics(_TURN, _MIDDLE_M - _TURN @ _MIDDLE_M))
RED, BLUE, GREY = (40, 40, 220), (220, 60, 40), (90, 90, 90)
STEP_NS = 66_666_667
Detect = Callable[..., ImagePoints]


def place(aside_m: float) -> np.ndarray:
    state = np.zeros(N_STATE)
    state[: len(reference_posture("front"))] = reference_posture("front")
    state[TORSO_Y] = aside_m
    return state


def pixels(aside_m: float) -> np.ndarray:
    return render(cardbox_patches(BODY, place(aside_m)[:12]), CAMERA) > 0


class Scene:
    """People in clothes of one colour at places; the first ones stand in front."""

    def __init__(self, people: Session, detected: Detect | None) -> None:
        self.people, self.detected, self.images = people, detected, 0
        self.is_cut = False

    def __call__(
        self, *people: tuple[float, tuple[int, int, int]], found: Sequence[int] | None = None
    ) -> list[Estimate]:
        """Track people at ``aside_m`` in a colour; ``found`` are those whom the detector finds."""
        image = np.full((CAMERA.height, CAMERA.width, 3), 128, np.uint8)
        for aside_m, colour in reversed(people):
            image[pixels(aside_m)] = colour
        silhouette = np.where((image != 128).any(axis=2), np.uint8(255), np.uint8(0))
        points = None
        if self.detected is not None:
            numbers = range(len(people)) if found is None else found
            points = [self.detected(BODY, CAMERA, place(people[i][0])) for i in numbers]
        self.images += 1
        stamp_ns = self.images * STEP_NS
        seen = Observation(silhouette, image, None, stamp_ns, people=points, is_cut=self.is_cut)
        self.is_cut = False
        return self.people.track(seen)


def scene(detected: Detect | None, count: int = 2) -> Scene:
    return Scene(Session([BODY], CAMERA, default_preset(), people=count), detected)


def places(found: list[Estimate]) -> list[float | None]:
    return [None if one.posture is None else float(one.posture[TORSO_Y]) for one in found]


@pytest.mark.parametrize("has_detector", [True, False])
def test_people_are_numbered_from_left_to_right_and_keep_their_numbers(
    has_detector: bool, detected: Detect
) -> None:
    show = scene(detected if has_detector else None)
    for _ in range(8):
        found = show((0.6, RED), (-0.6, BLUE))
    assert [one.person for one in found] == [1, 2]
    assert places(found) == pytest.approx([-0.6, 0.6], abs=0.06)


def test_before_anybody_comes_each_of_a_given_number_is_nobody(detected: Detect) -> None:
    found = scene(detected)()
    assert [(one.person, one.state) for one in found] == [(1, NO_PERSON), (2, NO_PERSON)]
    assert scene(detected, 0)() == []


def test_without_a_number_all_who_come_are_tracked(detected: Detect) -> None:
    show = scene(detected, 0)
    assert len(show((0.0, RED))) == 1
    counts = [len(show((0.0, RED), (0.9, BLUE))) for _ in range(4)]
    # Somebody new is seen in three images first.
    assert counts == [1, 1, 2, 2]


def test_six_people_are_the_most() -> None:
    Session([BODY], CAMERA, default_preset(), people=6)
    with pytest.raises(ValueError, match="expected a number up to 6"):
        Session([BODY], CAMERA, default_preset(), people=7)


@pytest.mark.parametrize(("wide_px", "count"), [(2, 0), (5, 1)])
def test_a_pole_of_less_than_a_hundredth_of_the_image_is_nobody(wide_px: int, count: int) -> None:
    pole = np.zeros((CAMERA.height, CAMERA.width), np.uint8)
    pole[:, 200 : 200 + wide_px] = 255
    people = scene(None, 0).people
    assert [len(people.track(Observation(pole))) for _ in range(4)][-1] == count


def test_somebody_who_walks_past_another_keeps_the_identity(detected: Detect) -> None:
    show = scene(detected)
    for i in range(25):
        aside_m = -0.9 + 0.075 * i
        is_hidden = abs(aside_m) < 0.15
        found = show((aside_m, RED), (0.0, BLUE), found=[0] if is_hidden else None)
        _, standing = found
        assert places(found) == pytest.approx([aside_m, 0.0], abs=0.15)
        if abs(aside_m) < 0.01:
            assert standing.state == UNCERTAIN
            assert set(standing.keypoint_states or ()) == {KeypointState.HIDDEN}
    assert places(found) == pytest.approx([0.9, 0.0], abs=0.06)


def test_who_leaves_and_returns_elsewhere_keeps_the_identity_by_the_clothes(
    detected: Detect,
) -> None:
    show = scene(detected)
    for _ in range(5):
        show((-0.7, RED), (0.5, BLUE))
    for _ in range(60):
        found = show((0.5, BLUE))
    assert found[0].state == NO_PERSON
    for _ in range(3):
        found = show((0.5, BLUE), (-0.2, RED))
    assert places(found) == pytest.approx([-0.2, 0.5], abs=0.1)
    chances = [one.person_chance or 0.0 for one in found]
    assert 0.99 < chances[0] < 1.0 == chances[1]


def test_one_of_several_people_is_tracked_while_the_others_are_told_apart(
    detected: Detect, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is said of the one is what a session of all says, and nobody else is searched."""
    all_of_them = scene(detected, 0)
    one = Scene(Session([BODY], CAMERA, default_preset(), people=0, only=2), detected)
    searched = set[int]()
    track = session._Person.track

    def counted(self: Any, *given: Any) -> Estimate:
        searched.add(self.number)
        return track(self, *given)

    for i in range(14):
        people = [(-0.9 + 0.15 * i, RED), *([(0.0, BLUE)] if i > 1 else [])]
        found = [0] if abs(people[0][0]) < 0.2 else None
        wanted = all_of_them(*people, found=found)
        monkeypatch.setattr(session._Person, "track", counted)
        (seen,) = one(*people, found=found)
        monkeypatch.undo()
        if len(wanted) < 2:
            assert seen.state == NO_PERSON
        else:
            assert seen.person == 2
            assert places([seen]) == places(wanted[1:])
            assert seen.keypoint_states == wanted[1].keypoint_states
    assert searched == {2}
    assert len(one.people.trackers) == 1
    shown = one.people.shown()
    assert sorted(shown) == [1, 2]
    own, other = (one.people.silhouette_of(number) for number in (2, 1))
    assert own is not None and other is not None
    assert (own & shown[2].pixels).any() and not (own & other).any()


def test_after_a_cut_people_are_known_by_the_clothes_alone(detected: Detect) -> None:
    show = scene(detected)
    for _ in range(6):
        show((-0.6, RED), (0.6, BLUE))
    # The next shot shows them exchanged, without a moment between.
    show.is_cut = True
    found = show((-0.6, BLUE), (0.6, RED))
    assert places(found) == pytest.approx([0.6, -0.6], abs=0.1)
    assert all(0.9 < (one.person_chance or 0.0) < 1.0 for one in found)
    # Who is not in a shot is not anywhere in it.
    show.is_cut = True
    found = show((-0.6, GREY), (0.1, BLUE))
    assert (found[0].posture, found[0].state) == (None, NO_PERSON)
    assert places(found[1:]) == pytest.approx([0.1], abs=0.1)


def test_after_a_cut_one_person_is_sought_anew(detected: Detect) -> None:
    alone = Session([BODY], CAMERA, default_preset())
    found = []
    for i, (aside_m, is_cut) in enumerate([(-0.6, False)] * 3 + [(0.6, True)] * 2):
        mask, points = pixels(aside_m), detected(BODY, CAMERA, place(aside_m))
        silhouette = np.where(mask, np.uint8(255), np.uint8(0))
        given = {"stamp_ns": i * STEP_NS, "points": points, "is_cut": is_cut and i == 3}
        found += alone.track(Observation(silhouette, **given))
    assert places(found[2:]) == pytest.approx([-0.6, 0.6, 0.6], abs=0.1)


def test_the_chance_of_the_same_person_by_hand() -> None:
    one, other = np.array([1.0, 0.0]), np.array([0.36, 0.64])
    # Their distance is sqrt(1 - 0.6) = 0.632.
    expected = 1.0 / (1.0 + np.exp((0.6325 - 0.6) / 0.07))
    assert session._chance_of_same(one, other) == pytest.approx(expected, abs=1e-3)
    assert (
        session._chance_of_same(one, one) > 0.999 > 0.01 > session._chance_of_same(one, one[::-1])
    )
    assert session._chance_of_same(one, None) == 0.5


def test_somebody_else_in_the_place_of_one_who_left_is_not_that_person(detected: Detect) -> None:
    show = scene(detected, 0)
    for _ in range(4):
        show((0.0, RED))
    for _ in range(60):
        show()
    for _ in range(4):
        found = show((0.0, BLUE))
    assert [one.person for one in found if one.posture is not None] == [2]


@pytest.mark.parametrize("aside_m", [0.35, -0.5])
def test_after_a_cut_a_number_is_not_that_of_somebody_else(
    aside_m: float, detected: Detect
) -> None:
    """The next image has another person nearby, whose clothes are others."""
    show = scene(detected, 0)
    for _ in range(6):
        show((0.0, RED))
    # One may hide the other where they overlap.
    for _ in range(60):
        first, *others = show((aside_m, BLUE))
        assert first.state != TRACKING
        assert places([first]) in ([None], [pytest.approx(0.0, abs=0.1)])
    assert first.state == LOST
    assert places(others) == [pytest.approx(aside_m, abs=0.1)]


def test_only_an_image_of_them_brings_somebody_back(detected: Detect) -> None:
    """The silhouette in their last place is a shadow; figures beyond the border are none."""
    show = scene(detected)
    for _ in range(6):
        show((-0.7, RED), (0.5, BLUE))
    for _ in range(8):
        found = show((0.5, BLUE))
    assert places(found) == [None, pytest.approx(0.5, abs=0.1)]
    for people in ([(-0.7, GREY)], [(-0.8, BLUE)], [(-2.0, RED)]):
        for _ in range(3):
            found = show((0.5, BLUE), *people, found=[0] if people[0][1] == GREY else None)
            assert places(found) == [None, pytest.approx(0.5, abs=0.1)]
    assert places(show((0.5, BLUE), (-0.7, RED))) == pytest.approx([-0.7, 0.5], abs=0.1)


def test_a_reset_forgets_one_person(detected: Detect) -> None:
    show = scene(detected)
    show((-0.6, RED), (0.6, BLUE))
    show.people.reset(1)
    assert places([person.estimate for person in show.people._people])[0] is None
    assert places(show((-0.6, RED), (0.6, BLUE))) == pytest.approx([-0.6, 0.6], abs=0.1)


@pytest.mark.parametrize(
    ("scales", "is_told"),
    [((1.72 / 1.4, 1.4 / 1.72), True), ((1.72 / 1.4, 1.0), False), ((1.0, 1.0), False)],
)
def test_statures_in_the_wrong_order_are_told(scales: tuple[float, float], is_told: bool) -> None:
    """Two people are as tall in a second camera as the other one is said to be."""
    bodies = [body_from_proportions(stature_m, 2.5) for stature_m in (1.4, 1.72)]
    watched = Session(bodies, CAMERA, default_preset(), people=2)
    for tracker, scale in zip(watched.trackers, scales, strict=True):
        tracker.place.scale = scale
    told = [text for text in watched.remarks(["camera"]) if "exchange their statures" in text]
    assert len(told) == is_told
    assert not told or "person 1 is as tall as person 2 is given" in told[0]


def test_a_camera_that_misses_a_person_takes_their_place_from_the_other(detected: Detect) -> None:
    view = View.of(BODY, CAMERA, ASIDE)
    people = Session([BODY], CAMERA, default_preset(), others=[ASIDE], people=2)
    for image in range(12):
        seen = []
        for body, states_of in ((BODY, np.copy), (view.body, view.states)):
            masks, points = [], []
            for aside_m in (-0.6, 0.6):
                state = states_of(place(aside_m))
                there = Estimate("", offset_m=state[12:]).placed(body)
                masks.append(render(cardbox_patches(there, state[:12]), CAMERA) > 0)
                points.append(detected(body, CAMERA, state))
            if body is BODY and image >= 6:
                # The first camera loses the second person.
                masks, points = masks[:1], points[:1]
            mask = np.where(np.any(masks, axis=0), np.uint8(255), np.uint8(0))
            # Nothing follows from the order of the figures.
            figures = tuple(points[:: -1 if body is BODY else 1])
            seen.append(Observation(mask, stamp_ns=image * STEP_NS, people=figures))
        found = people.track(seen)
        assert [one.person for one in found] == [1, 2]
        assert places(found) == pytest.approx([-0.6, 0.6], abs=0.15)


@pytest.mark.parametrize("lower_px", [0, 18])
def test_a_second_camera_that_contradicts_the_joints_of_all_people_is_told(
    detected: Detect, lower_px: int
) -> None:
    """The images are 18 px lower than the pose says, as after a pitch of 4 degrees."""
    view = View.of(BODY, CAMERA, ASIDE)
    people = Session([BODY], CAMERA, default_preset(), others=[ASIDE], people=2)
    for image in range(8):
        seen = []
        for body, states_of, down in ((BODY, np.copy, 0), (view.body, view.states, lower_px)):
            masks, figures = [], []
            for aside_m in (-0.6, 0.6):
                state = states_of(place(aside_m))
                there = Estimate("", offset_m=state[12:]).placed(body)
                masks.append(render(cardbox_patches(there, state[:12]), CAMERA) > 0)
                points = detected(body, CAMERA, state)
                figures.append(replace(points, px=points.px + np.array((0.0, down))))
            mask = np.where(np.any(masks, axis=0), np.uint8(255), np.uint8(0))
            seen.append(
                Observation(
                    np.roll(mask, down, axis=0), stamp_ns=image * STEP_NS, people=tuple(figures)
                )
            )
        found = people.track(seen)
        is_doubted = [one.reason == CONTRADICTED for one in found if one.posture is not None]
        assert not any(is_doubted) or lower_px
        assert TRACKING not in {one.state for one in found} or not lower_px
    told = [text for text in people.remarks(["cam0", "cam1"]) if "joints of the person" in text]
    assert len(told) == (lower_px > 0)


def test_the_gap_between_two_lines_of_sight_by_hand() -> None:
    """Both cameras look at the point 2.6 m before them, where a trunk of 0.5 m has 50 px."""
    people = Session([BODY], CAMERA, default_preset(), others=[ASIDE], people=2)
    people._last_ns = 1

    def gap(trunk_px: float, other_px: float, lower_px: float = 0.0) -> float:
        here, there = (
            SimpleNamespace(middle_px=(159.5, row), trunk_px=px)
            for row, px in ((119.5, trunk_px), (119.5 + lower_px, other_px))
        )
        seen: Any = SimpleNamespace(sights=[SimpleNamespace(seen_ns=1, figure=here)])
        shown: Any = SimpleNamespace(figure=there)
        return people._gap(seen, 1, shown)

    assert gap(50.0, 50.0) == pytest.approx(0.0, abs=1e-9)
    # A trunk that looks twice as long has (ln 2 / 0.4)^2, as one that looks half as long.
    assert gap(50.0, 100.0) == pytest.approx(3.003, abs=1e-3)
    assert gap(25.0, 100.0) == pytest.approx(6.006, abs=1e-3)
    # 15 px lower are 0.15 m at 2.6 m.
    assert gap(50.0, 50.0, 15.0) == pytest.approx(1.0, abs=0.02)


def test_pixels_of_others_do_not_count() -> None:
    cost = WholeBodyCost(BODY, CAMERA, WholeBodyCostConfig())
    state, silhouette = place(0.0), np.where(pixels(0.0), np.uint8(255), np.uint8(0))
    cost.see(silhouette, state)
    whole = float(cost.bodies(state[None]).costs_px[0])
    half, other = silhouette.copy(), np.zeros_like(silhouette)
    half[:, :160], other[:, :160] = 0, 255
    cost.see(half, state)
    assert float(cost.bodies(state[None]).costs_px[0]) > whole + 1000
    cost.covered = other
    cost.see(half, state)
    assert float(cost.bodies(state[None]).costs_px[0]) <= whole
    # Left arm and shoulder are on the right in the image.
    assert cost.are_covered(state).tolist() == [False] * 3 + [True] * 3


def test_the_outline_of_others_does_not_pull() -> None:
    cost = WholeBodyCost(BODY, CAMERA, WholeBodyCostConfig())
    state, silhouette = place(0.0), np.where(pixels(0.0), np.uint8(255), np.uint8(0))
    half, other = silhouette.copy(), np.zeros_like(silhouette)
    half[:, :160], other[:, :160] = 0, 255
    hips = cost.hips(state)[1:]
    found = [
        Outline(seen, CAMERA, hips, covered).residuals(Posed(cost.body, state[None]))
        for seen, covered in ((half, None), (half, other), (silhouette, np.full_like(other, 255)))
    ]
    cut, unknown, nothing = (float(one.costs[0]) for one in found if one is not None)
    assert unknown < cut / 2 and nothing == 0.0


@given(
    st.lists(st.lists(st.floats(0.0, 20.0), min_size=4, max_size=4), min_size=1, max_size=3),
)
def test_figures_are_assigned_with_the_least_sum(costs: list[list[float]]) -> None:
    table = np.array(costs)
    found = cheapest(table)
    assert len(set(found.values())) == len(found)
    assert all(table[row, column] < OTHER for row, column in found.items())
    rows = np.arange(len(table))
    clipped = np.minimum(table, OTHER)
    least = min(clipped[rows, list(chosen)].sum() for chosen in permutations(range(4), len(rows)))
    unassigned = OTHER * (len(table) - len(found))
    assert sum(table[pair] for pair in found.items()) + unassigned == pytest.approx(least)
    # Of many copies, such as the short tracks of a film, each figure gets the row that is nearest.
    many = np.tile(table.T, (15, 1))
    nearest = table.min(axis=1)
    total = sum(many[pair] for pair in cheapest(many).items())
    assert total == pytest.approx(nearest[nearest < OTHER].sum())
