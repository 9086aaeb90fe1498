"""Tracking from silhouette to silhouette: states, new starts, and the same bytes for one seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.applications.simulation.motions import wave
from cardbox_tracker.applications.simulation.renderer import Renderer
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import (
    JOINT_LIMITS,
    PITCH,
    TORSO,
    reference_posture,
    state_limits,
)
from cardbox_tracker.person.skeleton import KeypointState, neck_rotation
from cardbox_tracker.search.config import FilterConfig, TrackerConfig, default_preset, paper_preset
from cardbox_tracker.search.doubt import HANDS, Source, models
from cardbox_tracker.search.hierarchy import Cycles
from cardbox_tracker.terms.compiled import CompiledObservation, CompiledSilhouette
from cardbox_tracker.terms.term import Frame, Posed, TermObservation, TorsoCosts
from cardbox_tracker.terms.whole_body import WholeBodyCost
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.tracking.estimate import LOST, NO_PERSON, TRACKING, UNCERTAIN, Estimate
from cardbox_tracker.tracking.head import FACE_M, FACE_POINTS
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.tracker import FILTERS, Tracker
from lab.experiments.reference import ReferenceSilhouette

STATE_LIMITS = state_limits(2.0)
UNCERTAIN_ABOVE = models()[Source.OUTLINE].uncertain_from
CAMERA = Camera(160, 120, 165.0, 165.0, 79.5, 59.5)
BODY = BodyModel.of(hip_height_m=-0.51)
NOBODY = np.zeros((120, 160), np.uint8)
STILL = TrackerConfig(
    torso=FilterConfig(rotation_noise_rad=0.0), arm=FilterConfig(rotation_noise_rad=0.0)
)


def front(torso_y_m: float = 0.0) -> np.ndarray:
    posture = reference_posture("front")
    posture[0] = torso_y_m
    return posture


def seen(posture: np.ndarray, body: BodyModel = BODY) -> np.ndarray:
    """The model's own silhouette."""
    camera = CAMERA.with_pitch(body.camera_pose.pitch_rad)
    return render(cardbox_patches(body, posture), camera)


def stripes() -> np.ndarray:
    """Plenty of foreground that nobody fits."""
    silhouette = NOBODY.copy()
    silhouette[:, ::5] = 255
    return silhouette


def waving(count: int) -> list[np.ndarray]:
    return [seen(wave(i / 15.0)) for i in range(count)]


def make(config: TrackerConfig | None = None, seed: int = 0, **rest: Any) -> Tracker:
    return Tracker(BODY, CAMERA, config or paper_preset(), np.random.default_rng(seed), **rest)


def error_m(estimate: Estimate, posture: np.ndarray) -> float:
    """Mean distance of the keypoints to those of the drawn posture."""
    true_m = CAMERA.reference_to_optical(pose(BODY.rigid, posture).keypoints_m)
    return float(np.linalg.norm(estimate.keypoints_m - true_m, axis=1).mean())


def assert_same(first: Estimate, second: Estimate) -> None:
    assert (first.state, first.cost_px, first.iou) == (second.state, second.cost_px, second.iou)
    for name in ("posture", "posture_stddev", "keypoints_m", "offset_m", "offset_stddev_m"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def assert_sees_all_but_the_depth_of_hands(estimate: Estimate) -> None:
    """An outline hardly shows the depth of a hand, so hands, and the whole, may be uncertain."""
    states = [state for i, state in enumerate(estimate.keypoint_states) if i not in HANDS]
    assert states == [KeypointState.TRACKED] * 4
    assert estimate.state in (TRACKING, UNCERTAIN)
    assert KeypointState.LOST not in estimate.keypoint_states


def test_an_estimate_says_where_it_is_and_how_well_it_fits() -> None:
    tracker = make(paper_preset())
    reference = ReferenceSilhouette(BODY, CAMERA)
    for silhouette in waving(20):
        estimate = tracker.track(silhouette)
        assert estimate.state == TRACKING
        posture = estimate.posture
        assert np.all((posture >= JOINT_LIMITS[:, 0]) & (posture <= JOINT_LIMITS[:, 1]))
        expected = CAMERA.reference_to_optical(pose(BODY.rigid, posture).keypoints_m)
        np.testing.assert_allclose(estimate.keypoints_m, expected, atol=1e-9)
        cost_px, iou = reference.look(silhouette).overlap(posture)
        assert estimate.cost_px == cost_px
        assert estimate.iou == pytest.approx(iou)
        assert estimate.iou > 0.7
        assert estimate.posture_stddev.shape == (12,)
        assert np.all(estimate.posture_stddev > 0)


class HandsUp(TermObservation):
    """A term of your own: high hands are good; it keeps what it was asked."""

    def __init__(self) -> None:
        self.asked: list[Posed] = []

    def build(self, person: BodyModel, camera: Camera) -> HandsUp:
        return self

    def observe(self, frame: Frame) -> HandsUp | None:
        return self if frame.image is None else None

    def rate(self, posed: Posed) -> np.ndarray:
        self.asked.append(posed)
        return 100.0 * np.nansum(posed.keypoints_px[:, [2, 5], 1], axis=1)


@pytest.mark.parametrize("make_config", [paper_preset, default_preset])
def test_a_further_term_acts_in_both_filters_with_their_own_shoulders(make_config: Any) -> None:
    term = HandsUp()
    # Of such a result the silhouette says that it is lost.
    config = replace(make_config(), terms=(term,), lost_frames=1000)
    plain, raising = make(make_config()), make(config)
    for _ in range(8):
        usual, found = plain.track(seen(front())), raising.track(seen(front()))
    assert usual.keypoints_m is not None and found.keypoints_m is not None
    # The row of the image grows downwards, and so does y.
    assert (found.keypoints_m[[2, 5], 1] < usual.keypoints_m[[2, 5], 1] - 0.1).all()
    body = BODY.rigid if make_config is paper_preset else BODY
    raised = [posed for posed in term.asked if posed.parts[1]][-1]
    arm = [0, 1, 2]
    expected = CAMERA.reference_to_optical(pose(body, raised.states).keypoints_m)[:, arm]
    np.testing.assert_allclose(raised.keypoints_m[:, arm], expected, atol=1e-9)
    assert raised.states[:, 4].max() > np.radians(40.0)
    # Of a frame without an observation it says nothing.
    count = len(term.asked)
    raising.track(Observation(seen(front()), np.zeros((120, 160), np.uint8)))
    assert len(term.asked) == count


@pytest.mark.parametrize("make_config", [paper_preset, default_preset])
def test_doubt_about_each_keypoint_comes_with_its_evidence(make_config: Any) -> None:
    tracker = make(make_config())
    for silhouette in waving(3):
        estimate = tracker.track(silhouette)
        assert estimate.keypoint_states is not None and len(estimate.keypoint_states) == 6
        assert estimate.keypoint_chances is not None and estimate.evidence is not None
        assert ((estimate.keypoint_chances > 0.0) & (estimate.keypoint_chances < 1.0)).all()
        assert {"spread", "yaw", "pitch", "area"} <= set(estimate.evidence)
        assert all(values.shape == (6,) for values in estimate.evidence.values())
        source = Source.PAPER if make_config is paper_preset else Source.OUTLINE
        needed = {name for one in models()[source].by_kind.values() for name in one.coefficients}
        # Evidence that a model knows is never missing.
        assert needed <= set(estimate.evidence)
    assert tracker.track(NOBODY).evidence is None


def test_an_unknown_pitch_makes_the_vertical_uncertain_and_not_the_shape() -> None:
    states = []
    for stddev_deg in (9.0, 11.0):
        body = BODY.with_values(pitch_stddev_rad=np.radians(stddev_deg))
        tracker = Tracker(body, CAMERA, paper_preset(), np.random.default_rng(0))
        estimates = [tracker.track(silhouette) for silhouette in waving(5)]
        assert {estimate.state for estimate in estimates} == {TRACKING}
        states.append({(one.vertical_state, one.upright_state) for one in estimates})
    assert states == [{("tracked", TRACKING)}, {("uncertain", UNCERTAIN)}]


def test_the_lean_of_the_trunk_is_no_surer_than_the_pitch() -> None:
    found = []
    for stddev_rad in (0.0, 0.2):
        body = BODY.with_values(pitch_stddev_rad=stddev_rad)
        tracker = Tracker(body, CAMERA, default_preset(), np.random.default_rng(0))
        found.append(tracker.track(seen(front())).posture_stddev)
    expected = found[0].copy()
    expected[PITCH] = np.hypot(expected[PITCH], 0.2)
    np.testing.assert_allclose(found[1], expected)


def test_the_whole_body_filter_says_where_it_is_and_how_well_it_fits() -> None:
    tracker, sure, errors_m = make(default_preset()), [], []
    for silhouette in waving(20):
        estimate = tracker.track(silhouette)
        assert estimate.state in (TRACKING, UNCERTAIN)
        # It may doubt a posture now and then, and a hand.
        is_sure = bool((estimate.keypoint_chances[HANDS] <= UNCERTAIN_ABOVE).all())
        sure.append((estimate.state == TRACKING) == is_sure)
        errors_m.append(error_m(estimate, wave(len(errors_m) / 15.0)))
        state = np.append(estimate.posture, estimate.offset_m)
        assert np.all((state >= STATE_LIMITS[:, 0]) & (state <= STATE_LIMITS[:, 1]))
        # The keypoints are those of the posture.
        cost = WholeBodyCost(BODY, CAMERA, WholeBodyCostConfig())
        np.testing.assert_allclose(estimate.keypoints_m, cost.keypoints(state), atol=1e-12)
        assert estimate.iou > 0.7
        assert estimate.posture_stddev.shape == (12,)
        assert np.all(estimate.posture_stddev > 0)
        assert np.all(estimate.offset_stddev_m > 0)
    assert sum(sure) >= 16
    assert np.mean(errors_m) < 0.06 and max(errors_m) < 0.12


@pytest.mark.parametrize("make_config", [paper_preset, default_preset])
def test_the_seed_decides_every_number(make_config: Any) -> None:
    silhouettes = waving(6)

    def run(seed: int) -> list[Estimate]:
        tracker = make(make_config(), seed)
        return [tracker.track(silhouette) for silhouette in silhouettes]

    for first, second in zip(run(5), run(5), strict=True):
        assert_same(first, second)
    assert not np.array_equal(run(5)[-1].posture, run(6)[-1].posture)


def test_without_a_generator_runs_repeat_themselves() -> None:
    runs = [Tracker(BODY, CAMERA).track(seen(front())) for _ in range(2)]
    assert_same(*runs)


def test_the_reference_cost_gives_the_same_estimates() -> None:
    config = replace(paper_preset(), cycles=2, relocalize=True).with_particles(8)
    compiled = make(config, 1, silhouette=CompiledSilhouette(BODY, CAMERA))
    reference = make(config, 1, silhouette=ReferenceSilhouette(BODY, CAMERA))
    for silhouette in waving(2):
        assert_same(compiled.track(silhouette), reference.track(silhouette))


@pytest.mark.parametrize("make_config", [paper_preset, default_preset])
def test_before_an_empty_scene_there_is_no_person_and_no_number(make_config: Any) -> None:
    tracker = make(make_config())
    for silhouette in (NOBODY, seen(front()), NOBODY, NOBODY):
        estimate = tracker.track(silhouette)
        if silhouette is NOBODY:
            assert estimate == Estimate(NO_PERSON, None, None, None, None, None)
        else:
            # The paper's filter begins with this posture.
            assert error_m(estimate, front()) < (1e-9 if make_config is paper_preset else 0.05)
            assert estimate.state in (TRACKING, UNCERTAIN)


def test_a_quarter_of_the_person_is_needed() -> None:
    tracker = make()
    whole = seen(front())[: tracker._silhouette.rows]
    count = int(0.25 * np.count_nonzero(whole))
    pixels = np.flatnonzero(whole)
    few, enough = NOBODY.copy(), NOBODY.copy()
    few.ravel()[pixels[: count - 1]] = 255
    enough.ravel()[pixels[:count]] = 255
    assert tracker.track(few).state == NO_PERSON
    estimate = tracker.track(enough)
    # A head and shoulders; most of the model has no foreground.
    assert estimate.state == UNCERTAIN
    assert KeypointState.TRACKED not in estimate.keypoint_states
    assert estimate.posture[0] == pytest.approx(0.0, abs=0.05)


def test_what_is_below_the_hips_is_nobody() -> None:
    tracker = make()
    legs = NOBODY.copy()
    legs[tracker._silhouette.rows :] = 255
    assert tracker.track(legs).state == NO_PERSON


def test_whom_nothing_fits_is_lost_after_as_many_images() -> None:
    tracker = make(replace(paper_preset(), lost_frames=3))
    tracker.track(seen(front()))
    states = [tracker.track(stripes()).state for _ in range(5)]
    # The chance of loss has its weight from the first image on.
    assert states == [UNCERTAIN, UNCERTAIN, LOST, LOST, LOST]
    assert tracker.track(stripes()) == Estimate(LOST, None, None, None, None, None)


def test_one_good_image_begins_the_count_anew() -> None:
    tracker = make(replace(STILL, lost_frames=2))
    states = [
        tracker.track(silhouette).state
        for silhouette in (stripes(), seen(front()), stripes(), stripes(), seen(front()))
    ]
    # The chance of loss is smoothed, so that the good image after a bad one may be doubted.
    assert states[1] in (TRACKING, UNCERTAIN)
    assert [*states[:1], *states[2:]] == [UNCERTAIN, UNCERTAIN, LOST, TRACKING]


def test_the_fit_that_counts_as_lost_is_a_setting() -> None:
    silhouette = seen(front())
    silhouette[:, :80] = 0  # a fit of roughly a half
    iou = make(STILL).track(silhouette).iou
    assert 0.2 < iou < 0.8
    for lost_iou, state in ((iou - 0.01, TRACKING), (iou + 0.01, LOST)):
        tracker = make(replace(STILL, lost_iou=lost_iou, lost_frames=1))
        assert tracker.track(silhouette).state == state


def test_whoever_comes_after_nobody_begins_the_count_anew() -> None:
    tracker = make(replace(STILL, lost_frames=2))
    states = [tracker.track(silhouette).state for silhouette in (stripes(), NOBODY, stripes())]
    assert states[1] == NO_PERSON and states[2] in (TRACKING, UNCERTAIN)
    assert tracker.track(stripes()).state == LOST


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("torso_y_m", [-0.45, 0.45])
def test_whoever_comes_back_elsewhere_is_found(seed: int, torso_y_m: float) -> None:
    tracker = make(default_preset(), seed)
    tracker.track(seen(front()))
    assert tracker.track(NOBODY).state == NO_PERSON
    estimate = tracker.track(seen(front(torso_y_m)))
    assert error_m(estimate, front(torso_y_m)) < 0.07
    assert estimate.iou > 0.9
    assert_sees_all_but_the_depth_of_hands(estimate)


@pytest.mark.parametrize("seed", range(4))
def test_whoever_was_lost_is_found(seed: int) -> None:
    tracker = make(default_preset(), seed)
    tracker.track(seen(front()))
    while tracker.track(stripes()).state != LOST:
        pass
    estimates = [tracker.track(seen(front(0.4))) for _ in range(6)]
    assert error_m(estimates[-1], front(0.4)) < 0.08
    assert estimates[-1].iou > 0.88
    assert_sees_all_but_the_depth_of_hands(estimates[-1])


@pytest.mark.parametrize("seed", range(4))
def test_after_foreground_everywhere_the_person_is_found_at_once(seed: int) -> None:
    """Noise in the whole image looks like a person near the camera after a second."""
    tracker = make(default_preset(), seed)
    person = seen(front())
    for silhouette in [person] * 10 + [np.full_like(person, 255)] * 30:
        tracker.track(silhouette)
    ious = [tracker.track(person).iou or 0.0 for _ in range(15)]
    assert max(ious[:5]) > 0.7 and min(ious[5:]) > 0.7


def test_a_paper_tracker_that_may_search_again_finds_whom_it_lost_at_once() -> None:
    tracker = make(replace(paper_preset(), relocalize=True, cycles=2))
    tracker.track(seen(front()))
    while tracker.track(stripes()).state != LOST:
        pass
    estimate = tracker.track(seen(front(0.4)))
    assert estimate.posture[0] == pytest.approx(0.4, abs=0.05)
    assert estimate.iou > 0.9 and error_m(estimate, front(0.4)) < 0.15
    # The smoothed chance of loss follows with the next image.
    assert tracker.track(seen(front(0.4))).state == TRACKING


def test_what_hardly_fits_is_uncertain_before_it_is_lost() -> None:
    tracker = make(default_preset())
    tracker.track(seen(front()))
    states = []
    while not states or states[-1] != LOST:
        estimate = tracker.track(stripes())
        states.append(estimate.state)
        assert (estimate.posture is None) == (estimate.state == LOST)
    assert states[-2] == UNCERTAIN
    assert len(states) >= tracker.config.lost_frames


def test_more_foreground_than_a_person_is_no_person_and_changes_nothing() -> None:
    disturbed, undisturbed = make(default_preset()), make(default_preset())
    images = waving(4)
    for tracker in (disturbed, undisturbed):
        for image in images[:3]:
            tracker.track(image)
    bright = np.full_like(NOBODY, 255)
    assert [disturbed.track(bright).state for _ in range(7)] == [LOST] * 7
    assert_same(disturbed.track(images[3]), undisturbed.track(images[3]))


def test_the_papers_tracker_goes_on_from_where_the_person_was() -> None:
    """It knows no new search: one image moves it by its noise of 2 cm and no further."""
    tracker = make(paper_preset())
    tracker.track(seen(front()))
    tracker.track(NOBODY)
    estimate = tracker.track(seen(front(0.45)))
    assert abs(estimate.posture[0]) < 0.2


def test_reset_begins_from_the_front_reference() -> None:
    body = BODY.with_values(lateral_m=0.1)
    tracker = Tracker(body, CAMERA, STILL)
    start = reference_posture("front")
    start[0] = 0.1
    raised = start.copy()
    raised[4] = raised[8] = 1.2
    # Without noise the first particle is all there is.
    np.testing.assert_array_equal(tracker.track(seen(raised, body)).posture, start)
    observation = CompiledSilhouette(body, CAMERA).look(seen(raised, body))
    tracker._filter.hierarchy.initialize(observation, raised)
    np.testing.assert_array_equal(tracker.track(seen(raised, body)).posture, raised)
    tracker.reset()
    np.testing.assert_array_equal(tracker.track(seen(raised, body)).posture, start)


def test_reset_forgets_the_images_that_did_not_fit() -> None:
    tracker = make(replace(STILL, lost_frames=2))
    states = [tracker.track(stripes()).state]
    tracker.reset()
    states += [tracker.track(stripes()).state for _ in range(2)]
    assert states == [UNCERTAIN, UNCERTAIN, LOST]


def test_the_camera_is_pitched_as_the_body_model_says() -> None:
    body = BODY.with_values(camera_pitch_rad=0.15)
    estimate = Tracker(body, CAMERA, STILL).track(seen(front(), body))
    assert estimate.cost_px == 0
    assert estimate.iou == 1.0


@pytest.mark.parametrize("shape", [(120, 161), (160, 120), (240, 320)])
def test_a_silhouette_of_another_size_is_refused(shape: tuple[int, int]) -> None:
    tracker = make()
    with pytest.raises(ValueError, match=r"silhouette .*\(120, 160\)"):
        tracker.track(np.zeros(shape, np.uint8))
    # It changes nothing for the next one.
    assert_same(tracker.track(seen(front())), make().track(seen(front())))


def test_a_read_only_silhouette_is_taken() -> None:
    silhouette = seen(front())
    silhouette.setflags(write=False)
    assert make().track(silhouette).state == TRACKING


class CountingSilhouette(CompiledSilhouette):
    """How often torsos were rated, and where they were."""

    def __init__(self) -> None:
        self.torsos: list[np.ndarray] = []
        super().__init__(BODY, CAMERA)

    def observe(self, frame: Frame) -> CompiledObservation:
        counted = self.torsos

        class Counting(CompiledObservation):
            def torsos_beside(self, arms: np.ndarray | None) -> TorsoCosts:
                rate = super().torsos_beside(arms)

                def costs(torsos: np.ndarray) -> np.ndarray:
                    counted.append(torsos.copy())
                    return rate(torsos)

                return costs

        seen = super().observe(frame)
        return Counting(**vars(seen))


@pytest.mark.parametrize("cycles", [1, 3])
def test_an_image_takes_as_many_cycles_as_asked(cycles: int) -> None:
    config = replace(paper_preset(), cycles=cycles).with_particles(2000)
    # One survivor, so that particles lie around it by the noise of one cycle.
    config = replace(config, torso=replace(config.torso, survival_rate=1e-9))
    counting = CountingSilhouette()
    tracker = make(config, silhouette=counting)
    counting.torsos.clear()  # the first are the compiler's
    tracker.track(seen(front()))
    assert len(counting.torsos) == 1
    counting.torsos.clear()
    tracker.track(seen(front()))
    assert len(counting.torsos) == cycles
    for torsos in counting.torsos:
        np.testing.assert_allclose(torsos.std(axis=0), [0.02, 0.1, 0.1, 0.1], rtol=0.1)


def test_the_mean_of_the_best_is_steadier_than_the_best() -> None:
    """The standard deviation over ten seeds of the torso's angles, of one still person."""
    # A rounded body, which no posture of the model fits exactly.
    person = Renderer(CAMERA, np.random.default_rng(0)).silhouette(BODY, front())

    def spread(average: int) -> float:
        config = replace(paper_preset(), average=average)
        found = []
        for seed in range(10):
            tracker = make(config, seed)
            found.append([tracker.track(person).posture[TORSO] for _ in range(6)][-1])
        return float(np.std(found, axis=0)[1:].sum())

    assert spread(20) < spread(1)


class StandingStill:
    """A filter that always finds the posture it started from."""

    def __init__(self, config: TrackerConfig, image_px: int, rng: np.random.Generator) -> None:
        self.calls: list[tuple[str, float]] = []

    def initialize(self, observation: Any, posture: np.ndarray, noise_scale: float = 1.0) -> None:
        self.posture = posture
        self.calls.append(("initialize", noise_scale))

    def iterate(self, observation: Any, noise_scale: float = 1.0) -> None:
        self.calls.append(("iterate", noise_scale))

    def estimate(self) -> np.ndarray:
        return self.posture

    def stddev(self) -> np.ndarray:
        return np.full(12, 0.5)


def part_of(silhouette: np.ndarray, share: float) -> np.ndarray:
    """The first pixels of a silhouette."""
    part = np.zeros_like(silhouette)
    chosen = np.flatnonzero(silhouette[: np.flatnonzero(silhouette.any(axis=1))[0] + 200])
    part.flat[chosen[: round(share * len(chosen))]] = 255
    return part


@pytest.mark.parametrize(("share", "is_sudden"), [(1 / 3, False), (1 / 5, True)])
def test_most_of_the_foreground_that_is_gone_was_not_the_person(
    share: float, is_sudden: bool
) -> None:
    tracker = make(default_preset())
    tracker.track(seen(front()))
    tracker.track(part_of(seen(front()), share))
    presence: Any = tracker.filter._presence  # type: ignore[attr-defined]
    assert presence.is_elsewhere == is_sudden


@pytest.mark.parametrize(("share", "is_there"), [(1 / 3, True), (1 / 5, False)])
def test_the_paper_needs_a_quarter_of_a_person(share: float, is_there: bool) -> None:
    found = make(paper_preset()).track(part_of(seen(front()), share))
    assert (found.state != NO_PERSON) == is_there


def test_the_tracker_takes_another_filter() -> None:
    config = replace(paper_preset(), cycles=2)
    tracker = make(config, make_filter=partial(Cycles, make_hierarchy=StandingStill))
    estimates = [tracker.track(seen(front())) for _ in range(2)]
    for estimate in estimates:
        assert (estimate.state, estimate.cost_px, estimate.iou) == (TRACKING, 0, 1.0)
        np.testing.assert_array_equal(estimate.posture, front())
        np.testing.assert_array_equal(estimate.posture_stddev, np.full(12, 0.5))
    assert tracker._filter.hierarchy.calls == [
        ("initialize", 1.0),
        ("iterate", 1.0),
        ("iterate", 1.0),
    ]


class _Infected:
    """A filter whose numbers are ruined, and stay so, from its second frame on."""

    made = 0

    def __init__(
        self, config: Any, silhouette: Any, rng: Any, views: Any, part: str = "posture"
    ) -> None:
        type(self).made += 1
        self._inner = FILTERS[config.filter](config, silhouette, rng, views)
        self._frames, self._part = 0, part

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)

    def follow(self, frames: Any, terms: Any) -> Any:
        fit = self._inner.follow(frames, terms)
        self._frames += 1
        ruined = np.array(getattr(fit, self._part), dtype=float)
        ruined.flat[0] = np.nan
        return replace(fit, **{self._part: ruined}) if self._frames > 1 else fit


@pytest.mark.promise("No number that is not finite leaves a node")
@pytest.mark.parametrize("part", ["posture", "posture_stddev", "keypoints_m", "offset_m"])
def test_numbers_that_are_not_finite_never_leave_and_do_not_stay(part: str) -> None:
    _Infected.made = 0
    tracker = make(default_preset(), make_filter=partial(_Infected, part=part))
    states = [tracker.track(silhouette) for silhouette in waving(4)]
    assert [estimate.state == LOST for estimate in states] == [False, True, False, True]
    for number in (0, 2):
        assert error_m(states[number], wave(number / 15.0)) < 0.05
        assert_sees_all_but_the_depth_of_hands(states[number])
    assert states[1].posture is None and states[1].keypoints_m is None
    assert _Infected.made == 3  # a new one after each ruin


class _Elsewhere(_Infected):
    """A filter whose model overlaps the silhouette by a share from its second frame on."""

    def __init__(self, *given: Any, iou: float) -> None:
        super().__init__(*given)
        self._iou, self.forgot = iou, 0

    def follow(self, frames: Any, terms: Any) -> Any:
        fit = self._inner.follow(frames, terms)
        self._frames += 1
        return replace(fit, iou=self._iou, is_poor=False) if self._frames > 1 else fit

    def forget(self) -> None:
        self.forgot += 1
        self._inner.forget()


@pytest.mark.parametrize(
    ("iou", "has_points", "is_lost"), [(0.04, True, True), (0.07, True, False), (0.0, False, False)]
)
def test_a_model_that_does_not_touch_whom_a_detector_sees_is_lost_at_once(
    iou: float, has_points: bool, is_lost: bool, detected: Callable[..., ImagePoints]
) -> None:
    tracker = make(default_preset(), make_filter=partial(_Elsewhere, iou=iou))
    points = detected(BODY, CAMERA, front()) if has_points else None
    states = [tracker.track(Observation(seen(front()), points=points)).state for _ in range(2)]
    assert [state == LOST for state in states] == [False, is_lost]
    forgot: Any = tracker.filter
    assert forgot.forgot == is_lost


def test_an_image_of_another_size_is_refused() -> None:
    with pytest.raises(ValueError, match=r"image .*\(60, 80, 3\)"):
        make().track(seen(front()), np.zeros((60, 80, 3), np.uint8))


def test_settings_without_other_particles_hold_from_the_next_silhouette_on() -> None:
    changed, unchanged = make(), make()
    images = waving(6)
    for image in images[:3]:
        changed.track(image), unchanged.track(image)
    assert not changed.configure(replace(changed.config, lost_iou=0.5, lost_frames=3))
    for image in images[3:5]:
        first, second = changed.track(image), unchanged.track(image)
        assert first.posture is not None and second.posture is not None
        assert first.posture.tobytes() == second.posture.tobytes()
    assert not changed.configure(replace(changed.config, lost_iou=1.0, lost_frames=1))
    assert changed.track(images[5]).state == LOST


@pytest.mark.parametrize("change", [{"strategy": "srs"}, {"average": 3}, {"torso": FilterConfig()}])
def test_settings_with_other_particles_start_again(change: dict[str, Any]) -> None:
    tracker = make()
    tracker.track(seen(front()))
    config = replace(tracker.config, **change)
    assert tracker.configure(config)
    assert tracker.config == config
    assert tracker.track(seen(front())).state == TRACKING


def test_points_of_a_face_add_the_neck_and_change_nothing_else() -> None:
    """The points are projected from a head turned to the left on an upright torso."""
    body, posture, silhouette = BODY, front(), seen(front())
    rotation = neck_rotation(np.radians([30.0, 0.0]))
    points_m = pose(body.rigid, posture).head + FACE_M @ rotation.T
    px = CAMERA.project(CAMERA.reference_to_optical(points_m))
    face = {name: (*xy, 1.0) for name, xy in zip(FACE_POINTS, px.tolist(), strict=True)}
    points = ImagePoints.of(face)
    plain, looking = make(), make()
    without = plain.track(Observation(silhouette))
    first = looking.track(Observation(silhouette, points=points))
    assert without.neck is None
    assert first.neck is not None
    assert np.degrees(first.neck) == pytest.approx((30.0, 0.0), abs=12.0)
    assert_same(without, first)
    assert_same(plain.track(Observation(silhouette)), looking.track(Observation(silhouette)))
    looking.reset()
    assert looking.track(Observation(silhouette)).neck is None
