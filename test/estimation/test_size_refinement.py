"""Breadths move from what was measured towards what the images show, slowly and not far."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import reference_posture
from cardbox_tracker.body.sizes import DEFAULT_SIZES, SIZE_INDEX, SIZE_NAMES
from cardbox_tracker.estimation import size_refinement
from cardbox_tracker.estimation.config import default_preset, paper_preset
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.estimation.size_refinement import GROUPS, LARGEST_CHANGE, SizeRefinement
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.vision.camera import Camera

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
COST = WholeBodyCostConfig()
TRUNK = GROUPS["trunk"]
_FINER = 16


def body(trunk: float = 1.0) -> BodyModel:
    sizes = DEFAULT_SIZES.copy()
    for name in TRUNK:
        sizes[SIZE_INDEX[name]] *= trunk
    return BodyModel.of(sizes, distance_m=2.3, hip_height_m=-0.45)


def state() -> np.ndarray:
    return np.append(reference_posture("arms"), [0.0, 0.0])


def seen(true: BodyModel) -> np.ndarray:
    """The silhouette (H, W) of somebody, as the whole-body model draws them."""
    corners_m = WholeBodyCost(true, CAMERA, COST).corners(state())
    corners_px = CAMERA.fx * corners_m[..., :2] / corners_m[..., 2:] + (CAMERA.cx, CAMERA.cy)
    # Large first, since a polygon is filled with its border.
    large = np.zeros((_FINER * CAMERA.height, _FINER * CAMERA.width), np.uint8)
    for patch in corners_px:
        cv2.fillConvexPoly(large, cv2.convexHull(np.int32(_FINER * (patch + 0.5))), 255)
    shares = cv2.resize(large, (CAMERA.width, CAMERA.height), interpolation=cv2.INTER_AREA)
    return np.where(shares > 127, 255, 0).astype(np.uint8)


def refined(begin: BodyModel, true: BodyModel, monkeypatch: pytest.MonkeyPatch) -> list[BodyModel]:
    """The bodies of ten blocks in which the posture is known."""
    monkeypatch.setattr(size_refinement, "_BLOCK", 4)
    refinement, bodies, silhouette = SizeRefinement(begin, CAMERA, COST), [begin], seen(true)
    for _ in range(10 * 4 * 3):
        cost = WholeBodyCost(bodies[-1], CAMERA, COST)
        cost.see(silhouette, state())
        better = refinement.add(cost, state())
        if better is not None:
            bodies.append(better)
    return bodies


@pytest.mark.parametrize("wrong", [0.93, 1.07])
def test_a_wrong_breadth_comes_nearer_to_the_true_one(
    wrong: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    bodies = refined(body(wrong), body(), monkeypatch)
    off = [abs(np.log(one.size("waist_width") / body().size("waist_width"))) for one in bodies]
    assert off[-1] < 0.5 * off[0]
    # Never more than a step at once.
    changes = np.diff([np.log(one.size("waist_width")) for one in bodies])
    assert np.abs(changes).max() < 0.031


def test_lengths_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    last = refined(body(1.07), body(), monkeypatch)[-1]
    may_change = {name for names in GROUPS.values() for name in names}
    for name in set(SIZE_NAMES) - may_change:
        assert last.size(name) == body().size(name), name


def test_the_outline_never_overrules_what_was_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    bodies = refined(body(), body(1.6), monkeypatch)
    grown = bodies[-1].size("waist_width") / body().size("waist_width")
    assert 1.0 < grown <= np.exp(LARGEST_CHANGE) * 1.001


def test_right_breadths_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    last = refined(body(), body(), monkeypatch)[-1]
    np.testing.assert_allclose(last.sizes, body().sizes, rtol=0.015)


def test_tracking_goes_on_with_the_refined_body(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(size_refinement, "_BLOCK", 2)
    monkeypatch.setattr(size_refinement, "_LEAST_CHANGE", 0.0)
    config = replace(default_preset(), refine_sizes=True)
    tracker = Tracker(body(1.07), CAMERA, config, np.random.default_rng(0))
    silhouette, states = seen(body()), []
    for _ in range(40):
        states.append(tracker.track(silhouette).state)
    assert tracker.body.size("waist_width") < body(1.07).size("waist_width")
    assert states[-20:] == ["tracking"] * 20
    tracker.reset()
    assert tracker.body.size("waist_width") < body(1.07).size("waist_width")


@pytest.mark.parametrize(
    "config", [default_preset(), replace(paper_preset(), refine_sizes=True)], ids=["off", "paper"]
)
def test_otherwise_the_body_stays(config: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(size_refinement, "_BLOCK", 1)
    begin = body(1.07)
    tracker = Tracker(begin, CAMERA, config, np.random.default_rng(0))  # type: ignore[arg-type]
    for _ in range(6):
        tracker.track(seen(body()))
    assert tracker.body is begin
