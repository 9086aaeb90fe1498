"""A person who walks to the camera or away from it, appears elsewhere, or stands too near."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.applications.simulation.renderer import Renderer
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture, state_limits
from cardbox_tracker.person.skeleton import KeypointState
from cardbox_tracker.search.approach import Approach, at_distances, placed_upright
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.search.doubt import HANDS, Source, models
from cardbox_tracker.search.visibility import is_trackable
from cardbox_tracker.terms.multi_view import MultiViewCost
from cardbox_tracker.terms.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.tracking.estimate import LOST, TRACKING, Estimate
from cardbox_tracker.tracking.tracker import Tracker

DOUBTFUL_ABOVE = models()[Source.MEASURED].doubtful_from
CAMERA = Camera(320, 240, 220.0, 220.0, 159.5, 119.5)
HIP_HEIGHT_M = -0.51
FRONT = reference_posture("front")


def seen_at(distances_m: list[float], body_m: float) -> list[Estimate]:
    """Estimates of a person measured at ``body_m`` who is at these distances, one each frame."""
    renderer = Renderer(CAMERA, np.random.default_rng(0))
    body = BodyModel.of(distance_m=body_m, hip_height_m=HIP_HEIGHT_M)
    tracker = Tracker(body, CAMERA, default_preset(), np.random.default_rng(0))
    return [
        tracker.track(renderer.silhouette(body.with_values(distance_m=there_m), FRONT))
        for there_m in distances_m
    ]


def distance_of(estimate: Estimate, body_m: float) -> float:
    assert estimate.offset_m is not None, estimate.state
    return body_m - float(estimate.offset_m[0])


@pytest.mark.parametrize(("begin_m", "end_m"), [(3.0, 1.6), (2.0, 4.5)])
def test_a_person_who_walks_metres_is_followed(begin_m: float, end_m: float) -> None:
    steps = round(15 * abs(end_m - begin_m))
    way = np.linspace(begin_m, end_m, steps).tolist()
    found = seen_at([begin_m] * 5 + way + [end_m] * 25, begin_m)
    assert distance_of(found[-1], begin_m) == pytest.approx(end_m, rel=0.06)
    # Far away a keypoint may be in doubt, and the state follows the hands.
    assert found[-1].keypoint_chances is not None and found[-1].keypoint_states is not None
    is_sure = bool((found[-1].keypoint_chances[HANDS] <= DOUBTFUL_ABOVE).all())
    assert (found[-1].state == TRACKING) == is_sure
    assert KeypointState.LOST not in found[-1].keypoint_states


def test_nobody_is_sought_where_a_steep_camera_does_not_see_the_body() -> None:
    """7 m away, with the hips as low as here, the body would be above the image."""
    body = BodyModel.of(distance_m=2.28, hip_height_m=-1.64, camera_pitch_rad=np.radians(30.0))
    view = Camera(320, 240, 514.0, 514.0, 159.5, 119.5)
    renderer = Renderer(view.with_pitch(np.radians(30.0)), np.random.default_rng(0))
    tracker = Tracker(body, view, default_preset(), np.random.default_rng(0))
    found = tracker.track(renderer.silhouette(body, FRONT))
    assert distance_of(found, 2.28) == pytest.approx(2.28, rel=0.1)
    assert found.iou is not None and found.iou > 0.7


@pytest.mark.parametrize("there_m", [1.4, 4.0])
def test_a_person_who_appears_elsewhere_is_found(there_m: float) -> None:
    found = seen_at([there_m] * 20, 2.2)
    assert distance_of(found[-1], 2.2) == pytest.approx(there_m, rel=0.12)


def test_a_person_who_suddenly_is_much_nearer_is_found_again() -> None:
    """The silhouette is more than ``largest_person`` for a while, as in another light."""
    found = seen_at([4.0] * 5 + [1.3] * 40, 4.0)
    assert found[6].state == LOST
    assert distance_of(found[-1], 4.0) == pytest.approx(1.3, rel=0.15)


def test_a_person_too_near_is_not_tracked() -> None:
    way = np.linspace(1.5, 0.65, 25).tolist()
    found = seen_at([1.5] * 5 + way + [0.65] * 10, 1.5)
    assert TRACKING not in {estimate.state for estimate in found[-5:]}


def made(distance_m: float = 2.0) -> MultiViewCost:
    body = BodyModel.of(distance_m=distance_m, hip_height_m=HIP_HEIGHT_M)
    return MultiViewCost(body, CAMERA, [], WholeBodyCostConfig())


@pytest.mark.parametrize(
    ("x_m", "y_m", "is_enough"),
    [
        (0.0, 0.0, True),
        (0.6, 0.0, True),
        (1.4, 0.0, False),  # 0.6 m from the camera
        (-2.0, 0.0, True),
        (-7.5, 0.0, False),  # the shoulders are a few pixels wide
        (0.0, 1.5, False),  # beside the image
    ],
)
def test_what_can_be_tracked(x_m: float, y_m: float, is_enough: bool) -> None:
    state = np.append(FRONT, [x_m, 0.0])
    state[0] = y_m
    assert is_trackable(made(), state) is is_enough


@pytest.mark.parametrize(("there_m", "is_found"), [(2.07, False), (2.1, True)])
def test_another_distance_has_to_fit_much_better(there_m: float, is_found: bool) -> None:
    """The next distance that is tried is 2.17 m."""
    body, state = BodyModel.of(distance_m=there_m, hip_height_m=HIP_HEIGHT_M), np.zeros(14)
    state[:12] = FRONT
    shown = render(cardbox_patches(body, FRONT), CAMERA)
    assert (placed_upright(made(), [shown], state, state) is not None) == is_found


WIDE = np.tile([-20.0, 20.0], (14, 1))


@given(st.floats(0.5, 10.0), st.floats(-1.0, 1.0))
def test_another_distance_keeps_the_column_of_the_image(there_m: float, y_m: float) -> None:
    state = np.append(FRONT, [0.0, 0.0])
    state[0] = y_m
    (moved,) = at_distances(state, np.array([there_m]), 2.0, WIDE)
    assert 2.0 - moved[12] == pytest.approx(there_m)
    assert moved[0] / there_m == pytest.approx(y_m / 2.0)
    np.testing.assert_array_equal(moved[1:12], state[1:12])


def test_a_person_who_sways_keeps_the_home() -> None:
    approach = Approach(0.02)
    for number in range(100):
        x_m = 0.06 * np.sin(number / 5.0)
        approach.see(x_m)
        assert approach.expected_m == pytest.approx(x_m)
        assert abs(approach.home_m) < 0.03


def test_a_person_who_walks_is_expected_further_on() -> None:
    approach = Approach(0.02)
    way = np.linspace(0.0, 3.0, 46).tolist()
    for x_m in way:
        approach.see(x_m)
    assert approach.expected_m == pytest.approx(3.0 + way[1], abs=0.01)
    assert approach.home_m == pytest.approx(approach.expected_m)


def test_the_states_of_a_walk_stay_within_the_limits_of_the_body() -> None:
    low, high = state_limits(1.5).T
    for estimate in seen_at(np.linspace(1.5, 0.3, 20).tolist(), 1.5):
        if estimate.offset_m is not None:
            state = np.append(estimate.posture, estimate.offset_m)
            assert (state >= low).all() and (state <= high).all()
