"""How long the nodes take from an image's stamp to the joint states, over real DDS.

A publisher in this process plays a camera: the empty scene, then a person who waves to and fro,
each picture stamped with the time it is sent. The nodes are processes of their own, started as a
user would. What counts is when a JointState with that stamp arrives.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.model_file import save_body_model
from cardbox_tracker.demo.processes import Nodes, isolate, running_nodes
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.evaluation.benchmark_scene import BenchmarkScene, make_scene

RATES_HZ = (15, 30, 60)
STREAMS = (("mono8", 320, 240), ("bgr8", 640, 480))
NODES = ("background", "initializer", "tracker")

_START_S = 30.0
_LAST_S = 0.5


def measure_nodes(seconds: float, report: Callable[[float], None]) -> dict[str, Any] | None:
    """Measure every stream at every rate for ``seconds``; None where ROS is not installed."""
    try:
        import rclpy  # noqa: F401
    except ImportError:
        return None
    isolate()
    with TemporaryDirectory() as folder, running_nodes(Path(folder)) as nodes:
        camera = _CameraAndListener(nodes)
        try:
            scenes = {stream: make_scene(*stream[1:], 60) for stream in STREAMS}
            model = Path(folder) / "body.yaml"
            save_body_model(scenes[STREAMS[0]].body, model)
            ready_s = {name: camera.start(name, model) for name in NODES}
            streams = {}
            for i, (stream, scene) in enumerate(scenes.items()):
                camera.learn(scene, stream[0])
                for j, rate in enumerate(RATES_HZ):
                    name = f"{stream[0]} {stream[1]}x{stream[2]} at {rate} Hz"
                    streams[name] = camera.measure(scene, stream[0], rate, seconds)
                    report((i * len(RATES_HZ) + j + 1) / (len(STREAMS) * len(RATES_HZ)))
            memory = {name: _rss_mb(nodes.pid(name)) for name in NODES}
        finally:
            camera.close()
    return {"ready_s": ready_s, "rss_mb": memory, "streams": streams}


class _CameraAndListener:
    """Publishes pictures and takes note of when their joint states arrive."""

    def __init__(self, nodes: Nodes) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from sensor_msgs.msg import CameraInfo, Image, JointState

        from cardbox_tracker.ros import qos

        self._nodes = nodes
        rclpy.init(args=[])
        self._node = rclpy.create_node("cardbox_benchmark", enable_rosout=False)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._image = self._node.create_publisher(Image, "image_raw", qos.CAMERA)
        self._info = self._node.create_publisher(CameraInfo, "camera_info", qos.CAMERA)
        self._node.create_subscription(JointState, "joint_states", self._arrived, qos.RESULT)
        self._arrivals_ns: dict[int, int] = {}

    def _arrived(self, message: Any) -> None:
        now_ns = time.time_ns()
        stamp = message.header.stamp
        self._arrivals_ns[stamp.sec * 10**9 + stamp.nanosec] = now_ns

    def start(self, name: str, model: Path) -> float:
        """Start a node; return how long it took until it said what it waits for, seconds."""
        began = time.monotonic()
        arguments = ("--ros-args", "-p", f"model_file:={model}") if name == "tracker" else ()
        self._nodes.start(name, *arguments)
        while "waiting for" not in self._nodes.text(name):
            time.sleep(0.01)
            self._nodes.check()
            if time.monotonic() - began > _START_S:
                raise CardboxError(f"the node {name} was not ready within {_START_S:g} s")
        return time.monotonic() - began

    def learn(self, scene: BenchmarkScene, encoding: str) -> None:
        """Show the empty scene until silhouettes come; the camera changed, so it is learned."""
        end = time.monotonic() + _START_S
        while self._info.get_subscription_count() == 0 or self._image.get_subscription_count() == 0:
            self._executor.spin_once(timeout_sec=0.05)
            if time.monotonic() > end:
                raise CardboxError("the background node did not subscribe to the pictures")
        for i in range(3 * len(scene.empty)):
            self._publish(scene, scene.empty[i % len(scene.empty)], encoding)
            self._spin_until(time.monotonic() + 0.03)

    def measure(
        self, scene: BenchmarkScene, encoding: str, rate_hz: float, seconds: float
    ) -> dict[str, Any]:
        """Publish for ``seconds``; return latencies, losses and the nodes' processor time."""
        there_and_back = [*scene.pictures, *scene.pictures[::-1]]
        self._arrivals_ns.clear()
        count = max(2, int(seconds * rate_hz))
        sent = []
        began = time.monotonic()
        used = {name: _cpu_s(self._nodes.pid(name)) for name in NODES}
        for i in range(count):
            sent.append(self._publish(scene, there_and_back[i % len(there_and_back)], encoding))
            self._spin_until(began + (i + 1) / rate_hz)
        lasted_s = time.monotonic() - began
        cpu = {
            name: 100.0 * (_cpu_s(self._nodes.pid(name)) - before) / lasted_s
            for name, before in used.items()
        }
        self._spin_until(time.monotonic() + _LAST_S)
        self._nodes.check()
        latencies = [
            (self._arrivals_ns[stamp] - stamp) / 1e6 for stamp in sent if stamp in self._arrivals_ns
        ]
        if not latencies:
            raise CardboxError("no joint states arrived; the nodes do not track")
        return {
            **{f"p{p}_ms": float(np.percentile(latencies, p)) for p in (50, 95, 99)},
            "sent": count,
            "received": len(latencies),
            "cpu_percent": cpu,
            "cpu_percent_sum": sum(cpu.values()),
        }

    def _publish(self, scene: BenchmarkScene, picture: NDArray[np.uint8], encoding: str) -> int:
        """Publish a picture, then its calibration, as drivers do, stamped now; the stamp in ns."""
        from builtin_interfaces.msg import Time
        from std_msgs.msg import Header

        from cardbox_tracker.ros.conversions import camera_info_message, image_message

        if encoding == "bgr8":
            picture = np.repeat(picture[..., None], 3, axis=2)
        image = image_message(Header(frame_id="camera"), picture, encoding)
        info = camera_info_message(image.header, scene.camera)
        now_ns = time.time_ns()
        image.header.stamp = Time(sec=now_ns // 10**9, nanosec=now_ns % 10**9)
        self._image.publish(image)
        self._info.publish(info)
        return now_ns

    def _spin_until(self, when_s: float) -> None:
        while (left_s := when_s - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left_s)

    def close(self) -> None:
        """Leave the graph."""
        from rclpy.utilities import try_shutdown

        self._executor.shutdown()
        self._node.destroy_node()  # type: ignore[no-untyped-call]
        try_shutdown()


def _cpu_s(pid: int) -> float:
    """Processor time of a process so far, seconds."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _rss_mb(pid: int) -> float:
    """Memory that a process holds, MB."""
    pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
