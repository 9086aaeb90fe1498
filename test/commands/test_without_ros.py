"""Where ROS is not installed recordings are still tracked, and the rest says what it needs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

WITHOUT_ROS = """
import sys
for name in ("rclpy", "std_msgs", "std_srvs", "sensor_msgs", "geometry_msgs"):
    sys.modules[name] = None  # an import of it fails, as where ROS is not installed
from cardbox_tracker.commands.main import main
sys.exit(main(sys.argv[1:]))
"""


def without_ros(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", WITHOUT_ROS, *map(str, words)]
    root = Path(__file__).resolve().parents[2]
    return subprocess.run(command, capture_output=True, text=True, cwd=root, check=False)


def test_recordings_need_no_ros(files: Path, tmp_path: Path) -> None:
    table = tmp_path / "person.csv"
    options = ("--background", "0:3.9", "--model", files / "person.yaml", "--start", "22")
    done = without_ros("track", files / "session", *options, "--csv", table)
    assert done.returncode == 0, done.stderr
    assert table.read_text().startswith("stamp,state,torso_y,")


def test_what_needs_ros_says_so() -> None:
    done = without_ros("call", "initializer/initialize")
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "ROS 2 is not installed" in done.stderr.splitlines()[-1]
