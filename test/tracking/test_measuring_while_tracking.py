"""A body from proportions is measured in a few images, and again for the next person."""

from __future__ import annotations

from concurrent.futures import Future
from unittest.mock import Mock

import numpy as np
import pytest

from cardbox_tracker.applications.simulation.renderer import Renderer
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.measuring import first_sight, seen_body
from cardbox_tracker.measuring.first_sight import FirstSight
from cardbox_tracker.measuring.people_camera import Distances
from cardbox_tracker.measuring.seen_body import MOST_SIGHTS, SeenBody
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel, body_from_proportions
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.person.proportions import sizes_of_stature
from cardbox_tracker.person.sizes import SIZE_INDEX
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.tracking.estimate import LOST, TRACKING, UNCERTAIN, Estimate
from cardbox_tracker.tracking.session import Session
from cardbox_tracker.tracking.tracker import Tracker

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
NOBODY = np.zeros((240, 320), np.uint8)
BROAD = 1.25


def person(stature_m: float, hip_height_m: float, broad: float = 1.0) -> BodyModel:
    """Somebody at 2 m whose trunk is broader than the mean."""
    sizes = sizes_of_stature(stature_m)
    for name in ("torso_top_width", "torso_bottom_width", "waist_width", "shoulder_breadth"):
        sizes[SIZE_INDEX[name]] *= broad
    return BodyModel.of(sizes, distance_m=2.0, hip_height_m=hip_height_m, lateral_m=0.1)


def silhouette(body: BodyModel, raised_rad: float = 0.0) -> np.ndarray:
    posture = reference_posture("front")
    posture[0] = body.placement.lateral_m
    posture[4] += raised_rad
    renderer = Renderer(CAMERA, np.random.default_rng(0))
    seen: np.ndarray = renderer.silhouette(body, posture)
    return seen


class Followed:
    """A session of one person, who is measured."""

    def __init__(self, only_measures: bool = False, **given: float) -> None:
        guess = body_from_proportions(1.75, **given)  # type: ignore[arg-type]
        given_all = [guess], CAMERA, default_preset(), np.random.default_rng(1)
        self._session = Session(*given_all, only_measures=only_measures)

    def track(self, silhouette: np.ndarray) -> Estimate:
        (found,) = self._session.track(silhouette)
        return found

    @property
    def body(self) -> BodyModel:
        return self._session.trackers[0].body

    @property
    def age(self) -> int:
        age: int = self._session.trackers[0].filter._age  # type: ignore[attr-defined]
        return age


@pytest.mark.parametrize("raised_rad", [0.0, 1.0])
def test_height_and_breadth_are_found_at_first_sight(raised_rad: float) -> None:
    true = person(1.75, -0.62, BROAD)
    track = Followed(distance_m=2.0)
    guessed = track.body.size("waist_width")
    estimate = track.track(silhouette(true, raised_rad))
    assert track.body.unknown == ()
    assert estimate.state in (TRACKING, UNCERTAIN)
    place = track.body.placement
    assert place.hip_height_m == pytest.approx(true.placement.hip_height_m, abs=0.05)
    assert place.lateral_m == pytest.approx(0.1, abs=0.04)
    # Nearer to the true width than to the guess.
    assert track.body.size("waist_width") > (guessed + true.size("waist_width")) / 2
    assert estimate.iou is not None
    assert estimate.iou > 0.85


def test_a_distance_that_is_not_given_is_found_roughly() -> None:
    track = Followed()
    track.track(silhouette(person(1.75, -0.6)))
    assert track.body.placement.distance_m == pytest.approx(2.0, rel=0.25)


def test_points_show_the_distance_of_who_wears_wide_clothes() -> None:
    """The outline is that of somebody 1.8 m away, and the points are those of 2 m."""
    body = person(1.75, -0.6)
    posture = reference_posture("front")
    posture[0] = body.placement.lateral_m
    posed = pose(body, posture)
    names = [
        *(f"{side}_{one}" for side in ("left", "right") for one in ("shoulder", "elbow", "index")),
        *("left_hip", "right_hip", "left_little_finger", "right_little_finger"),
    ]
    hands_m = posed.keypoints_m[[2, 5]]
    joints_m = np.concatenate([posed.keypoints_m, [posed.hip, posed.hip], hands_m])
    pixels = CAMERA.project(CAMERA.reference_to_optical(joints_m))
    points = ImagePoints.of({name: (*at, 0.9) for name, at in zip(names, pixels, strict=True)})
    outline = silhouette(body.with_values(distance_m=1.8))

    def fitted(guess: BodyModel, given: ImagePoints | None, seed: int = 0) -> BodyModel:
        more = CAMERA, outline, None, default_preset(), np.random.default_rng(seed), given
        return first_sight.fit_first_sight(guess, *more).body

    guess, known = body_from_proportions(1.75), body_from_proportions(1.75, 1.8)
    alone_m, found_m = (
        np.mean([fitted(guess, one, seed).placement.distance_m for seed in range(4)])
        for one in (None, points)
    )
    assert 1.75 < alone_m < found_m - 0.03 < 2.0
    assert fitted(known, points) == fitted(known, None)


def test_what_was_given_is_kept() -> None:
    track = Followed(distance_m=2.0, hip_height_m=-0.6, shoulder_breadth_m=0.4)
    track.track(silhouette(person(1.75, -0.6)))
    assert track.body.size("shoulder_breadth") == pytest.approx(0.4)
    assert track.body.placement.distance_m == pytest.approx(2.0)
    assert track.body.placement.hip_height_m == pytest.approx(-0.6)


def test_until_somebody_is_seen_whole_nothing_is_sure() -> None:
    track = Followed(distance_m=2.0)
    beheaded = silhouette(person(1.75, 0.2))
    assert beheaded[0].any()
    assert track.track(NOBODY).state == "no_person"
    assert track.track(beheaded).state in (UNCERTAIN, "lost", "no_person")
    assert track.body.unknown


def test_the_next_person_is_fitted_after_the_image_was_empty() -> None:
    track = Followed(distance_m=2.0)
    first, second = person(1.75, -0.62, BROAD), person(1.75, -0.62, 1 / BROAD)
    track.track(silhouette(first))
    fitted = track.body
    track.track(silhouette(first))
    assert track.body is fitted
    for number in range(6):
        # For a moment, nobody is found.
        assert number > 3 or track.body is fitted
        track.track(NOBODY)
    # They may come in where the first one never was.
    assert track.body.unknown
    track.track(silhouette(second))
    assert track.body is not fitted
    assert track.body.size("waist_width") < fitted.size("waist_width")


def test_what_does_not_fit_is_not_tried_with_every_image(monkeypatch: pytest.MonkeyPatch) -> None:
    tries: list[int] = []

    def refuse(*_: object) -> None:
        tries.append(1)
        raise InitializationError("nothing fits")

    monkeypatch.setattr(seen_body, "fit_first_sight", refuse)
    track = Followed(distance_m=2.0)
    seen = silhouette(person(1.75, -0.62))
    for _ in range(50):
        track.track(seen)
    assert 2 <= len(tries) <= 4
    assert track.body.unknown


def sights(monkeypatch: pytest.MonkeyPatch, fits: list[tuple[BodyModel, float]]) -> SeenBody:
    made = iter(FirstSight(body, iou) for body, iou in fits)
    monkeypatch.setattr(seen_body, "fit_first_sight", lambda *_: next(made))
    guess = body_from_proportions(1.75)
    return SeenBody(guess, CAMERA, default_preset(), np.random.default_rng(0))


def test_a_poor_fit_is_used_until_a_better_one_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    guess, good = body_from_proportions(1.75), person(1.75, -0.62)
    poor = [guess.with_values(distance_m=distance_m) for distance_m in (2.2, 2.4)]
    seen = sights(monkeypatch, [(poor[0], 0.5), (poor[1], 0.4), (good, 0.9)])
    used = [(seen.see(silhouette(good), None, time_s), seen.body) for time_s in range(3)]
    assert used == [(True, poor[0]), (False, poor[0]), (True, good)]


def test_a_body_is_the_median_of_a_few_images_at_growing_pauses(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The second fit, to somebody who bows, is half as broad; a third one outvotes it."""
    usual, narrow = person(1.75, -0.62), person(1.75, -0.62, 0.5)
    seen = sights(monkeypatch, [(usual, 0.8), (narrow, 0.7), *[(usual, 0.8)] * MOST_SIGHTS])
    mask = silhouette(usual)
    used_s = [time_s / 2 for time_s in range(300) if seen.see(mask, None, time_s / 2)]
    assert used_s == [0.0, 1.0, 3.0, 7.0, 15.0, 31.0, 63.0]
    assert seen.body.size("waist_width") == pytest.approx(usual.size("waist_width"))
    assert seen.body.placement == usual.placement


def test_further_fits_are_made_beside_and_count_when_they_are_done(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    usual, narrow = person(1.75, -0.62), person(1.75, -0.62, 0.5)
    seen = sights(monkeypatch, [(usual, 0.8)])
    fitting: Future[FirstSight] = Future()
    seen._beside = Mock(submit=Mock(side_effect=[fitting, Future()]))
    mask = silhouette(usual)
    assert seen.see(mask, None, 0.0)
    assert [seen.see(mask, None, time_s) for time_s in (1.0, 1.5, 4.0)] == [False] * 3
    fitting.set_result(FirstSight(narrow, 0.9))
    assert seen.see(mask, None, 4.1)
    mean = (usual.size("waist_width") + narrow.size("waist_width")) / 2
    assert seen.body.size("waist_width") == pytest.approx(mean)
    # The next fit is that of another camera when the pitch changes.
    assert not seen.see(mask, None, 4.2)
    assert seen._begun is not None
    seen.tilt(body_from_proportions(1.75, camera_pitch_rad=0.1))
    assert seen._begun is None


def test_a_body_is_measured_without_a_search_for_its_posture(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Tracker, "follow", Mock(side_effect=AssertionError))
    track = Followed(only_measures=True, distance_m=2.0)
    assert track.track(silhouette(person(1.75, -0.62))).state == LOST
    assert not track.body.unknown


def test_a_tracker_alone_refuses_a_body_that_a_session_measures() -> None:
    track = Tracker(body_from_proportions(1.75, distance_m=2.0), CAMERA, default_preset())
    with pytest.raises(ValueError, match=r"\(hip_height_m, .*Session\(\[body\], camera"):
        track.track(silhouette(person(1.75, -0.62)))


@pytest.mark.parametrize(
    ("stddev", "at_s", "scale"), [(0.05, 0.0, 0.9), (0.15, 0.0, 0.979), (0.05, 9.0, 1.0)]
)
def test_a_body_is_as_large_as_the_person_is_far(
    monkeypatch: pytest.MonkeyPatch, stddev: float, at_s: float, scale: float
) -> None:
    """Two measures of a scale, 1 and 0.81, are weighted by their variances: 0.9 for equal ones."""
    fitted = person(1.75, -0.62)
    seen = sights(monkeypatch, [(fitted, 0.9)])
    seen.see(silhouette(fitted), None, 0.0)
    far = Distances(np.array([at_s]), np.array([0.81 * fitted.placement.distance_m]), stddev)
    found = seen.in_film(far)
    assert found.sizes == pytest.approx(scale * fitted.sizes, rel=1e-3)
    assert found.placement.distance_m == pytest.approx(
        scale * fitted.placement.distance_m, rel=1e-3
    )


def test_a_new_version_of_the_body_goes_on_with_the_posture(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    true = person(1.75, -0.62)
    track = Followed(distance_m=2.0)
    seen = silhouette(true, 1.0)
    for _ in range(10):
        found = track.track(seen)
    first, age = track.body, track.age
    assert found.keypoints_m is not None
    before_m = found.keypoints_m
    for _ in range(8):
        found = track.track(seen)
    assert track.body is not first
    assert track.age == age + 8
    assert found.posture is not None
    assert found.keypoints_m == pytest.approx(before_m, abs=0.05)
    assert found.posture[4] == pytest.approx(np.radians(20) + 1.0, abs=0.3)


def test_who_comes_in_at_a_side_is_measured_when_the_trunk_is_in_the_image() -> None:
    track = Followed(distance_m=2.0)
    true = person(1.75, -0.62)
    for lateral_m in np.linspace(1.3, 0.0, 27):
        # The side of the image is 1.07 m from its middle there; arms may be beyond it.
        found = track.track(silhouette(true.with_values(lateral_m=lateral_m)))
        assert bool(track.body.unknown) == (lateral_m > 0.87)
        # The front posture of the body, twice as wide as the shoulders, is in the image.
        most_m = 2.0 * 159.5 / 300.0 - track.body.size("shoulder_breadth")
        assert track.body.placement.lateral_m <= most_m + 1e-9
    assert track.body.placement.hip_height_m == pytest.approx(-0.62, abs=0.05)
    assert found.iou is not None
    assert found.iou > 0.85


def test_who_is_lost_is_sought_where_the_better_body_stands(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    true = person(1.75, -0.62)
    wrong = true.with_values(distance_m=1.0, lateral_m=-1.2)
    fits = iter([FirstSight(wrong, 0.65), FirstSight(true, 0.9)])
    monkeypatch.setattr(seen_body, "fit_first_sight", lambda *_: next(fits))
    track = Followed()
    found = [track.track(silhouette(true)) for _ in range(17)]
    assert found[14].posture is None
    assert found[-1].iou is not None
    assert found[-1].iou > 0.85
    assert track.body.placement == true.placement


def test_a_detected_person_may_be_small() -> None:
    far = silhouette(person(1.75, -0.62).with_values(distance_m=18.0))
    assert first_sight.upper_body(far) is None
    assert first_sight.upper_body(far, is_detected=True) is not None


def test_nobody_is_measured_where_the_camera_did_not_look_at_half_of_the_trunk() -> None:
    seen = silhouette(person(1.75, -0.62))
    columns = np.flatnonzero(seen.any(axis=0))
    middle, border = int(columns.mean()), int(columns[0]) - 10
    for end, is_whole in ((middle, False), (border, True)):
        covered = np.zeros_like(seen)
        covered[:, :end] = 255
        left = np.where(covered > 0, np.uint8(0), seen)
        for view in (slice(None), slice(None, None, -1)):
            turned = np.ascontiguousarray(left[:, view]), covered[:, view]
            found = first_sight.upper_body(turned[0], True, turned[1])
            assert (found is not None) == is_whole
            assert first_sight.upper_body(turned[0], is_detected=True) is not None


def test_the_same_seed_gives_the_same_body() -> None:
    seen = silhouette(person(1.75, -0.62))
    bodies = []
    for _ in range(2):
        track = Followed(distance_m=2.0)
        track.track(seen)
        bodies.append(track.body)
    assert bodies[0] == bodies[1]


def test_a_measured_body_is_never_changed() -> None:
    body = person(1.75, -0.62)
    track = Tracker(body, CAMERA, default_preset())
    track.track(silhouette(person(1.75, -0.62, BROAD)))
    assert track.body is body
