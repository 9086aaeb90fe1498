"""A body from proportions finds its place and breadths by itself, and again for the next person."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from cardbox_tracker.applications.simulation.renderer import Renderer, Scene
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.measuring import first_sight
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.person.proportions import body_from_proportions, sizes_of_stature
from cardbox_tracker.person.sizes import SIZE_INDEX
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.tracking import fitting
from cardbox_tracker.tracking.estimate import TRACKING, UNCERTAIN
from cardbox_tracker.tracking.tracker import Tracker

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
NOBODY = np.zeros((240, 320), np.uint8)
BROAD = 1.25
SHIRTS = ((40, 60, 200), (200, 90, 30))


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
    renderer = Renderer(CAMERA, Scene(), np.random.default_rng(0))
    seen: np.ndarray = renderer.silhouette(body, posture)
    return seen


def tracker(**given: float) -> Tracker:
    guess = body_from_proportions(1.75, **given)  # type: ignore[arg-type]
    return Tracker(guess, CAMERA, default_preset(), np.random.default_rng(1))


@pytest.mark.parametrize("raised_rad", [0.0, 1.0])
def test_height_and_breadth_are_found_at_first_sight(raised_rad: float) -> None:
    true = person(1.75, -0.62, BROAD)
    track = tracker(distance_m=2.0)
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
    track = tracker()
    track.track(silhouette(person(1.75, -0.6)))
    assert track.body.placement.distance_m == pytest.approx(2.0, rel=0.25)


def test_what_was_given_is_kept() -> None:
    track = tracker(distance_m=2.0, hip_height_m=-0.6, shoulder_breadth_m=0.4)
    track.track(silhouette(person(1.75, -0.6)))
    assert track.body.size("shoulder_breadth") == pytest.approx(0.4)
    assert track.body.placement.distance_m == pytest.approx(2.0)
    assert track.body.placement.hip_height_m == pytest.approx(-0.6)


def test_until_somebody_is_seen_whole_nothing_is_sure() -> None:
    track = tracker(distance_m=2.0)
    beheaded = silhouette(person(1.75, 0.2))
    assert beheaded[0].any()
    assert track.track(NOBODY).state == "no_person"
    assert track.track(beheaded).state in (UNCERTAIN, "lost", "no_person")
    assert track.body.unknown


def test_the_next_person_is_fitted_after_the_image_was_empty() -> None:
    track = tracker(distance_m=2.0)
    first, second = person(1.75, -0.62, BROAD), person(1.75, -0.62, 1 / BROAD)
    track.track(silhouette(first))
    fitted = track.body
    track.track(silhouette(first))
    assert track.body is fitted
    for _ in range(6):
        track.track(NOBODY)
    track.track(silhouette(second))
    assert track.body is not fitted
    assert track.body.size("waist_width") < fitted.size("waist_width")


@pytest.mark.parametrize("is_other", [True, False])
def test_the_next_person_is_told_by_the_clothes(is_other: bool) -> None:
    track = tracker(distance_m=2.0)
    seen = silhouette(person(1.75, -0.62))
    first, second = (np.where(seen[..., None] > 0, c, 90).astype(np.uint8) for c in SHIRTS)
    track.track(seen, first)
    fitted = track.body
    for _ in range(12):
        track.track(seen, first)
    assert track.body is fitted
    for _ in range(12):
        track.track(seen, second if is_other else first)
    assert (track.body is not fitted) == is_other
    assert track.body.unknown == ()


def test_what_does_not_fit_is_not_tried_with_every_image(monkeypatch: pytest.MonkeyPatch) -> None:
    tries: list[int] = []

    def refuse(*_: object) -> None:
        tries.append(1)
        raise InitializationError("nothing fits")

    monkeypatch.setattr(fitting, "fit_first_sight", refuse)
    track = tracker(distance_m=2.0)
    seen = silhouette(person(1.75, -0.62))
    for _ in range(50):
        track.track(seen)
    assert 2 <= len(tries) <= 3
    assert track.body.unknown


def test_a_poor_fit_is_used_until_a_better_one_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    guess, good = body_from_proportions(1.75), person(1.75, -0.62)
    poor = [guess.with_values(distance_m=distance_m) for distance_m in (2.2, 2.4)]
    fits = iter(
        SimpleNamespace(body=body, iou=iou, clothes=None)
        for body, iou in ((poor[0], 0.5), (poor[1], 0.4), (good, 0.9))
    )
    monkeypatch.setattr(fitting, "fit_first_sight", lambda *_: next(fits))
    decides = fitting.Fitting(guess, CAMERA, default_preset(), np.random.default_rng(0))
    used = [decides.before(silhouette(good), None) for _ in range(60)]
    assert [body for body in used if body is not None] == [poor[0], good]


def test_a_detected_person_may_be_small() -> None:
    far = silhouette(person(1.75, -0.62).with_values(distance_m=18.0))
    assert first_sight.upper_body(far) is None
    assert first_sight.upper_body(far, is_detected=True) is not None


@pytest.mark.parametrize(("usual", "is_kept"), [(0.75, True), (0.65, False)])
def test_a_fit_for_the_worse_is_taken_back(
    monkeypatch: pytest.MonkeyPatch, usual: float, is_kept: bool
) -> None:
    """Who bows fits worse, and so does what is fitted to them then once they stand again."""
    bodies = [person(1.75, -0.62), person(1.5, -0.5)]
    fits = (SimpleNamespace(body=body, clothes=None) for body in bodies)
    monkeypatch.setattr(fitting, "fit_first_sight", lambda *_: next(fits))
    guess = body_from_proportions(1.75)
    decides = fitting.Fitting(guess, CAMERA, default_preset(), np.random.default_rng(0))
    seen = silhouette(bodies[0])
    assert decides.before(seen, None) is bodies[0]
    for _ in range(20):
        decides.after(True, 0.8)
        assert decides.before(seen, None) is None
    for _ in range(5):
        decides.after(True, 0.6)
    assert decides.before(seen, None) is bodies[1]
    used = []
    for _ in range(12):
        decides.after(True, usual)
        used.append(decides.before(seen, None))
    found = [body for body in used if body is not None]
    assert found == ([] if is_kept else [bodies[0]])


def test_the_same_seed_gives_the_same_body() -> None:
    seen = silhouette(person(1.75, -0.62))
    bodies = []
    for _ in range(2):
        track = tracker(distance_m=2.0)
        track.track(seen)
        bodies.append(track.body)
    assert bodies[0] == bodies[1]


def test_a_measured_body_is_never_changed() -> None:
    body = person(1.75, -0.62)
    track = Tracker(body, CAMERA, default_preset())
    track.track(silhouette(person(1.75, -0.62, BROAD)))
    assert track.body is body
