"""The launch files lead from a bag and from a video to joint states.

They need ros2launch, and the package in a sourced workspace or installed by pip for this Python.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.recordings.bag_writer import BagWriter

pytest.importorskip("launch_ros", reason="launch_ros is not installed (not on PyPI)")
pytest.importorskip("ros2launch", reason="ros2launch is not installed (not on PyPI)")

from sensor_msgs.msg import Image, JointState

from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.segmentation.background_config import BackgroundConfig

EMPTY = BackgroundConfig().learn_images + 30
FRONT = 120
FPS = 20.0
START_NS = 1_700_000_000_000_000_000
NAMES = {"two_cameras": ("cam0", "cam1"), "stereo": ("left", "right")}
NEARER_M, BASELINE_M = 0.2, 0.3

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", autouse=True)
def _workspace() -> Iterator[None]:
    packages = pytest.importorskip("ament_index_python.packages")
    with pytest.MonkeyPatch.context() as patch:
        if not os.environ.get("AMENT_PREFIX_PATH"):
            patch.setenv("AMENT_PREFIX_PATH", sys.prefix)
        _check_prefix(packages)
        yield


def _check_prefix(packages: Any) -> None:
    try:
        prefix = Path(packages.get_package_prefix("cardbox_tracker"))
    except packages.PackageNotFoundError:
        pytest.skip("cardbox_tracker is not in a sourced workspace")
    if not (prefix / "lib" / "cardbox_tracker" / "tracker").exists():
        pytest.skip("cardbox_tracker has no executables where 'ros2 run' looks; install it again")


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


class PairWriter(BagWriter):
    """Writes the baseline of a rectified pair into the CameraInfo of its right camera."""

    def write(self, topic: str, message: Any, stamp_ns: int) -> None:
        if topic == "/room/right/camera_info":
            message.p[3] = -BASELINE_M * message.p[0]
        super().write(topic, message, stamp_ns)


@pytest.fixture(scope="module")
def by_two(scene: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record a person who stands nearer than measured, aside and by a rectified pair."""
    folder = tmp_path_factory.mktemp("two")
    aside = np.eye(4)
    c, s = np.cos(np.pi / 3), np.sin(np.pi / 3)
    aside[:3, :3] = [(c, 0.0, s), (0.0, 1.0, 0.0), (-s, 0.0, c)]
    aside[:3, 3] = [-2.3 * s, 0.0, 2.3 * (1 - c)]
    right = np.eye(4)
    right[0, 3] = -BASELINE_M
    rng = np.random.default_rng(0)
    for name, pose in (("two_cameras", aside), ("stereo", right)):
        outlines = scene.outlines(scene.camera, pose, NEARER_M)
        with PairWriter(folder / name) as bag:
            for number in range(EMPTY + FRONT):
                stamp_ns = START_NS + int(number * 1e9 / FPS)
                for camera, outline in zip(NAMES[name], outlines, strict=True):
                    clean = np.where((outline > 0) & (number >= EMPTY), 190.0, 90.0)
                    image = np.clip(clean + rng.normal(0, 2, clean.shape), 0, 255).astype(np.uint8)
                    space = f"/room/{camera}"
                    bag.write_camera_info(f"{space}/camera_info", stamp_ns, camera, scene.camera)
                    bag.write_image(f"{space}/image_raw", stamp_ns, camera, image, "mono8")
    chain = {"cam0": {}, "cam1": {"T_cn_cnm1": aside.tolist()}}
    (folder / "chain.yaml").write_text(yaml.safe_dump(chain), encoding="utf-8")
    save_body_model(scene.body, folder / "model.yaml")
    return folder


def wait(graph: Any, condition: Callable[[], Any], log: Path) -> None:
    """Wait as :meth:`Graph.wait` does; an error shows the end of the launch's log."""
    try:
        graph.wait(condition, "what the launched nodes publish")
    except AssertionError as error:
        raise AssertionError(f"{error}\n{log.read_text()[-4000:]}") from None


def assert_clean(log: Path, processes: int) -> None:
    """Check how many processes were launched, and that none failed."""
    text = log.read_text()
    assert text.count("process started with pid") == processes
    assert "Traceback" not in text and "process has died" not in text, text[-4000:]


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


@pytest.mark.parametrize("single_process", ["false", "auto"])
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
        wait(graph, lambda: len(states) >= 10 and humans, log)
        expected = {"/eye": {"background", "initializer", "tracker"}}
        expected["/eye"].add("play_bag" if source == "replay" else "camera")
        found = {name for name, space in graph.node.get_node_names_and_namespaces()}
        assert expected["/eye"] <= found
    where_m = np.median([state.position[0] for state in states[5:]])
    assert where_m == pytest.approx(scene.body.placement.lateral_m, abs=0.1)
    assert_clean(log, 1 if single_process == "auto" else 4)


def test_the_nodes_are_started_beside_a_driver(
    own_graph: Any, recorded: dict[str, Path], scene: Any
) -> None:
    """The player stands for the driver, whose topics have other names."""
    graph = own_graph
    states = graph.collect(JointState, "/me/joint_states", qos.REPLAY)
    log = graph.folder / "launch.log"
    topics = ("image:=/eye/image_raw", "camera_info:=/eye/camera_info")
    body = f"model_file:={recorded['model.yaml']}"
    with launched(graph, log, "nodes.launch.py", "namespace:=me", *topics, body):
        awaited = "[/me/keypoints]"
        graph.start("play_bag", str(recorded["bag"]), loop=True, wait_for_topics=awaited)
        wait(graph, lambda: len(states) >= 10, log)
    where_m = np.median([state.position[0] for state in states[5:]])
    assert where_m == pytest.approx(scene.body.placement.lateral_m, abs=0.1)
    assert_clean(log, 1)


@pytest.mark.parametrize("name", ["two_cameras", "stereo"])
def test_two_cameras_are_launched_together(own_graph: Any, by_two: Path, name: str) -> None:
    graph = own_graph
    states = graph.collect(JointState, "/room/joint_states", qos.REPLAY)
    outlines = [f"/room/{camera}/silhouette" for camera in NAMES[name]]
    seen = [graph.collect(Image, topic, qos.REPLAY) for topic in outlines]
    depths = graph.collect(Image, "/room/depth", qos.SENSOR_DATA)
    own = (f"extrinsics_file:={by_two / 'chain.yaml'}",) if name == "two_cameras" else ()
    log = graph.folder / "launch.log"
    body = f"model_file:={by_two / 'model.yaml'}"
    with launched(graph, log, f"{name}.launch.py", "namespace:=room", body, *own):
        awaited = "[/room/keypoints]"
        graph.start("play_bag", str(by_two / name), loop=True, wait_for_topics=awaited)
        wait(graph, lambda: len(states) >= 10 and all(seen), log)
        if name == "stereo":
            wait(graph, lambda: depths, log)
    # The person stands nearer than measured, which one silhouette hardly shows.
    nearer_m = np.median([state.position[12] for state in states[5:]])
    assert nearer_m == pytest.approx(NEARER_M, abs=0.1)
    assert_clean(log, 5 if name == "stereo" else 4)


@pytest.mark.parametrize("name", ["live", "replay", "nodes", "two_cameras", "stereo"])
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
    for argument in ("namespace", "model_file", "person_distance_m", "rep155_id"):
        assert f"'{argument}':" in shown.stdout
    assert "No description given" not in shown.stdout
