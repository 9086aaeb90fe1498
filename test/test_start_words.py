"""An executable that was built for another Python says what that lacks."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from cardbox_tracker.start import start

ROOT = Path(__file__).resolve().parents[1]
WITHOUT = """
import sys
sys.modules[sys.argv.pop(1)] = None  # an import of it fails, as under the system's Python
from cardbox_tracker import start
sys.exit(start.{name}())
"""


@pytest.mark.parametrize(("name", "missing"), [("tracker", "numba"), ("play_bag", "rosbags")])
def test_a_missing_package_is_told_in_words(name: str, missing: str) -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT.format(name=name), missing],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )
    assert done.returncode == 1
    assert f"{name}: the Python package '{missing}' is missing" in done.stderr
    assert "python -m colcon build" in done.stderr and sys.executable in done.stderr
    assert "Traceback" not in done.stderr


def test_a_missing_library_of_the_robot_is_told_in_words() -> None:
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    given = ["--ros-args", "-p", f"robot_file:={ROOT / 'config' / 'example_arm.urdf'}"]
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT.format(name="retarget"), "daqp", *given],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )
    said = done.stdout + done.stderr
    assert done.returncode == 1
    assert "pip install cardbox_tracker[retarget]" in said and "joint_map_file" in said
    assert "Traceback" not in said


def test_another_fault_keeps_its_traceback() -> None:
    with pytest.raises(ModuleNotFoundError):
        start("tracker", lambda: import_module("cardbox_tracker.nothing").main())
