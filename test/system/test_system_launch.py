"""The launch files lead from a bag and from a video to joint states.

They need a workspace: the package built with colcon and sourced, and ros2launch.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from cardbox_tracker.body.model_file import save_body_model
from cardbox_tracker.recordings.bag_writer import BagWriter

rclpy = pytest.importorskip("rclpy", reason="rclpy is not installed")
pytest.importorskip("launch_ros", reason="launch_ros is not installed (not on PyPI)")
pytest.importorskip("ros2launch", reason="ros2launch is not installed (not on PyPI)")

from sensor_msgs.msg import JointState  # noqa: E402

from cardbox_tracker.ros.runtime import qos  # noqa: E402
from cardbox_tracker.vision.background_config import BackgroundConfig  # noqa: E402

EMPTY = BackgroundConfig().learn_images + 30
FRONT = 120
FPS = 20.0
START_NS = 1_700_000_000_000_000_000

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", autouse=True)
def _workspace() -> None:
    packages = pytest.importorskip("ament_index_python.packages")
    try:
        prefix = Path(packages.get_package_prefix("cardbox_tracker"))
    except packages.PackageNotFoundError:
        pytest.skip("cardbox_tracker is not in a sourced workspace")
    if not (prefix / "lib" / "cardbox_tracker" / "tracker").exists():
        pytest.skip("cardbox_tracker was not built by colcon: there is nothing 'ros2 run' finds")


@pytest.fixture(scope="module")
def recorded(scene: Any, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Write a bag and a video of an empty room and then a person, and the body model."""
    folder = tmp_path_factory.mktemp("recorded")
    size = (scene.camera.width, scene.camera.height)
    video = cv2.VideoWriter(str(folder / "video.avi"), cv2.VideoWriter.fourcc(*"MJPG"), FPS, size)
    assert video.isOpened()
    with BagWriter(folder / "bag") as bag:
        for number in range(EMPTY + FRONT):
            image = scene.image(None if number < EMPTY else "front")
            stamp_ns = START_NS + int(number * 1e9 / FPS)
            bag.write_camera_info("/eye/camera_info", stamp_ns, "eye", scene.camera)
            bag.write_image("/eye/image_raw", stamp_ns, "eye", image, "mono8")
            video.write(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
    video.release()
    save_body_model(scene.body, folder / "model.yaml")
    return {name: folder / name for name in ("bag", "video.avi", "model.yaml")}


@contextmanager
def launched(graph: Any, log: Path, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """Context of a running 'ros2 launch'; it ends as with Ctrl-C."""
    environment = {**os.environ, "ROS_DOMAIN_ID": str(graph.domain), "PYTHONUNBUFFERED": "1"}
    command = [shutil.which("ros2") or "ros2", "launch", "cardbox_tracker", *arguments]
    with log.open("wb") as output:
        process = subprocess.Popen(
            *(command,), stdout=output, stderr=subprocess.STDOUT, env=environment
        )
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(timeout=60)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


@pytest.mark.parametrize("single_process", ["false", "true"])
@pytest.mark.parametrize("source", ["replay", "live"])
def test_a_launch_file_leads_to_joint_states(
    own_graph: Any, recorded: dict[str, Path], scene: Any, source: str, single_process: str
) -> None:
    graph = own_graph
    common = ("namespace:=eye", f"model_file:={recorded['model.yaml']}", "person_distance_m:=2.3")
    if source == "replay":
        own = (f"bag:={recorded['bag']}", "rate:=2.0")
    else:
        fov_deg = np.degrees(2 * np.arctan(scene.camera.width / 2 / scene.camera.fx))
        own = (f"file:={recorded['video.avi']}", f"horizontal_fov_deg:={fov_deg:.4f}")
        own += (f"rate_hz:={FPS}", "loop:=true")
    states = graph.collect(JointState, "/eye/joint_states", qos.REPLAY)
    humans = graph.collect(JointState, "/humans/bodies/p1/joint_states", qos.REPLAY)
    log = graph.folder / "launch.log"
    arguments = (*own, *common, "rep155_id:=p1", f"single_process:={single_process}")
    with launched(graph, log, f"{source}.launch.py", *arguments):
        try:
            graph.wait(lambda: len(states) >= 10 and humans, "joint states")
        except AssertionError as error:
            raise AssertionError(f"{error}\n{log.read_text()[-4000:]}") from None
        expected = {"/eye": {"background", "initializer", "tracker"}}
        expected["/eye"].add("play_bag" if source == "replay" else "camera")
        found = {name for name, space in graph.node.get_node_names_and_namespaces()}
        assert expected["/eye"] <= found
    text = log.read_text()
    where_m = np.median([state.position[0] for state in states[5:]])
    assert where_m == pytest.approx(scene.body.placement.lateral_m, abs=0.1)
    assert text.count("process started with pid") == (1 if single_process == "true" else 4)
    assert "Traceback" not in text and "process has died" not in text, text[-4000:]


@pytest.mark.parametrize("name", ["live", "replay", "nodes"])
def test_every_argument_is_explained(name: str) -> None:
    shown = subprocess.run(
        [
            *(shutil.which("ros2") or "ros2", "launch", "cardbox_tracker"),
            *(f"{name}.launch.py", "--show-args"),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert shown.returncode == 0, shown.stderr
    for argument in ("namespace", "single_process", "person_distance_m", "rep155_id"):
        assert f"'{argument}':" in shown.stdout
    assert "No description given" not in shown.stdout
