"""The recipe "Add a joint" of CONTRIBUTING.md: what has a row is found, published and written."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest


def test_a_row_reaches_topics_tables_robots_and_bvh(tmp_path: Path) -> None:
    script = Path(__file__).with_name("added_joint.py")
    run = subprocess.run(
        [sys.executable, script, tmp_path], capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    found = json.loads(run.stdout)
    roll = found["joint_states"]
    assert np.degrees(roll) == pytest.approx(12.0, abs=1.5)
    assert found["table"] == pytest.approx(roll, abs=1e-6)
    assert found["rep155"] == pytest.approx(roll)
    assert 0.0 < found["table_stddev"] == pytest.approx(found["joint_states_stddev"], abs=1e-6)
    assert found["urdf"]["neck_pitch_link"] == "neck_roll_link"
    assert found["urdf"]["neck_roll_link"] == "head"
    bvh = pytest.importorskip("bvh", reason="bvh is not installed")
    motion = bvh.Bvh((tmp_path / "a.bvh").read_text(encoding="utf-8"))
    lean = motion.frame_joint_channel(0, "Neck", "Zrotation")
    assert lean == pytest.approx(np.degrees(roll), abs=1e-4)
