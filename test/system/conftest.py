"""Real nodes in separate processes over DDS, with a separate domain for each graph."""

from __future__ import annotations

import atexit
import ctypes
import functools
import itertools
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.camera.view import OtherCamera, View
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import reference_posture

# The limit must only end tests that hang, not slow ones.
WAIT_S = 90.0
STOP_S = 30.0


class Scene:
    """A noisy room and a person drawn from the body model itself, 320x240.

    Attributes:
        body: the person's true sizes and place.
        camera: the camera that sees them.
    """

    def __init__(self, lateral_m: float = 0.05) -> None:
        self.body = BodyModel.of(distance_m=2.3, hip_height_m=-0.45, lateral_m=lateral_m)
        self.camera = Camera(320, 240, 300.0, 300.0, 159.5, 119.5)
        self._rng = np.random.default_rng(1)

    def silhouette(self, posture: NDArray[np.float64] | str | None) -> NDArray[np.uint8]:
        """Return the silhouette (H, W) of a posture (12,) or a reference; None for nobody."""
        if posture is None:
            return np.zeros((self.camera.height, self.camera.width), np.uint8)
        if isinstance(posture, str):
            posture = reference_posture(posture)
            posture[0] = self.body.placement.lateral_m
        return render(cardbox_patches(self.body, posture), self.camera)

    def outlines(
        self, other: Camera, pose: NDArray[np.float64], nearer_m: float = 0.0
    ) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Return the silhouettes of the front posture in this camera and in another one.

        Args:
            other: the other camera.
            pose: (4, 4) transform of points from this camera's frame to the other's.
            nearer_m: how much nearer than measured the person stands.
        """
        view = View.of(self.body, self.camera, OtherCamera(other, Extrinsics.of(pose)))
        state = np.append(reference_posture("front"), [nearer_m, 0.0])
        state[0] = self.body.placement.lateral_m
        seen = (self.body, self.camera, state), (view.body, view.camera, view.states(state))

        def outline(body: Any, camera: Camera, state: NDArray[np.float64]) -> NDArray[np.uint8]:
            place = body.placement
            placed = body.with_values(
                distance_m=place.distance_m - state[12], hip_height_m=place.hip_height_m + state[13]
            )
            return render(cardbox_patches(placed, state[:12]), camera)

        first, second = (outline(*one) for one in seen)
        return first, second

    def image(self, posture: NDArray[np.float64] | str | None) -> NDArray[np.uint8]:
        """Return the noisy image (H, W) of a posture (12,) or a reference; None for nobody."""
        clean = np.where(self.silhouette(posture) > 0, 190.0, 90.0)
        return np.clip(clean + self._rng.normal(0, 2, clean.shape), 0, 255).astype(np.uint8)


# A process that has imported the nodes and loaded their code, of which each node is a copy: a node
# then starts at once. The parent of a copy ends, so that the tests' process inherits the copy.
SERVER = """
import inspect, json, os, sys
from rclpy.type_support import check_for_type_support
from rosbags.typesys import Stores, get_typestore
from cardbox_tracker.start import main
from cardbox_tracker.ros.nodes import play_bag_node, single_process
from cardbox_tracker.tracking import precompile
for part in json.loads(precompile.FILM_KERNELS.read_text()).items():
    precompile.compile_each(part)
# What every node would do on its own: track once, find its messages' code, and log from a module.
precompile._call_all(tuple(precompile.PRESETS), True, True)
for kind in [kind for module in list(sys.modules.values()) if hasattr(module, "__path__")
    for kind in vars(module).values() if hasattr(kind, "__import_type_support__")]:
    check_for_type_support(kind)
get_typestore(Stores.ROS2_JAZZY)
inspect.getmodule(inspect.currentframe())
for line in sys.stdin:
    words, log, environment = json.loads(line)
    if parent_of_copy := os.fork():
        os.waitpid(parent_of_copy, 0)
        print("started", flush=True)
    elif copy := os.fork():
        print(copy, flush=True)
        os._exit(0)
    else:
        for number, path in enumerate((os.devnull, log, log)):
            os.dup2(os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND), number)
        os.environ.clear()
        os.environ.update(environment)
        sys.argv = ["", *words]
        sys.exit(main())
"""
# PR_SET_CHILD_SUBREAPER of <linux/prctl.h>.
SUBREAPER = 36


@functools.cache
def server() -> subprocess.Popen[str]:
    """Start the process that nodes are copies of; it ends with its input."""
    started = subprocess.Popen(
        [sys.executable, "-uc", SERVER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    atexit.register(started.communicate)
    return started


class Process:
    """A node in a separate process with a log file."""

    def __init__(self, name: str, arguments: tuple[str, ...], log: Path, domain: int) -> None:
        self.log = log
        self.code: int | None = None
        log.touch()
        environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
        of = server()
        ctypes.CDLL(None).prctl(SUBREAPER, 1)
        print(json.dumps([[name, *arguments], str(log), environment]), file=of.stdin, flush=True)
        self.pid = int(of.stdout.readline())
        assert of.stdout.readline() == "started\n"
        ctypes.CDLL(None).prctl(SUBREAPER, 0)

    def poll(self) -> int | None:
        """Return the exit code, which is minus the number of a signal; None before the end."""
        if self.code is None:
            ended, status = os.waitpid(self.pid, os.WNOHANG)
            self.code = os.waitstatus_to_exitcode(status) if ended else None
        return self.code

    def text(self) -> str:
        """Return the output so far."""
        return self.log.read_text()

    def stop(self, number: int = signal.SIGTERM) -> int:
        """Stop the process by a signal, and return its exit code.

        The code is negative if the process did not end and had to be killed.
        """
        end = time.monotonic() + STOP_S
        while self.poll() is None:
            os.kill(self.pid, number)
            number = 0 if time.monotonic() < end else signal.SIGKILL
            time.sleep(0.01)
        return self.code


class Graph:
    """The nodes under test, and a node that communicates with them."""

    def __init__(self, folder: Path, domain: int) -> None:
        import rclpy
        from rclpy.context import Context
        from rclpy.executors import SingleThreadedExecutor

        self.domain = domain
        self.folder = folder
        self.context = Context()
        rclpy.init(context=self.context, domain_id=self.domain)
        self.node = rclpy.create_node("probe", context=self.context, enable_rosout=False)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.processes: list[Process] = []
        self._stamp_ns = 1_000_000_000_000
        self._numbers = itertools.count()

    def start(self, name: str, *arguments: str, **parameters: Any) -> Process:
        """Start the node ``name`` with ROS parameters; ``arguments`` come before them.

        ``cardbox_nodes`` runs all nodes in one process.
        """
        ros = [word for key, value in parameters.items() for word in ("-p", f"{key}:={value}")]
        log = self.folder / f"{name}_{next(self._numbers)}.log"
        extra = ("--ros-args", *ros) if ros else ()
        process = Process(name, (*arguments, *extra), log, self.domain)
        self.processes.append(process)
        return process

    def close(self) -> None:
        """Stop all nodes; fail the test if one did not end cleanly."""
        codes = {process.log.name: process.stop() for process in self.processes}
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()
        bad = {name: code for name, code in codes.items() if code != 0}
        assert not bad, "\n".join(
            f"{name} ended with {code}:\n{(self.folder / name).read_text()[-2000:]}"
            for name, code in bad.items()
        )

    def wait(self, condition: Callable[[], Any], what: str, timeout_s: float = WAIT_S) -> Any:
        """Spin until ``condition`` is true and return its value."""
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            value = condition()
            if value:
                return value
            self.executor.spin_once(timeout_sec=0.02)
        logs = "\n".join(f"--- {p.log.name}\n{p.text()[-1500:]}" for p in self.processes)
        raise AssertionError(f"{what}: not within {timeout_s:g} s\n{logs}")

    def ended(self, process: Process) -> int | None:
        """Wait until a process ends by itself, and return its exit code."""
        self.wait(lambda: process.poll() is not None, f"the end of {process.log.name}")
        self.processes.remove(process)
        return process.code

    def spin(self, duration_s: float) -> None:
        """Spin for a while."""
        end = time.monotonic() + duration_s
        while (left := end - time.monotonic()) > 0:
            self.executor.spin_once(timeout_sec=left)

    def collect(self, kind: Any, topic: str, profile: Any = None) -> list[Any]:
        """Return a list to which every message on ``topic`` is added from now on."""
        from cardbox_tracker.ros.runtime import qos

        messages: list[Any] = []
        self.node.create_subscription(kind, topic, messages.append, profile or qos.RESULT)
        return messages

    def call(self, name: str, timeout_s: float = WAIT_S) -> Any:
        """Call a Trigger service and return its response."""
        from std_srvs.srv import Trigger

        client = self.node.create_client(Trigger, name)
        self.wait(client.service_is_ready, f"service {name}")
        future = client.call_async(Trigger.Request())
        self.wait(future.done, f"answer of {name}", timeout_s)
        self.node.destroy_client(client)
        return future.result()

    def diagnosis(self, node: str, words: str = "") -> Any:
        """Wait for a diagnostic status of ``node`` with ``words`` in its message; return it."""
        from diagnostic_msgs.msg import DiagnosticArray

        arrays = self.collect(DiagnosticArray, "/diagnostics")

        def found() -> Any:
            for array in arrays:
                for status in array.status:
                    if status.name.startswith(f"{node}:") and words in status.message:
                        return status
            return None

        return self.wait(found, f"diagnostics of {node} with '{words}'")

    def next_stamp(self) -> Any:
        """Return a stamp one image (1/15 s) after the last."""
        from builtin_interfaces.msg import Time

        self._stamp_ns += 66_666_667
        return Time(sec=self._stamp_ns // 10**9, nanosec=self._stamp_ns % 10**9)


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory, ros_domains: Iterator[int]) -> Iterator[Graph]:
    """A graph that the tests of a module share."""
    yield from _graph(tmp_path_factory, ros_domains)


@pytest.fixture
def own_graph(
    tmp_path_factory: pytest.TempPathFactory, ros_domains: Iterator[int]
) -> Iterator[Graph]:
    """A graph of one test, whose nodes end before the next test."""
    yield from _graph(tmp_path_factory, ros_domains)


def _graph(tmp_path_factory: pytest.TempPathFactory, ros_domains: Iterator[int]) -> Iterator[Graph]:
    pytest.importorskip("rclpy", reason="rclpy is not installed")
    made = Graph(tmp_path_factory.mktemp("graph"), next(ros_domains))
    yield made
    made.close()


@pytest.fixture(scope="session")
def scene() -> Scene:
    """The drawn room and person."""
    return Scene()


@pytest.fixture(scope="session")
def make_scene() -> type[Scene]:
    """Return the class of scenes, to make one with a person at another place."""
    return Scene


@pytest.fixture(scope="session")
def deep() -> Callable[[str, str], tuple[str, ...]]:
    """What gives the arguments for a deep queue of a topic, as those of a replay are.

    A slow machine then loses no image, where live nodes would take the newest one.
    """
    from cardbox_tracker.ros.runtime import qos

    def arguments(topic: str, end: str) -> tuple[str, ...]:
        name = f"qos_overrides.{topic}.{end}"
        return ("-p", f"{name}.reliability:=reliable", "-p", f"{name}.depth:={qos.REPLAY.depth}")

    return arguments
