"""A short synthetic recording, measured once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from cardbox_tracker.applications.simulation.session import SessionFormat, synthesize_session
from cardbox_tracker.measuring.config import InitializationConfig, InitializationResult
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.initialize import initialize_from_recording
from cardbox_tracker.recordings.silhouettes import SilhouetteSource, TimeSpan
from cardbox_tracker.recordings.truth import GroundTruth, load_ground_truth

FPS = 5.0


@dataclass(frozen=True)
class Recording:
    """A recording of one bow, 5 images a second, and its person as measured."""

    folder: Path
    truth: GroundTruth
    result: InitializationResult

    @property
    def body(self) -> BodyModel:
        return self.result.body

    def start_s(self) -> float:
        return self.truth.spans["neutral"][0]


def background(truth: GroundTruth) -> TimeSpan:
    return TimeSpan(0.0, truth.spans["empty"][1] - 0.1)


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    folder = tmp_path_factory.mktemp("offline") / "session"
    synthesize_session(folder, "bow", 3, SessionFormat(FPS))
    truth = load_ground_truth(folder / "ground_truth.json")
    with BagReader(folder) as bag:
        source = SilhouetteSource(bag, background(truth))
        spans = {
            name: TimeSpan(truth.spans[name][0] + 0.1, truth.spans[name][1] - 0.3)
            for name in ("front", "side", "arms")
        }
        config = InitializationConfig(distance_m=truth.distance_m)
        result = initialize_from_recording(source, spans, config)
    return Recording(folder, truth, result)


@pytest.fixture(scope="session")
def source(recording: Recording) -> Iterator[SilhouetteSource]:
    with BagReader(recording.folder) as bag:
        yield SilhouetteSource(bag, background(recording.truth))
