"""Tracking with several cameras: their geometry, the summed cost, and cameras that drop out."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import cv2
import numpy as np
import pytest

from cardbox_tracker.applications.simulation.motions import wave
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.view import OtherCamera, View
from cardbox_tracker.common.errors import CameraError, InitializationError
from cardbox_tracker.common.settings import Settings
from cardbox_tracker.detectors.image_points import POINT_INDEX, ImagePoints
from cardbox_tracker.measuring.scale import DepthReference, depth_scale, measured_scale, scaled
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture
from cardbox_tracker.search.arm_search import ARM_LIMITS
from cardbox_tracker.search.config import default_preset, paper_preset
from cardbox_tracker.search.whole_body import WholeBodyFilter
from cardbox_tracker.search.whole_body_config import SEVERAL_CAMERAS
from cardbox_tracker.terms.depth import Depth, DepthTerm
from cardbox_tracker.terms.multi_view import MultiViewCost
from cardbox_tracker.terms.term import ARM, TRUNK, Frame, Posed, TermObservation
from cardbox_tracker.terms.whole_body import WholeBodyCost
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.tracking.estimate import NO_PERSON, TRACKING, UNCERTAIN, Estimate
from cardbox_tracker.tracking.observation import Observation, stamp_of
from cardbox_tracker.tracking.tracker import Tracker

BODY = BodyModel.of(hip_height_m=-0.41, lateral_m=0.05, camera_pitch_rad=0.1)
CAMERA = Camera(160, 120, 150.0, 151.0, 79.0, 60.0).with_pitch(0.1)
CONFIG = WholeBodyCostConfig()


def aside(roll_rad: float = 0.0, angle_rad: float = 1.2) -> OtherCamera:
    """A camera 2 m from the person, ``angle_rad`` round to their left, turned by ``roll_rad``."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    turn = np.array([(c, 0.0, s), (0.0, 1.0, 0.0), (-s, 0.0, c)])
    middle = np.array([0.0, 0.2, 2.0])
    centre = middle + 2.0 * turn.T @ [0.0, -0.1, -1.0]
    turn = cv2.Rodrigues(np.array([0.0, 0.0, roll_rad]))[0] @ turn
    camera = Camera(160, 120, 140.0, 141.0, 82.0, 58.0)
    return OtherCamera(camera, Extrinsics(turn, -turn @ centre))


def drawn(cost: WholeBodyCost, camera: Camera, state: np.ndarray) -> np.ndarray:
    """The model's own outline, as it is drawn to be rated."""
    image = np.zeros((camera.height, camera.width), np.uint8)
    for patch in cost.corners(state):
        pixels = np.round(16 * camera.project(patch)).astype(np.int32)
        cv2.fillConvexPoly(image, pixels, 255, cv2.LINE_8, 4)
    return image


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


FIRST = WholeBodyCost(BODY, CAMERA, CONFIG)
OTHER = aside()
VIEW = View.of(BODY, CAMERA, OTHER)
SECOND = WholeBodyCost(VIEW.body, VIEW.camera, CONFIG)


def state_of(time_s: float, x_m: float = 0.0) -> np.ndarray:
    return np.append(wave(time_s), [x_m, 0.0])


def both(state: np.ndarray) -> list[np.ndarray]:
    return [drawn(FIRST, CAMERA, state), drawn(SECOND, VIEW.camera, VIEW.states(state))]


@pytest.mark.parametrize("roll_rad", [0.0, 0.02, -0.6, 1.57, 3.1, -1.5])
def test_another_camera_sees_the_same_points(roll_rad: float, rng: np.random.Generator) -> None:
    other = aside(roll_rad)
    view = View.of(BODY, CAMERA, other)
    cost = WholeBodyCost(view.body, view.camera, CONFIG)
    pixel = np.zeros((120, 160), np.uint8)
    for state in rng.normal(0.0, 0.2, (4, 14)):
        there = FIRST.keypoints(state) @ other.extrinsics.rotation.T
        expected = other.camera.project(there + other.extrinsics.translation_m)
        keypoints_m = cost.keypoints(view.states(state))
        first_m = CAMERA.with_pitch(BODY.camera_pose.pitch_rad).optical_to_reference(
            FIRST.keypoints(state)
        )
        moved_m = view.camera.reference_to_optical(view.points(first_m))
        np.testing.assert_allclose(moved_m, keypoints_m, atol=1e-6)
        found = view.camera.project(keypoints_m)
        if view.turn is None:
            np.testing.assert_allclose(found, expected, atol=1e-6)
            continue
        # The upright image has at the one what the camera's image has at the other.
        u, v = np.round(expected[0]).astype(int)
        pixel[:] = 0
        cv2.circle(pixel, (int(u), int(v)), 4, 255, -1)
        turned = np.argwhere(view.upright(pixel, is_mask=True))[:, ::-1]
        assert len(turned) > 20
        np.testing.assert_allclose(turned.mean(axis=0), found[0], atol=1.0)


def test_lines_of_sight_meet_at_the_hips() -> None:
    state = state_of(0.3, 0.2)
    there = VIEW.states(state)
    bearing = float(there[0] / (VIEW.body.placement.distance_m - there[12]))
    place, ahead = (np.array(one) for one in VIEW.line_of_sight(bearing))
    hips = np.array([state[12] - BODY.placement.distance_m, state[0]])
    across = (hips - place) - ahead * ((hips - place) @ ahead)
    np.testing.assert_allclose(across, 0.0, atol=1e-9)
    assert ahead @ (hips - place) > 1.0


def test_a_camera_behind_the_person_s_place_is_refused() -> None:
    away = Extrinsics(np.diag([-1.0, 1.0, -1.0]), np.array([0.0, 0.0, 0.5]))
    with pytest.raises(CameraError, match="in front of it"):
        View.of(BODY, CAMERA, OtherCamera(OTHER.camera, away))


def test_the_rating_is_the_mean_of_the_cameras_with_priors_once() -> None:
    views = MultiViewCost(BODY, CAMERA, [VIEW], CONFIG)
    states = np.array([state_of(t) for t in (0.0, 0.2, 0.4)])
    views.see(both(states[1]), states[1])
    views.choose((0, 1))
    ratings, costs_px, _, _ = views.bodies(states)
    alone = [cost.bodies(to(states)) for cost, to in zip(views.costs, views.to_views, strict=True)]
    shares = [a[1] / c.silhouette_px for a, c in zip(alone, views.costs, strict=True)]
    priors = alone[0][0] - shares[0]
    np.testing.assert_allclose(alone[1][0], shares[1], atol=1e-12)
    np.testing.assert_allclose(ratings, (shares[0] + shares[1] + priors) / 2, atol=1e-12)
    np.testing.assert_allclose(costs_px, alone[0][1] + alone[1][1])
    assert np.argmin(costs_px) == 1
    # A camera that does not see leaves the other one, and the priors.
    for seeing in ((0,), (1,)):
        views.see(both(states[1]), states[1])
        views.choose(seeing)
        np.testing.assert_allclose(
            views.bodies(states).ratings, shares[seeing[0]] + priors, atol=1e-12
        )


def test_terms_of_each_camera_get_the_number_of_pixels_that_count() -> None:
    """Otherwise a camera whose silhouette has legs would weigh its points twice."""
    counted_px = []

    class Counting:
        def observe(self, frame: Frame) -> None:
            counted_px.append(frame.foreground_px)

    views, state = MultiViewCost(BODY, CAMERA, [VIEW], CONFIG), state_of(0.2)
    silhouettes = both(state)
    views.see(silhouettes, state)
    views.choose((0, 1))
    frames = [Frame(CAMERA, {"silhouette": one}, 120, 10**6) for one in silhouettes]
    views.observe(frames, [[Counting()], [Counting()]])
    # A term without an observation of this frame does not count.
    assert [cost.terms for cost in views.costs] == [(), ()]
    assert counted_px == [cost.silhouette_px for cost in views.costs]
    assert min(counted_px) > 500


def track(tracker: Tracker, state: np.ndarray, seeing: tuple[int, ...] = (0, 1)) -> Estimate:
    seen = [s if i in seeing else None for i, s in enumerate(both(state))]
    return tracker.track([Observation(one) for one in seen])


def test_of_four_arms_that_are_proposed_the_most_promising_one_is_rated(
    rng: np.random.Generator,
) -> None:
    tracker = Tracker(BODY, CAMERA, default_preset(), others=[OTHER])
    track(tracker, state_of(0.3))
    assert isinstance(tracker.filter, WholeBodyFilter)
    views, search = tracker.filter._cost, tracker.filter._arm
    low, high = ARM_LIMITS.T
    arms = low + (high - low) * rng.random((40, 4))
    assert search.promising(arms, 0, 1) is arms
    kept = search.promising(arms, 0, SEVERAL_CAMERAS.candidates)
    assert SEVERAL_CAMERAS.candidates == 4
    each = views.arms_by_points(arms, 0).reshape(10, 4)
    np.testing.assert_array_equal(views.arms_by_points(kept, 0), each.min(axis=1))
    # What either camera sees counts, and of a camera that does not see nothing does.
    alone = [cost.arms_by_points(arms, cost.joints(arms, 0), 0) for cost in views.costs]
    np.testing.assert_allclose(each.ravel(), (alone[0] + alone[1]) / 2)
    track(tracker, state_of(0.4), (1,))
    second = views.costs[1].arms_by_points(arms, views.costs[1].joints(arms, 0), 0)
    np.testing.assert_allclose(views.arms_by_points(arms, 0), second, atol=1e-12)


def error_cm(estimate: Estimate, state: np.ndarray) -> float:
    assert estimate.keypoints_m is not None
    distances = np.linalg.norm(estimate.keypoints_m - FIRST.keypoints(state), axis=1)
    return 100 * float(distances.mean())


def test_two_cameras_follow_and_any_of_them_may_drop_out() -> None:
    tracker = Tracker(BODY, CAMERA, default_preset(), others=[OTHER])
    errors, states = [], []
    for i in range(24):
        seeing = (0,) if 8 <= i < 12 else (1,) if 16 <= i < 20 else (0, 1)
        state = state_of(i / 15.0, 0.005 * i)
        estimate = track(tracker, state, seeing)
        errors.append(error_cm(estimate, state))
        states.append(estimate.state)
        ious = tracker.filter.ious()
        assert [n for n, iou in enumerate(ious) if iou is not None] == list(seeing)
        if len(seeing) == 1:
            assert ious[seeing[0]] == pytest.approx(estimate.iou)
    assert min(iou for iou in ious if iou is not None) > 0.85
    assert estimate.iou is not None
    assert estimate.iou > 0.8
    assert set(states[4:]) <= {TRACKING, UNCERTAIN}
    assert np.mean([errors[i] for i in (5, 6, 7, 14, 15, 22, 23)]) < 5.0
    assert max(errors[4:]) < 20.0
    assert track(tracker, state_of(0.0), ()).state == NO_PERSON
    assert tracker.filter.ious() == [None, None]


def test_a_second_camera_that_froze_is_not_used() -> None:
    """The person goes on waving, nearer, while the second camera shows one moment for ever."""
    tracker = Tracker(BODY, CAMERA, default_preset(), others=[OTHER])
    errors = []
    for i in range(20):
        state = state_of(i / 5.0, 0.03 * i)
        first, second = both(state)[0], both(state_of(min(i, 6) / 5.0, 0.03 * min(i, 6)))[1]
        estimate = tracker.track([Observation(first), Observation(second)])
        if i > 9:
            assert tracker.filter.ious()[1] is None
            errors.append(error_cm(estimate, state))
    assert max(errors) < 20.0
    assert any("camera 2 of 2 shows the same image" in text for text in tracker.remarks())
    assert tracker.images == 20 and 6 <= tracker.used["camera 2"] <= 10


def test_what_told_of_a_posture_is_counted() -> None:
    tracker = Tracker(BODY, CAMERA, default_preset().with_depth())
    first = both(state_of(0.0))[0]
    points = ImagePoints.of({"left_wrist": (80.0, 60.0, 0.9)})
    depth_m = np.full(first.shape, 2.0)
    for i in range(4):
        more = {"points": points} if i else {}
        tracker.track(Observation(first, depth_m=depth_m if i > 1 else None, **more))
    tracker.track(Observation(np.zeros_like(first), points=points))
    assert tracker.images == 5
    assert tracker.used == {"points": 3, "depth": 2}


def test_one_camera_is_a_list_of_one() -> None:
    trackers = [Tracker(BODY, CAMERA, default_preset()) for _ in range(3)]
    for i in range(3):
        silhouette, stamp_ns = both(state_of(i / 15.0))[0], (i + 1) * 10**8
        one = Observation(silhouette, stamp_ns=stamp_ns)
        estimates = [
            trackers[0].track(silhouette, stamp_ns=stamp_ns),
            trackers[1].track(one),
            trackers[2].track([one]),
        ]
        keypoints = [found.keypoints_m for found in estimates if found.keypoints_m is not None]
        assert len({each.tobytes() for each in keypoints}) == 1
        assert len(keypoints) == 3
        assert trackers[0].filter.ious() == [pytest.approx(estimates[0].iou)]


def test_the_stamp_of_a_time_is_that_of_the_first_camera_or_the_earliest() -> None:
    left, right, late = (Observation(stamp_ns=stamp_ns) for stamp_ns in (7, 5, 9))
    assert stamp_of([left, right]) == 7
    assert stamp_of([None, late, right]) == 5
    assert stamp_of([Observation(), None]) is None


def test_what_does_not_fit_several_cameras_is_refused() -> None:
    with pytest.raises(ValueError, match="whole_body"):
        Tracker(BODY, CAMERA, paper_preset(), others=[OTHER])
    tracker = Tracker(BODY, CAMERA, default_preset(), others=[OTHER])
    small = Observation(np.zeros((10, 10), np.uint8))
    with pytest.raises(ValueError, match=r"further camera .*\(10, 10\).*\(120, 160\)"):
        tracker.track([None, small])
    with pytest.raises(ValueError, match=r"3 observations.*2 cameras"):
        tracker.track([None] * 3)
    with pytest.raises(ValueError, match="stamp_ns"):
        tracker.track([None, None], stamp_ns=1)


def test_the_depth_of_the_right_place_costs_least() -> None:
    state = np.append(reference_posture("front"), [0.1, 0.0])
    silhouette = drawn(FIRST, CAMERA, state)
    hips = CAMERA.reference_to_optical(np.array([0.1 - BODY.placement.distance_m, 0.0, -0.1]))
    depth = np.where(silhouette > 0, hips[2] - 0.1, np.nan).astype(np.float32)
    states = np.tile(state, (5, 1))
    states[:, 12] += np.linspace(-0.4, 0.4, 5)
    term, body = DepthTerm(Depth(), BODY, CAMERA), FIRST.body
    observation = term.observe(seen_at(silhouette, depth_m=depth))
    assert observation is not None
    assert np.argmin(observation.rate(Posed(body, states))) == 2
    assert np.argmin(observation.rate(Posed(body, states, TRUNK))) == 2
    arms = np.tile(states[2], (2, 1))
    arms[1, 5] = 1.5  # straight at the camera, where nothing is
    costs = observation.rate(Posed(body, arms, ARM[0]))
    assert costs[0] < costs[1]
    # Of the other arm it says the same, and of a whole body the sum of its parts.
    parts = [observation.rate(Posed(body, arms, one)) for one in (TRUNK, *ARM)]
    assert parts[2][0] == parts[2][1]
    np.testing.assert_allclose(observation.rate(Posed(body, arms)), sum(parts))
    # Without a measured depth it says nothing.
    assert term.observe(seen_at(silhouette)) is None
    unknown = term.observe(seen_at(silhouette, depth_m=0 * depth))
    assert unknown is not None
    np.testing.assert_array_equal(unknown.rate(Posed(body, states)), 0.0)


def seen_at(silhouette: np.ndarray, **channels: np.ndarray) -> Frame:
    return Frame(CAMERA, {"silhouette": silhouette, **channels}, 120, 1)


def depth_of(cost: WholeBodyCost, camera: Camera, state: np.ndarray) -> np.ndarray:
    """The drawn model's depth: that of the nearest patch, metres; 0 beside it."""
    depth_m = np.full((camera.height, camera.width), np.inf, np.float32)
    for patch in cost.corners(state):
        mask = np.zeros(depth_m.shape, np.uint8)
        pixels = np.round(16 * camera.project(patch)).astype(np.int32)
        cv2.fillConvexPoly(mask, pixels, 255, cv2.LINE_8, 4)
        depth_m[mask > 0] = np.minimum(depth_m[mask > 0], patch[:, 2].mean())
    return np.where(np.isfinite(depth_m), depth_m, 0.0).astype(np.float32)


def raw_of(upright: np.ndarray, view: View, camera: Camera, nothing: float) -> np.ndarray:
    """The image of a camera whose upright image is ``upright``."""
    v, u = np.indices((camera.height, camera.width))
    pixels = view.upright_px(np.stack([u, v], -1).reshape(-1, 2).astype(np.float64))
    at = np.rint(pixels).astype(int).reshape(camera.height, camera.width, 2)
    inside = ((at >= 0) & (at < (upright.shape[1], upright.shape[0]))).all(axis=2)
    raw = np.full((camera.height, camera.width), nothing, upright.dtype)
    raw[inside] = upright[at[inside][:, 1], at[inside][:, 0]]
    return raw


@dataclass(frozen=True)
class Asking(Settings):
    """A term that keeps the frames of each camera, and says nothing."""

    frames: list[Frame] = field(default_factory=list)

    def build(self, person: BodyModel, camera: Camera) -> Asking:
        assert person.placement.distance_m > 0.0
        return self

    def observe(self, frame: Frame) -> TermObservation | None:
        self.frames.append(frame)
        return None


def test_terms_of_each_camera_see_its_own_upright_channels() -> None:
    """The second camera lies on its side; images, depth and points of it are turned upright."""
    other = aside(1.57)
    view = View.of(BODY, CAMERA, other)
    cost = WholeBodyCost(view.body, view.camera, CONFIG)
    asking = Asking()
    config = replace(default_preset(), terms=(asking,), select_person=False)
    tracker = Tracker(BODY, CAMERA, config, others=[other])
    state = state_of(0.3)
    there = view.states(state)
    upright = drawn(cost, view.camera, there), depth_of(cost, view.camera, there)
    mask, depth_m = (raw_of(one, view, other.camera, 0) for one in upright)
    there_px = other.camera.project(moved_to(other, state))[2]
    points = ImagePoints.of({"left_wrist": (*there_px, 0.9)})
    px = CAMERA.project(FIRST.keypoints(state))[2]
    first = Observation(
        drawn(FIRST, CAMERA, state), points=ImagePoints.of({"left_wrist": (*px, 0.9)})
    )
    image = np.repeat(mask[..., None], 3, axis=2)
    for _ in range(2):
        tracker.track([first, Observation(mask, image, depth_m, points=points)])
    one, two = asking.frames[-2:]
    assert (one.camera, two.camera) == (tracker.camera, view.camera)
    assert one.depth_m is None and two.depth_m is not None and two.image is not None
    assert two.depth_m.shape == two.silhouette.shape == two.image.shape[:2] == (160, 120)
    known = two.depth_m > 0.0
    agrees = np.isclose(two.depth_m[known], upright[1][known], atol=0.05)
    assert known.sum() > 500 and agrees.mean() > 0.9
    assert ((two.silhouette > 0) == (upright[0] > 0)).mean() > 0.98
    np.testing.assert_array_equal(two.image[..., 0], two.silhouette)
    for frame, joints_m in ((one, FIRST.keypoints(state)), (two, cost.keypoints(there))):
        assert frame.points is not None and frame.before is not None
        wrist_px = frame.points.px[POINT_INDEX["left_wrist"]]
        np.testing.assert_allclose(wrist_px, frame.camera.project(joints_m)[2], atol=1e-3)
        # The last posture is before this camera.
        assert np.linalg.norm(frame.before.keypoints_px[0] - frame.camera.project(joints_m)) < 60.0


def moved_to(other: OtherCamera, state: np.ndarray) -> np.ndarray:
    """The joints of a state of the first camera in another one's optical frame, metres."""
    there_m: np.ndarray = FIRST.keypoints(state) @ other.extrinsics.rotation.T
    return there_m + other.extrinsics.translation_m


@pytest.mark.parametrize("roll_rad", [0.0, 1.57])
def test_the_depth_of_a_second_camera_counts(roll_rad: float) -> None:
    """It alone sees the person, so its depth says how far away from it they are."""
    other = aside(roll_rad)
    view = View.of(BODY, CAMERA, other)
    cost = WholeBodyCost(view.body, view.camera, CONFIG)
    config = default_preset().with_depth()
    state = state_of(0.0)
    there = view.states(state)
    mask = raw_of(drawn(cost, view.camera, there), view, other.camera, 0)
    depth_m = depth_of(cost, view.camera, there)
    away_m = []
    for factor in (1.0, 1.08):
        raw_m = raw_of(factor * depth_m, view, other.camera, 0.0)
        tracker = Tracker(BODY, CAMERA, config, others=[other])
        for _ in range(30):
            estimate = tracker.track([None, Observation(mask, depth_m=raw_m)])
        assert estimate.keypoints_m is not None
        pose_of = other.extrinsics
        joints_m = estimate.keypoints_m @ pose_of.rotation.T + pose_of.translation_m
        away_m.append(float(joints_m[[0, 3], 2].mean()))
    # A deeper image of the same outline is a person farther away.
    assert away_m[1] - away_m[0] > 0.04


@pytest.mark.parametrize("guessed", [0.75, 1.3])
def test_a_second_camera_measures_how_far_away_the_person_is(guessed: float) -> None:
    references = {}
    for name in ("front", "arms"):
        state = np.append(reference_posture(name), [0.0, 0.0])
        state[0] = BODY.placement.lateral_m
        references[name] = drawn(SECOND, VIEW.camera, VIEW.states(state))
    found = measured_scale(scaled(BODY, guessed), CAMERA, OTHER, references)
    assert found * guessed == pytest.approx(1.0, abs=0.02)
    nobody = {"front": np.zeros((120, 160), np.uint8)}
    with pytest.raises(InitializationError, match="not show the person"):
        measured_scale(BODY, CAMERA, OTHER, nobody)


@pytest.mark.parametrize("unit", [0.1, 1.0, 3.28])
def test_extrinsics_of_another_unit_are_told_with_the_right_distance(unit: float) -> None:
    pose = OTHER.extrinsics
    given = replace(pose, translation_m=unit * pose.translation_m)
    tracker = Tracker(BODY, CAMERA, default_preset(), others=[replace(OTHER, extrinsics=given)])
    state = state_of(0.0)
    masks = drawn(FIRST, CAMERA, state), drawn(SECOND, VIEW.camera, VIEW.states(state))
    for _ in range(8):
        tracker.track(list(map(Observation, masks)))
    assert tracker.agreement is not None
    told = " ".join(tracker.agreement.remarks(["side"]))
    assert ("metres" in told) is (unit != 1.0)
    if unit != 1.0:
        right_m, shown_m = np.linalg.norm(pose.centre_m), float(told.split()[2])
        assert shown_m == pytest.approx(right_m, rel=0.15)


def seen_with_depth(before_m: float) -> dict[str, DepthReference]:
    """The references before CAMERA, their surface a plane ``before_m`` in front of the hips."""
    references = {}
    for name in ("front", "arms"):
        state = np.append(reference_posture(name), [0.0, 0.0])
        state[0] = BODY.placement.lateral_m
        silhouette = drawn(FIRST, CAMERA, state)
        hips = CAMERA.reference_to_optical(np.array([-BODY.placement.distance_m, 0.0, 0.0]))
        depth = np.where(silhouette > 0, hips[2] - before_m, 0.0).astype(np.float32)
        references[name] = DepthReference(silhouette, depth)
    return references


@pytest.mark.parametrize("guessed", [0.75, 1.3])
def test_depth_images_measure_how_far_away_the_person_is(guessed: float) -> None:
    found = depth_scale(scaled(BODY, guessed), CAMERA, seen_with_depth(0.1))
    assert found * guessed == pytest.approx(1.0, abs=0.03)


def test_depth_images_of_something_else_are_refused() -> None:
    with pytest.raises(InitializationError, match="distance"):
        depth_scale(BODY, CAMERA, seen_with_depth(-20.0))
    unknown = {
        name: one._replace(depth_m=0 * one.depth_m) for name, one in seen_with_depth(0).items()
    }
    with pytest.raises(InitializationError, match=r"0 pixels .*100"):
        depth_scale(BODY, CAMERA, unknown)


def test_an_upright_image_is_continued_and_a_mask_ends() -> None:
    view = View.of(BODY, CAMERA, aside(-0.6))
    white = np.full((120, 160), 255, np.uint8)
    assert (view.upright(white) == 255).all()
    mask = view.upright(white, is_mask=True)
    assert 0.05 < (mask == 0).mean() < 0.4 and set(mask.ravel().tolist()) == {0, 255}
    image = np.random.default_rng(0).integers(1, 255, (120, 160, 3), np.uint8)
    turned = view.upright(image)
    assert turned.dtype == np.uint8 and turned.shape == image.shape
    np.testing.assert_array_equal(turned[60, 80], image[tuple(view.turn[60, 80][::-1])])
    depth_m = np.linspace(1.0, 3.0, 120 * 160, dtype=np.float32).reshape(120, 160)
    assert view.upright(depth_m).dtype == np.float32


@pytest.mark.parametrize("roll_rad", [0.0, 0.02, -0.6, 1.57, 3.1, -1.5])
def test_points_of_a_turned_camera_go_where_its_pixels_go(roll_rad: float) -> None:
    view = View.of(BODY, CAMERA, aside(roll_rad))
    px = np.random.default_rng(0).uniform((0, 0), (view.camera.width, view.camera.height), (50, 2))
    raw = px @ view.raw_px[:, :2].T + view.raw_px[:, 2]
    np.testing.assert_allclose(view.upright_px(raw), px, atol=1e-9)
    assert np.isnan(view.upright_px(np.full((1, 2), np.nan))).all()
    if view.turn is None:
        np.testing.assert_array_equal(raw, px)
        return
    # Rounding to whole pixels moves a pixel by up to half of one.
    u, v = (np.arange(5, 100, 10), np.arange(5, 100, 10)[:, None])
    found = view.upright_px(view.turn[v, u].reshape(-1, 2).astype(np.float64))
    expected = np.stack(np.broadcast_arrays(u, v), axis=-1).reshape(-1, 2)
    assert np.abs(found - expected).max() < 0.8
