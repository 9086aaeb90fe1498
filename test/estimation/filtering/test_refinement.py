"""What is done to a result: fitted, and corrected by what was learned."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from cardbox_tracker.body.cardbox import cardbox_patches
from cardbox_tracker.body.model import PROPORTIONS, BodyModel
from cardbox_tracker.body.posture import reference_posture
from cardbox_tracker.estimation.cost.compiled import CompiledSilhouette
from cardbox_tracker.estimation.cost.terms import Frame
from cardbox_tracker.estimation.cost.view import OtherCamera, View
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.estimation.filtering.correction import OF_DEPTH, NetworkCorrector
from cardbox_tracker.estimation.filtering.loss import Evidence
from cardbox_tracker.estimation.filtering.outline_fit import OutlineFit
from cardbox_tracker.estimation.filtering.refinement import Refinement
from cardbox_tracker.estimation.filtering.result_features import OF_CAMERAS
from cardbox_tracker.estimation.filtering.search_features import Search
from cardbox_tracker.estimation.filtering.whole_body_config import WholeBodyConfig
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.extrinsics import Extrinsics
from cardbox_tracker.vision.rasterisation import render

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
BODY = BodyModel.of(distance_m=2.3, hip_height_m=-0.45)
COST = WholeBodyCost(BODY, CAMERA, WholeBodyCostConfig())
STATE = np.append(reference_posture("arms"), [0.0, 0.0])
STDDEV = np.full(14, 0.1)
CONFIG = WholeBodyConfig()
EVIDENCE = Evidence(0.1, 0.05, 0.05, 1.0, 0.0, 0.05, STDDEV, STATE, 100)
STATES = np.array([STATE, STATE + 0.05])
KEYPOINTS_M = COST.bodies(STATES).points.keypoints_m
SEARCH = Search(STATES, np.array([0.1, 0.12]), KEYPOINTS_M, 0.02, EVIDENCE, 0.1)


def seen(depth_m: np.ndarray | None = None) -> Frame:
    silhouette = render(cardbox_patches(BODY, STATE[:12]), CAMERA)
    return replace(CompiledSilhouette(BODY, CAMERA).frame(silhouette), depth_m=depth_m)


def fitted(depth_m: np.ndarray | None = None) -> np.ndarray:
    frame = seen(depth_m)
    COST.see(frame.silhouette, STATE)
    return OutlineFit(COST, CAMERA, CONFIG.outline_steps)([frame], STATE)


def refined(refine: Refinement, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """The state that fits the outlines, and the result."""
    fit = refine.outline([frame], STATE)
    return fit, refine.corrected(frame, fit, STDDEV, 0.9, SEARCH)


def test_with_one_camera_the_result_is_corrected() -> None:
    assert CONFIG.corrector == "learned"
    expected = fitted()
    fit, result = refined(Refinement(COST, CAMERA, CONFIG), seen())
    assert np.array_equal(fit, expected)
    assert not np.allclose(result, expected)


def test_without_the_correction_the_result_is_only_fitted() -> None:
    config = replace(CONFIG, corrector="none")
    expected = fitted()
    assert np.array_equal(refined(Refinement(COST, CAMERA, config), seen())[1], expected)


def test_with_one_camera_a_depth_image_counts() -> None:
    depth_m = np.full((CAMERA.height, CAMERA.width), 2.3, np.float32)
    refine = Refinement(COST, CAMERA, CONFIG)
    fit, _ = refined(refine, seen(depth_m))
    # What was measured says more of the distance than an outline.
    assert np.array_equal(fit, STATE)
    assert isinstance(refine.corrector, NetworkCorrector)
    assert refine.corrector.features[:, OF_CAMERAS][:, -1].tolist() == [1.0, 1.0]
    measured = refine.corrector.features[:, OF_DEPTH]
    assert measured[:, 3:].all()
    # The arms are in the plane of the shoulders.
    assert np.allclose(measured[:, :3], 2.3 - COST.keypoints(STATE)[:, 2].reshape(2, 3), atol=1e-6)
    refined(refine, seen())
    assert not refine.corrector.features[:, OF_DEPTH].any()


def test_with_further_cameras_those_that_see_count() -> None:
    turn = np.eye(4)
    turn[:3, :3] = cv2.Rodrigues(np.array([0.0, -1.0, 0.0]))[0]
    turn[:3, 3] = np.array([0.0, 0.0, 2.3]) - turn[:3, :3] @ [0.0, 0.0, 2.3]
    view = View.of(BODY, CAMERA, OtherCamera(CAMERA, Extrinsics.of(turn)))
    assert abs(view.yaw_rad) == pytest.approx(1.0)
    refine, alone = (Refinement(COST, CAMERA, CONFIG, o) for o in ([(COST, view)], ()))
    refine.see([0])
    frame = seen()
    both = refined(refine, frame), refined(alone, frame)
    assert np.array_equal(both[0][0], both[1][0])
    assert isinstance(refine.corrector, NetworkCorrector)
    assert isinstance(alone.corrector, NetworkCorrector)
    # While one of two cameras sees the person, results are those of one camera.
    assert np.array_equal(refine.corrector.features, alone.corrector.features)
    assert np.array_equal(both[0][1], both[1][1])
    fit = fitted()
    refine.see([0, 1])
    refine.forget()
    # Two directions show the depth, so nothing is corrected.
    corrected = refine.corrected(frame, fit, STDDEV, 0.9, SEARCH)
    assert np.allclose(COST.keypoints(corrected), COST.keypoints(fit), atol=0.003)


def test_with_further_cameras_a_depth_image_changes_nothing() -> None:
    same = OtherCamera(CAMERA, Extrinsics.of(np.eye(4)))
    others = [(COST, View.of(BODY, CAMERA, same))]
    depth_m = np.full((CAMERA.height, CAMERA.width), 2.3, np.float32)
    fit = fitted()
    results = [
        Refinement(COST, CAMERA, CONFIG, others).corrected(frame, fit, STDDEV, 0.9, SEARCH)
        for frame in (seen(), seen(depth_m))
    ]
    assert np.array_equal(*results)
    assert not np.allclose(results[0], fit)


def test_a_body_that_nobody_measured_is_known_as_such() -> None:
    guessed = replace(BODY, source=PROPORTIONS)
    told = []
    for body in (BODY, guessed):
        refine = Refinement(WholeBodyCost(body, CAMERA, WholeBodyCostConfig()), CAMERA, CONFIG)
        keypoints_m = COST.keypoints(STATE)
        refine.corrected(seen(), STATE, STDDEV, 0.9, SEARCH)
        refine.deviations(seen(), STATE, STDDEV, keypoints_m, 0.9)
        assert isinstance(refine.corrector, NetworkCorrector)
        told.append(refine.corrector.result_features[:, OF_CAMERAS][:, -2].tolist())
    assert told == [[1.0, 1.0], [0.0, 0.0]]
