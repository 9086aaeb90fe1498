"""Measured lengths beside those of a session's true joints."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.applications.simulation.session import SessionFormat, synthesize_session
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import SIZE_INDEX
from lab.evaluation.figures import lengths
from lab.evaluation.report import sessions_report
from lab.evaluation.session import RecordedSession, load_session
from lab.evaluation.tracking import SessionRun

BODY = BodyModel.of(hip_height_m=-0.6, camera_pitch_rad=np.radians(8.0))


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> RecordedSession:
    folder = tmp_path_factory.mktemp("lengths") / "bow"
    synthesize_session(folder, "bow", form=SessionFormat(2.0, 160, 120), body=BODY)
    return load_session(folder)


def run_of(body: BodyModel) -> SessionRun:
    nothing = np.empty(0)
    no_states = np.empty(0, str)
    return SessionRun(body, "", no_states, *[nothing] * 3, no_states, nothing, nothing)


def test_the_true_body_has_the_true_lengths(session: RecordedSession) -> None:
    found = lengths(session, run_of(BODY))
    assert found.pop("joint_height") == pytest.approx(0.0, abs=0.02)
    assert found == pytest.approx(dict.fromkeys(found, 1.0), abs=1e-3)


def test_what_is_too_long_or_too_high_is_told(session: RecordedSession) -> None:
    sizes = BODY.sizes.copy()
    sizes[SIZE_INDEX["upper_arm_length"]] *= 1.1
    sizes[SIZE_INDEX["forearm_length"]] *= 0.9
    sizes[SIZE_INDEX["shoulder_drop"]] -= 0.02
    found = lengths(session, run_of(BODY.with_values(sizes=sizes)))
    assert found["upper_arm"] == pytest.approx(1.1, abs=1e-3)
    assert found["forearm"] == pytest.approx(0.9, abs=1e-3)
    assert found["shoulders"] == pytest.approx(1.0, abs=1e-3)
    assert found["joint_height"] == pytest.approx(2.0, abs=0.02)


def test_the_report_has_ratios_and_centimetres() -> None:
    figures = {"upper_arm": 1.0123, "forearm": 0.9, "shoulders": 1.0, "joint_height": -0.26}
    one = {
        "name": "some",
        "mediapipe": {},
        "mediapipe_ms": None,
        "runs": [{"frames": 3, "without_estimate": 0, "lengths": figures}],
    }
    results = {
        "command": "cardbox evaluate",
        "preset": "default",
        "seeds": [0],
        "sessions": [one],
        "provenance": {"commit": "none", "cpu": "none"},
    }
    report = sessions_report(results)
    assert "| some | 1.012 | 0.900 | 1.000 | -0.3 |" in report
    assert (
        "deviation: upper arm 1.2 % (1.2 %), forearm to hand 10.0 % (10.0 %), shoulder breadth "
        "0.0 % (0.0 %), shoulder joints 0.3 cm (0.3 cm)." in report
    )
    results["sessions"] = [one | {"runs": [{"frames": 3, "without_estimate": 3}]}]
    assert "deviation:" not in sessions_report(results)
