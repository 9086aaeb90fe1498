"""Small sessions and small plans."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from cardbox_tracker.applications.simulation.session import SessionFormat, synthesize_session
from lab.experiments.parallel import Progress
from lab.experiments.plan import Plan
from lab.experiments.sessions import Session, synthetic_session

FPS, SIZE = 1.0, (160, 120)

TINY = Plan(
    runs=3,
    side_runs=2,
    particle_runs=2,
    model_runs=2,
    peer_runs=2,
    bodies=2,
    seeds=2,
    model_every=4,
    survival_rates=(0.005, 0.4, 1.0),
    particles=(25, 50),
    tempers=(0.015, 1.0),
    speeds=(("slow", 1), ("fast", 2)),
    fps=FPS,
    size=SIZE,
    timing_rounds=1,
)


@pytest.fixture(scope="package")
def tiny_plan() -> Plan:
    """All experiments, as small as they can be."""
    return TINY


@pytest.fixture(scope="package")
def silent() -> Progress:
    """No progress bar."""

    @contextmanager
    def progress(text: str) -> Iterator[Callable[[float], None]]:
        yield lambda fraction: None

    return progress


@pytest.fixture(scope="package")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded session with ground truth."""
    folder = tmp_path_factory.mktemp("evaluation") / "person"
    synthesize_session(folder, "bow", 3, SessionFormat(FPS, *SIZE))
    return folder


@pytest.fixture(scope="package")
def session() -> Session:
    """A synthetic session, ready to be tracked."""
    return synthetic_session("bow", 0, 2.0, SIZE)
