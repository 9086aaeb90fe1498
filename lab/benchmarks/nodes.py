"""Latency of the nodes from an image's stamp to the joint states, over real DDS.

A publisher in this process plays a camera: the empty scene, then a person who waves, each image
stamped with the time at which it is sent. The nodes run each in a process of its own or all in one.
The latency ends when a subscriber's callback has the JointState with that stamp; the time of its
arrival in the subscriber's process is measured, too.
"""

from __future__ import annotations

import importlib.util
import os
import threading
import time
from collections.abc import Callable, Sized
from contextlib import suppress
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.model_files import installed_models
from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.ros.runtime.processes import Nodes, isolate, running_nodes
from lab.benchmarks.scene import BenchmarkScene, make_scene, recorded_scene, wide_scene

RATES_HZ = (15, 30, 60)
STREAMS = (("mono8", 320, 240), ("bgr8", 640, 480))
SEPARATE = ("background", "initializer", "tracker")
TOGETHER = ("cardbox_nodes",)
WITH_DETECTOR = (*SEPARATE, "detector")
OF_DETECTOR = ("detector", "tracker")
ROBOT = "retarget"
"""Executable that is enabled by a grip with each image, where it is one of the processes."""
PERCENTILES = (50, 95, 99)

_ARM = Path(__file__).parents[2] / "config" / "example_arm.urdf"
_ARM_BEGINS = "shoulder_roll=0.2"
_START_S = 30.0
_LAST_S = 0.5


def measure_nodes(
    seconds: float, report: Callable[[float], None], session: Path | None = None
) -> dict[str, Any] | None:
    """Measure every stream at every rate for ``seconds``; None where ROS is not installed.

    ``single_process`` in the result holds the same figures for all nodes in one process, and
    ``with_detector`` those beside the node ``detector``, None where it is not installed. If a
    ``session`` is given, the detector sees its person, and ``of_detector`` holds the figures with
    the detector's silhouettes. ``with_robot`` and ``detector_with_robot`` have the time until the
    command to a robot, too, at 30 Hz.
    """
    try:
        import rclpy  # noqa: F401
    except ImportError:
        return None
    isolate()
    drawn = {stream: make_scene(*stream[1:], 60) for stream in STREAMS}
    ways: dict[str, tuple[tuple[str, ...], dict[Any, BenchmarkScene]]]
    ways = {"": (SEPARATE, drawn), "single_process": (TOGETHER, drawn)}
    ways["with_robot"] = (*SEPARATE, ROBOT), {STREAMS[-1]: drawn[STREAMS[-1]]}
    if _has_detector():
        ways["with_detector"] = WITH_DETECTOR, drawn
        if session is not None:
            scene = recorded_scene(session, 60)
            scenes = scene, wide_scene(scene)
            seen = {("bgr8", one.camera.width, one.camera.height): one for one in scenes}
            ways |= {"with_detector": (WITH_DETECTOR, seen), "of_detector": (OF_DETECTOR, seen)}
            ways["detector_with_robot"] = (*OF_DETECTOR, "initializer", ROBOT), seen
    measured: dict[str, Any] = {"with_detector": None}
    for number, (way, of) in enumerate(ways.items()):
        measured[way] = _measure(*of, seconds, partial(_part, report, number, ways))
    return {**measured.pop(""), **measured}


def _part(report: Callable[[float], None], number: int, of: Sized, done: float) -> None:
    """Report the finished fraction of one of several parts."""
    report((number + done) / len(of))


def _has_detector() -> bool:
    try:
        installed_models()
    except CardboxError:
        return False
    return importlib.util.find_spec("ai_edge_litert") is not None


def _measure(
    processes: tuple[str, ...],
    scenes: dict[tuple[str, int, int], BenchmarkScene],
    seconds: float,
    report: Callable[[float], None],
) -> dict[str, Any]:
    with TemporaryDirectory() as folder, running_nodes(Path(folder)) as nodes:
        camera = CameraAndListener(nodes, processes)
        try:
            model = Path(folder) / "body.yaml"
            save_body_model(next(iter(scenes.values())).body, model)
            ready_s = {name: camera.start(name, model) for name in processes}
            streams = {}
            rates = (30,) if ROBOT in processes else RATES_HZ
            for i, (stream, scene) in enumerate(scenes.items()):
                camera.learn(scene, stream[0])
                for j, rate in enumerate(rates):
                    name = f"{stream[0]} {stream[1]}x{stream[2]} at {rate} Hz"
                    streams[name] = camera.measure(scene, stream[0], rate, seconds)
                    report((i * len(rates) + j + 1) / (len(scenes) * len(rates)))
            memory = {name: _rss_mb(nodes.pid(name)) for name in processes}
        finally:
            camera.close()
    return {"ready_s": ready_s, "rss_mb": memory, "streams": streams}


class CameraAndListener:
    """Publishes images and records the arrival times of their joint states.

    Attributes:
        arrivals_ns: times of the callback and of the arrival in this process, by stamp.
        points_ns: times at which a person's points came, by the stamp of their image.
    """

    def __init__(self, nodes: Nodes, processes: tuple[str, ...]) -> None:
        """Create the ROS node; ``nodes`` will start the executables ``processes``."""
        import rclpy
        from diagnostic_msgs.msg import DiagnosticArray
        from rclpy.executors import SingleThreadedExecutor
        from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2
        from std_msgs.msg import Bool

        from cardbox_tracker.ros.runtime import qos

        self._nodes = nodes
        self._processes = processes
        rclpy.init(args=[])
        self._node = rclpy.create_node("cardbox_benchmark", enable_rosout=False)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._image = self._node.create_publisher(Image, "image_raw", qos.CAMERA)
        self._info = self._node.create_publisher(CameraInfo, "camera_info", qos.CAMERA)
        self._grip = self._node.create_publisher(Bool, "retarget/grip", qos.RESULT)
        self._node.create_subscription(
            JointState,
            "joint_states",
            self._arrived,  # type: ignore[arg-type]  # rclpy leaves out its own second argument
            qos.RESULT,
        )
        self._node.create_subscription(
            DiagnosticArray,
            "/diagnostics",
            self._note_nodes,  # type: ignore[arg-type]  # as above
            qos.RESULT,
        )
        self._node.create_subscription(
            PointCloud2,
            "detector/keypoints",
            self._saw,  # type: ignore[arg-type]  # as above
            qos.RESULT,
        )
        self._ready: set[str] = set()
        self._told_ms: dict[str, float] = {}
        self.arrivals_ns: dict[int, tuple[int, int]] = {}
        self.points_ns: dict[int, int] = {}
        self._listening = threading.Thread(target=partial(_listen, self._executor), daemon=True)
        self._listening.start()

    def _arrived(self, message: Any, info: dict[str, Any]) -> None:
        from cardbox_tracker.ros.messages.conversions import stamp_ns

        now_ns = time.time_ns()
        self.arrivals_ns[stamp_ns(message.header.stamp)] = (now_ns, info["received_timestamp"])

    def _saw(self, message: Any, _: dict[str, Any]) -> None:
        from cardbox_tracker.ros.messages.conversions import stamp_ns

        if message.height:
            self.points_ns[stamp_ns(message.header.stamp)] = time.time_ns()

    def _note_nodes(self, message: Any, _: dict[str, Any]) -> None:
        from cardbox_tracker.ros.runtime.diagnostics import STATUS, WAITING, WORKING

        for status in message.status:
            values = {entry.key: entry.value for entry in status.values}
            if values.get(STATUS) in (WAITING, WORKING):
                self._ready.add(status.name.rpartition(": ")[2])
            for name in ("p50", "p95"):
                if value := values.get(f"image to command {name} (ms)"):
                    self._told_ms[f"command_{name}_ms"] = float(value)

    def start(self, name: str, model: Path) -> float:
        """Start a process; return the time until its nodes report that they are ready, s.

        The diagnostics are published once a second.
        """
        began = time.monotonic()
        together = name in TOGETHER
        parameter = f"{'tracker:' * together}model_file:={model}"
        arguments = ["--ros-args", "-p", parameter] if together or name == "tracker" else []
        if name == "tracker" and "detector" in self._processes:
            arguments += ["-p", "keypoints:=detector/keypoints"]
        if name == "detector" and "background" not in self._processes:
            arguments = ["--ros-args", "-p", "publish_silhouette:=true"]
        if name == "initializer" and ROBOT in self._processes:
            arguments = ["--ros-args", "-p", parameter]
        if name == ROBOT:
            arguments = ["--ros-args", "-p", f"robot_file:={_ARM}", "-p", f"start:={_ARM_BEGINS}"]
        self._nodes.start(name, *arguments)
        expected = set(SEPARATE) if together else {name}
        while not expected <= self._ready:
            time.sleep(0.01)
            self._nodes.check()
            if time.monotonic() - began > _START_S:
                raise CardboxError(f"the node {name} was not ready within {_START_S:g} s")
        return time.monotonic() - began

    def learn(self, scene: BenchmarkScene, encoding: str) -> None:
        """Publish the empty scene of a new camera until the background is learned."""
        end = time.monotonic() + _START_S
        while self._info.get_subscription_count() == 0 or self._image.get_subscription_count() == 0:
            time.sleep(0.05)
            if time.monotonic() > end:
                raise CardboxError("the background node did not subscribe to the images")
        for i in range(3 * len(scene.empty)):
            self._publish(scene, scene.empty[i % len(scene.empty)], encoding)
            time.sleep(0.03)

    def measure(
        self, scene: BenchmarkScene, encoding: str, rate_hz: float, seconds: float
    ) -> dict[str, Any]:
        """Publish for ``seconds``; return latencies, losses and the nodes' processor time.

        ``points`` counts the images whose own points came before their joint states.
        """
        there_and_back = [*scene.images, *scene.images[::-1]]
        self.arrivals_ns.clear()
        self.points_ns.clear()
        count = max(2, int(seconds * rate_hz))
        sent = []
        began = time.monotonic()
        used = {name: _cpu_s(self._nodes.pid(name)) for name in self._processes}
        for i in range(count):
            sent.append(self._publish(scene, there_and_back[i % len(there_and_back)], encoding))
            time.sleep(max(0.0, began + (i + 1) / rate_hz - time.monotonic()))
        lasted_s = time.monotonic() - began
        cpu = {
            name: 100.0 * (_cpu_s(self._nodes.pid(name)) - before) / lasted_s
            for name, before in used.items()
        }
        time.sleep(_LAST_S)
        self._nodes.check()
        arrived = [stamp for stamp in sent if stamp in self.arrivals_ns]
        if not arrived:
            raise CardboxError("no joint states arrived; the nodes do not track")
        early = sum(self.points_ns.get(at, np.inf) < self.arrivals_ns[at][0] for at in arrived)
        times_ns = np.array([self.arrivals_ns[stamp] for stamp in arrived])
        called_ms, received_ms = (times_ns - np.array(arrived)[:, None]).T / 1e6
        return {
            **{f"p{p}_ms": float(np.percentile(called_ms, p)) for p in PERCENTILES},
            **{f"received_p{p}_ms": float(np.percentile(received_ms, p)) for p in PERCENTILES},
            **self._told_ms,
            "sent": count,
            "received": len(arrived),
            "points": early,
            "cpu_percent": cpu,
            "cpu_percent_sum": sum(cpu.values()),
        }

    def _publish(self, scene: BenchmarkScene, pixels: NDArray[np.uint8], encoding: str) -> int:
        """Publish an image and its calibration, stamped now; return the stamp in ns."""
        from builtin_interfaces.msg import Time
        from std_msgs.msg import Bool, Header

        from cardbox_tracker.ros.messages.conversions import camera_info_message, image_message

        if encoding == "bgr8":
            pixels = np.repeat(pixels[..., None], 3, axis=2)
        image = image_message(Header(frame_id="camera"), pixels, encoding)
        info = camera_info_message(image.header, scene.camera)
        now_ns = time.time_ns()
        image.header.stamp = Time(sec=now_ns // 10**9, nanosec=now_ns % 10**9)
        self._image.publish(image)
        self._info.publish(info)
        if ROBOT in self._processes:
            self._grip.publish(Bool(data=True))
        return now_ns

    def close(self) -> None:
        """Destroy node and executor."""
        from rclpy.utilities import try_shutdown

        self._executor.shutdown()
        self._listening.join()
        self._node.destroy_node()
        try_shutdown()


def _listen(executor: Any) -> None:
    from rclpy.executors import ExternalShutdownException

    with suppress(ExternalShutdownException):
        executor.spin()


def _cpu_s(pid: int) -> float:
    """Return the processor time of a process so far, seconds."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _rss_mb(pid: int) -> float:
    """Return the resident memory of a process, MB."""
    pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
