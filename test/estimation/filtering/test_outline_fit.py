"""The result moves onto the silhouettes' outlines, by little."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import reference_posture, state_limits
from cardbox_tracker.estimation.cost.compiled import CompiledSilhouette
from cardbox_tracker.estimation.cost.terms import Frame
from cardbox_tracker.estimation.cost.view import OtherCamera, View
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.estimation.filtering.outline_fit import OutlineFit, signed_distances
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.extrinsics import Extrinsics

STATE_LIMITS = state_limits(2.3)
CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
BODY = BodyModel.of(distance_m=2.3, hip_height_m=-0.45)
COST = WholeBodyCost(BODY, CAMERA, WholeBodyCostConfig())
TRUTH = np.append(reference_posture("arms"), [0.0, 0.0])
_FINER = 8


def drawn(
    camera: Camera = CAMERA, state: np.ndarray = TRUTH, cost: WholeBodyCost = COST
) -> np.ndarray:
    """The silhouette (H, W) of a state; large at first, for a polygon is filled with its border."""
    large = np.zeros((_FINER * camera.height, _FINER * camera.width), np.uint8)
    for patch in camera.project(cost.corners(state)):
        cv2.fillConvexPoly(large, cv2.convexHull(np.int32(_FINER * (patch + 0.5))), 255)
    shares = cv2.resize(large, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    return np.where(shares > 127, 255, 0).astype(np.uint8)


def frame(silhouette: np.ndarray, camera: Camera = CAMERA) -> Frame:
    return CompiledSilhouette(BODY, camera).frame(silhouette)


def error_m(state: np.ndarray) -> float:
    apart = COST.keypoints(state) - COST.keypoints(TRUTH)
    return float(np.linalg.norm(apart, axis=1).mean())


@pytest.mark.parametrize("camera", [CAMERA, CAMERA.scaled(640, 480), CAMERA.scaled(160, 120)])
@pytest.mark.parametrize(
    "wrong",
    [{12: 0.08}, {12: -0.08}, {0: 0.05}, {1: 0.06}, {4: 0.1, 8: -0.1}, {12: 0.06, 13: 0.03}],
    ids=str,
)
def test_it_comes_nearer_to_the_truth(wrong: dict[int, float], camera: Camera) -> None:
    begin = TRUTH.copy()
    for joint, off in wrong.items():
        begin[joint] += off
    fit = OutlineFit(COST, camera, 5)
    assert error_m(fit([frame(drawn(camera), camera)], begin)) < 0.85 * error_m(begin)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(-1.0, 1.0), min_size=14, max_size=14))
def test_whatever_the_state_it_moves_by_little_and_stays_finite(off: list[float]) -> None:
    begin = np.clip(TRUTH + off, *STATE_LIMITS.T)
    found = OutlineFit(COST, CAMERA, 2)([frame(drawn())], begin)
    assert np.isfinite(found).all()
    assert np.abs(found - begin).max() <= 2 * 0.25 + 1e-9


def test_what_hair_adds_is_not_followed() -> None:
    silhouette = drawn()
    rows, columns = np.nonzero(silhouette)
    top, middle = int(rows.min()), int(np.median(columns[rows == rows.min()]))
    cv2.circle(silhouette, (middle, top), 18, 255, -1)
    assert error_m(OutlineFit(COST, CAMERA, 3)([frame(silhouette)], TRUTH)) < 0.03


@pytest.mark.parametrize("silhouette", [np.zeros((240, 320)), np.full((240, 320), 255)])
def test_nobody_and_everything_change_nothing_much(silhouette: np.ndarray) -> None:
    found = OutlineFit(COST, CAMERA, 2)([frame(silhouette.astype(np.uint8))], TRUTH)
    np.testing.assert_allclose(found, TRUTH, atol=0.02)


def test_with_depth_or_without_steps_the_state_stays() -> None:
    begin = TRUTH.copy()
    begin[12] += 0.08
    seen = frame(drawn())
    np.testing.assert_array_equal(OutlineFit(COST, CAMERA, 0)([seen], begin), begin)
    deep = replace(seen, depth_m=np.full((240, 320), 2.3, np.float32))
    np.testing.assert_array_equal(OutlineFit(COST, CAMERA, 3)([deep], begin), begin)


def aside() -> View:
    """A camera as far from the person as the first one, 60 degrees round to their left."""
    c, s = np.cos(np.pi / 3), np.sin(np.pi / 3)
    turn = np.array([(c, 0.0, s), (0.0, 1.0, 0.0), (-s, 0.0, c)])
    centre = np.array([0.0, 0.0, 2.3]) + turn.T @ [0.0, 0.0, -2.3]
    return View.of(BODY, CAMERA, OtherCamera(CAMERA, Extrinsics(turn, -turn @ centre)))


def test_a_second_camera_shows_what_the_first_one_does_not() -> None:
    view = aside()
    there = WholeBodyCost(view.body, view.camera, WholeBodyCostConfig())
    # An arm forward, wrong by what the first camera hardly sees.
    truth = TRUTH.copy()
    truth[5] += 0.3
    begin = truth.copy()
    begin[[3, 5, 12]] += 0.1, 0.2, 0.06
    seen = [
        frame(drawn(state=truth)),
        frame(drawn(view.camera, view.states(truth), there), view.camera),
    ]

    def error(fit: OutlineFit) -> float:
        found = COST.keypoints(fit(seen, begin)) - COST.keypoints(truth)
        return float(np.linalg.norm(found, axis=1).mean())

    both = OutlineFit(COST, CAMERA, 6, [(there, view)])
    first, other = (OutlineFit(COST, CAMERA, 6, [(there, view)]) for _ in range(2))
    first.seeing, other.seeing = (0,), (1,)
    assert error(both) < 0.8 * error(first)
    assert error(both) < error(other)
    assert error(both) < 0.04
    # The first camera alone is what one camera is.
    np.testing.assert_array_equal(
        first.fitted(seen, begin, 2),
        OutlineFit(COST, CAMERA, 2).fitted(seen[:1], begin, 2),
    )


def test_corrections_are_smoothed_until_it_is_forgotten() -> None:
    begin, seen = TRUTH.copy(), [frame(drawn())]
    begin[12] += 0.08
    fit = OutlineFit(COST, CAMERA, 3)
    first = fit(seen, begin) - begin
    # Of a state that is right, a part of the last correction is left.
    after = fit(seen, TRUTH) - TRUTH
    assert abs(after[12]) == pytest.approx(0.6 * abs(first[12]), abs=0.02)
    fit.forget()
    assert abs(fit(seen, TRUTH)[12]) < 0.02


def test_distances_are_signed_and_cover_what_is_seen() -> None:
    silhouette = np.zeros((60, 80), np.uint8)
    silhouette[20:40, 30:50] = 255
    left, top, field, within = signed_distances(silhouette, 60.0)
    assert field[30 - top, 40 - left] == pytest.approx(-10.0, abs=1.0)
    assert field[30 - top, 25 - left] == pytest.approx(5.0, abs=1.0)
    # 12 px around the foreground, less a border of 3 px.
    shift = np.array([left, left, top, top])
    np.testing.assert_array_equal(within + shift, [21, 58, 11, 49])
    assert signed_distances(silhouette, -100.0)[2].size == 0
