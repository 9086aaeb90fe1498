"""How well a whole synthetic session is tracked, on its exact silhouettes, over three seeds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.applications.simulation.session import (
    SessionFormat,
    session_camera,
    synthesize_session,
)
from cardbox_tracker.measuring.config import InitializationConfig
from cardbox_tracker.measuring.measure import initialize_body
from cardbox_tracker.measuring.references import average_silhouette
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.recordings.truth import GroundTruth, load_ground_truth, tracking_error
from cardbox_tracker.search.config import TrackerConfig, default_preset, paper_preset
from cardbox_tracker.tracking.tracker import Tracker

SEEDS = (0, 1, 2)
FPS = 15.0
CONFIGS = {
    "paper": paper_preset(),
    "paper with srs": replace(paper_preset(), strategy="srs"),
    "default": default_preset(),
}

pytestmark = pytest.mark.slow


@dataclass(frozen=True)
class Run:
    """One tracker over the session from its first neutral posture on."""

    mean_error_m: float
    mean_cost_px: float
    frames: int
    frames_tracked: int


@dataclass(frozen=True)
class Session:
    truth: GroundTruth
    silhouettes: np.ndarray
    body: BodyModel

    def first(self) -> int:
        return int(np.ceil(self.truth.spans["neutral"][0] * FPS))

    def run(self, config: TrackerConfig, seed: int) -> Run:
        tracker = Tracker(self.body, session_camera(), config, np.random.default_rng(seed))
        keypoints_m, costs_px = {}, []
        numbers = range(self.first(), len(self.silhouettes))
        for number in numbers:
            estimate = tracker.track(self.silhouettes[number])
            if estimate.posture is not None:
                stamp_ns = self.truth.start_ns + round(number * 1e9 / FPS)
                keypoints_m[stamp_ns] = estimate.keypoints_m
                costs_px.append(estimate.cost_px)
        error_m = tracking_error(keypoints_m, self.truth)["mean_3d_error_m"]
        assert keypoints_m.keys() <= self.truth.frames.keys()
        return Run(error_m, float(np.mean(costs_px)), len(numbers), len(keypoints_m))


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    folder: Path = tmp_path_factory.mktemp("accuracy") / "session"
    synthesize_session(folder, "all", form=SessionFormat(FPS))
    truth = load_ground_truth(folder / "ground_truth.json")
    archive = np.load(folder / "masks.npz")
    count, height, width = archive["shape"]
    masks = np.unpackbits(archive["packed"], axis=1)[:, : height * width]
    silhouettes = (masks * np.uint8(255)).reshape(count, height, width)
    time_s = np.arange(count) / FPS
    references = {}
    for name in ("front", "side", "arms"):
        start_s, end_s = truth.spans[name]
        held = (time_s >= start_s + 0.2) & (time_s <= end_s - 0.2)
        references[name] = average_silhouette(list(silhouettes[held]))
    result = initialize_body(references, session_camera(), InitializationConfig())
    return Session(truth, silhouettes, result.body)


@pytest.fixture(scope="module")
def runs(session: Session) -> dict[str, list[Run]]:
    """The runs of each configuration, one a seed."""
    return {name: [session.run(config, seed) for seed in SEEDS] for name, config in CONFIGS.items()}


def mean_error_m(runs: list[Run]) -> float:
    return float(np.mean([run.mean_error_m for run in runs]))


def mean_cost_px(runs: list[Run]) -> float:
    return float(np.mean([run.mean_cost_px for run in runs]))


@pytest.mark.parametrize("name", CONFIGS)
def test_every_image_is_tracked(runs: dict[str, list[Run]], name: str) -> None:
    for run in runs[name]:
        assert run.frames > 400
        assert run.frames_tracked == run.frames


def test_drs_beats_srs_in_cost_for_every_seed(runs: dict[str, list[Run]]) -> None:
    for drs, srs in zip(runs["paper"], runs["paper with srs"], strict=True):
        assert drs.mean_cost_px < srs.mean_cost_px


def test_drs_beats_srs_in_the_error_of_the_joints(runs: dict[str, list[Run]]) -> None:
    assert mean_error_m(runs["paper"]) < mean_error_m(runs["paper with srs"])


def test_the_papers_settings_reach_fifteen_centimetres(runs: dict[str, list[Run]]) -> None:
    assert mean_error_m(runs["paper"]) <= 0.15


def test_the_default_preset_beats_the_papers_for_every_seed(runs: dict[str, list[Run]]) -> None:
    for default, paper in zip(runs["default"], runs["paper"], strict=True):
        assert default.mean_error_m < paper.mean_error_m


def test_seeds_matter_less_in_the_default_preset(runs: dict[str, list[Run]]) -> None:
    spreads = [np.ptp([run.mean_error_m for run in runs[name]]) for name in ("default", "paper")]
    assert spreads[0] < spreads[1]
