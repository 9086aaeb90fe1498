"""A recorder keeps what the learned parts see, and corrects as its inner corrector does."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import reference_posture
from cardbox_tracker.estimation.cost.terms import Frame
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.estimation.filtering.correction import N_FEATURES
from cardbox_tracker.estimation.filtering.corrector import Result
from cardbox_tracker.estimation.filtering.loss import Evidence, features_of_loss
from cardbox_tracker.estimation.filtering.result_features import FEATURES, Viewpoints
from cardbox_tracker.estimation.filtering.search_features import Search
from cardbox_tracker.vision.camera import Camera
from learning.recorder import Recorder, recording_config

CAMERA = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
COST = WholeBodyCost(BodyModel.of(distance_m=2.3), CAMERA, WholeBodyCostConfig())
STATE = np.append(reference_posture("front"), [0.0, 0.0])
STDDEV = np.full(14, 0.1)
EVIDENCE = Evidence(0.2, 0.1, 0.3, 0.6, 0.05, 0.04, STDDEV, STATE, 3)


def result(state: np.ndarray = STATE) -> Result:
    states = np.array([state, state + 0.02])
    keypoints_m = COST.bodies(states).points.keypoints_m
    search = Search(states, np.array([0.1, 0.12]), keypoints_m, 0.02, EVIDENCE, 0.1)
    frame = Frame(np.zeros((240, 320), np.uint8), 240, 0)
    viewpoints = Viewpoints.of(0.0, [0.0], is_measured=True)
    return Result(frame, state, STDDEV, COST.keypoints(state), 0.9, search, viewpoints)


class Raising:
    """Corrects in place, 1 cm upwards."""

    def __call__(self, found: Result) -> np.ndarray:
        found.keypoints_m[:, 1] -= 0.01
        return found.keypoints_m

    def deviations(self, corrected: Result) -> None:
        raise AssertionError


def test_it_keeps_what_was_before_and_after_the_correction() -> None:
    recorder = Recorder(COST, CAMERA, Raising())
    found, before_m = result(), COST.keypoints(STATE)
    assert recorder(found) == pytest.approx(before_m - (0.0, 0.01, 0.0))
    later = STATE.copy()
    later[7] += 0.3
    # The deviations stay those of the filter.
    assert recorder.deviations(result(later)) is None
    seen = recorder.take()
    assert seen is not None
    np.testing.assert_array_equal(seen.found_m, before_m)
    np.testing.assert_array_equal(seen.result_m, COST.keypoints(later))
    np.testing.assert_array_equal(seen.state, later)
    np.testing.assert_array_equal(seen.stddev, STDDEV)
    assert seen.evidence.tolist() == list(features_of_loss(EVIDENCE).values())
    assert seen.features.shape == (2, N_FEATURES)
    assert seen.result_features.shape == (2, FEATURES)
    # The first features are those of the result before the correction.
    assert not np.allclose(seen.features[:, :FEATURES], seen.result_features)


def test_what_was_seen_is_taken_once() -> None:
    recorder = Recorder(COST, CAMERA, None)
    assert recorder.take() is None
    found = result()
    assert recorder(found) is found.keypoints_m
    assert recorder.take() is not None and recorder.take() is None


@pytest.mark.parametrize(("is_corrected", "name"), [(True, "learned"), (False, "uncorrected")])
def test_the_preset_gets_a_recorder_and_nothing_is_called_lost(
    is_corrected: bool, name: str
) -> None:
    config = recording_config(False, is_corrected)
    assert config.whole_body.corrector == f"learning.recorder:{name}"
    assert (config.lost_iou, config.whole_body.lost_from) == (0.0, 1.0)
    assert recording_config(True, is_corrected) != config
