"""The steps of the demo: synthesize, start the nodes, call the services, record, report."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.utilities import try_shutdown
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import String
from std_srvs.srv import Trigger

from cardbox_tracker.applications.drawing.video import video_file
from cardbox_tracker.applications.reporting.page import angles_plot
from cardbox_tracker.applications.simulation.session import SessionFormat, synthesize_session
from cardbox_tracker.camera.encodings import SentImage, decode_bgr
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import make_folder, write_file
from cardbox_tracker.common.progress import progress_bar
from cardbox_tracker.person.posture import REFERENCE_NAMES
from cardbox_tracker.recordings.bag_reader import BagReader, stamp_ns_of
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.outputs import TOPICS, joints_of
from cardbox_tracker.recordings.result_bag import BagTransforms, result_writer
from cardbox_tracker.recordings.result_reader import Results, read_results
from cardbox_tracker.recordings.result_table import POINT_COLUMNS
from cardbox_tracker.recordings.truth import GroundTruth, load_ground_truth, tracking_error
from cardbox_tracker.ros.messages.results import mean_iou_of
from cardbox_tracker.ros.messages.types import class_of
from cardbox_tracker.ros.nodes.camera_poses import silhouettes_of
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.processes import Nodes, compile_kernels, isolate, running_nodes
from cardbox_tracker.search.config import PRESETS
from cardbox_tracker.tracking.estimate import UNCERTAIN

# Without a cache, each node compiles at its start.
_START_S = 600.0
_QUIET_S = 3.0
_UNRELIABLE = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
# The bag of 'cardbox track --bag' has the same topics; /tf is derived from two of them.
_OF_PERSON = {
    "body_model": (String, qos.LATCHED),
    "robot_description": (String, qos.LATCHED),
    **{topic: (class_of(kind), qos.REPLAY) for topic, kind in TOPICS.items()},
}
_OF_CAMERA = {
    "silhouette": (Image, qos.REPLAY),
    "silhouette/camera_info": (CameraInfo, qos.REPLAY),
    "overlay": (Image, _UNRELIABLE),
}


def topics_of(cameras: Sequence[str] = ()) -> dict[str, tuple[Any, QoSProfile]]:
    """Return type and QoS of each result topic, for one camera or for camera namespaces."""
    spaces = [f"{camera}/" for camera in cameras] or [""]
    of_cameras = {f"{space}{name}": kind for space in spaces for name, kind in _OF_CAMERA.items()}
    return {**_OF_PERSON, **of_cameras}


class Client:
    """Records the results in a bag, and knows how far the nodes are.

    Attributes:
        has_body: whether a measured person was published.
        initialization_iou: mean fit of the references; None before it is published.
        latest_ns: stamp of the last joint state; 0 before it.
        arrivals_s: arrival time of each joint state, monotonic seconds.
    """

    def __init__(self, nodes: Nodes, bag: BagWriter, cameras: Sequence[str] = ()) -> None:
        self._silhouettes = silhouettes_of(cameras or [""])
        self.has_body = False
        self.initialization_iou: float | None = None
        self.latest_ns = 0
        self.arrivals_s: list[float] = []
        self._player_status = ""
        self._nodes = nodes
        self._bag = bag
        self._transforms = BagTransforms(bag)
        self._stamp_ns = 0
        self._newest_ns: dict[str, int] = {}
        rclpy.init(args=[])
        self._node = rclpy.create_node("cardbox_demo", enable_rosout=False)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        for topic, (kind, profile) in topics_of(cameras).items():
            self._node.create_subscription(
                kind, topic, self.recorder(topic, kind), profile, raw=True
            )
        self._node.create_subscription(String, "play_bag/status", self._note_status, qos.LATCHED)
        self._node.create_subscription(
            DiagnosticStatus, "initializer/result", self._note_result, qos.LATCHED
        )

    def recorder(self, topic: str, kind: Any) -> Callable[[bytes], None]:
        """Return a callback that records the serialized messages of ``topic``."""
        name = f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"

        def record(raw: bytes) -> None:
            message = deserialize_message(raw, kind)
            if hasattr(message, "header"):
                stamp = message.header.stamp
                self._stamp_ns = self._newest_ns[topic] = stamp.sec * 10**9 + stamp.nanosec
            self._keep(topic, message)
            self._bag.write_raw(f"/{topic}", name, raw, self._stamp_ns)

        return record

    def _keep(self, topic: str, message: Any) -> None:
        if topic == "body_model":
            self.has_body = True
        elif topic == "robot_description":
            self._transforms.describe(message.data)
        elif topic == "joint_states":
            self._transforms.write(self._stamp_ns, joints_of(message).by_name)
            self.latest_ns = self._stamp_ns
            self.arrivals_s.append(time.monotonic())

    def _note_status(self, message: String) -> None:
        self._player_status = message.data

    def _note_result(self, message: DiagnosticStatus) -> None:
        # If the initialization failed, the service's response has the reason.
        if message.level == DiagnosticStatus.OK:
            self.initialization_iou = mean_iou_of(message)

    def wait(self, condition: Callable[[], bool], what: str, timeout_s: float = 120.0) -> None:
        """Spin until ``condition`` holds."""
        end = time.monotonic() + timeout_s
        while not condition():
            self._executor.spin_once(timeout_sec=0.05)
            self._nodes.check()
            if time.monotonic() > end:
                raise CardboxError(
                    f"waited {timeout_s:g} s for {what}; see the nodes' log files in the output "
                    "folder"
                )

    def wait_for_nodes(self) -> None:
        """Wait until the nodes are connected to each other."""
        # The initializer, too, subscribes to the first two cameras.
        wanted = [3, 3, 2, 2][: len(self._silhouettes)]
        self.wait(
            lambda: (
                [self._node.count_subscribers(topic) for topic in self._silhouettes] == wanted
                and self._node.count_publishers("joint_states") == 1
            ),
            "the nodes to find each other",
            _START_S,
        )

    def wait_for_pause(self, time_s: float, stamp_ns: int) -> None:
        """Wait until the player pauses at ``time_s``, and the image before it is a silhouette."""
        self.wait(lambda: self._player_status == f"paused at {time_s:.3f} s", f"{time_s:g} s")
        self.wait(
            lambda: min(self._newest_ns.get(one, 0) for one in self._silhouettes) >= stamp_ns,
            f"the silhouette of the last image before {time_s:g} s",
        )
        self.rest(0.5)

    def rest_until_quiet(self) -> None:
        """Spin until no joint state has come for a while, because the nodes may lag behind."""
        began_s = time.monotonic()
        while time.monotonic() - max([began_s, *self.arrivals_s[-1:]]) < _QUIET_S:
            self._executor.spin_once(timeout_sec=0.05)

    def rest(self, duration_s: float) -> None:
        """Spin for ``duration_s``."""
        end = time.monotonic() + duration_s
        while time.monotonic() < end:
            self._executor.spin_once(timeout_sec=0.05)

    def call(self, service: str) -> str:
        """Call a Trigger service and return its message."""
        client = self._node.create_client(Trigger, service)
        self.wait(client.service_is_ready, f"the service {service}")
        future = client.call_async(Trigger.Request())
        self.wait(future.done, f"the answer of {service}")
        response = future.result()
        if not response.success:
            raise CardboxError(f"{service} refused: {response.message}")
        return str(response.message)

    def close(self) -> None:
        """Destroy the node."""
        self._executor.shutdown()
        self._node.destroy_node()
        try_shutdown()


_RATE = 2.0
_NEUTRAL_S = 0.1


def run_demo(output: Path, preset: str, seed: int, cameras: int = 1) -> None:
    """Run the demo and write its results to the folder ``output``."""
    isolate()
    if cameras > 1 and not PRESETS[preset]().has_several_views:
        raise CardboxError(f"--preset {preset} is for one camera; leave it out with --cameras")
    make_folder(output)
    session = output / "session"
    with progress_bar("synthesize") as show:
        form = SessionFormat(cameras=cameras)
        synthesize_session(session, "all", seed, form, overwrite=True, progress=show)
    print("compile (one to two minutes, the first time only)", flush=True)
    compile_kernels()
    truth = load_ground_truth(session / "ground_truth.json")
    start_s = round(truth.spans["neutral"][0] + _NEUTRAL_S, 3)
    fps, iou = track_through_nodes(session, truth, start_s, output, preset, seed)
    run = {"preset": preset, "seed": seed, "fps": fps, "initialization_iou": iou}
    write_report(output, truth, truth.start_ns + round(start_s * 1e9), run)


def _last_before(truth: GroundTruth, time_s: float) -> int:
    return max(stamp for stamp in truth.frames if stamp < truth.start_ns + round(time_s * 1e9))


def track_through_nodes(
    session: Path, truth: GroundTruth, start_s: float, output: Path, preset: str, seed: int
) -> tuple[float, float]:
    """Play ``session`` to the nodes, record ``output``/bag; return rate, Hz, and mean fit."""
    pauses = {name: round(float(np.mean(truth.spans[name])), 3) for name in REFERENCE_NAMES}
    with running_nodes(output) as nodes, result_writer(output / "bag", overwrite=True) as bag:
        client = Client(nodes, bag, truth.cameras)
        try:
            topics = _start_nodes(nodes, truth, session, preset, seed)
            client.wait_for_nodes()
            stops = [f"{at_s:.3f}" for at_s in (*pauses.values(), start_s)]
            nodes.start(
                "play_bag",
                str(session),
                *("--rate", f"{_RATE:g}", "--topics", *topics, "--pause-at", *stops),
            )
            for name, at_s in pauses.items():
                client.wait_for_pause(at_s, _last_before(truth, at_s))
                print(f"initializer/capture_{name}", flush=True)
                client.call(f"initializer/capture_{name}")
                client.call("play_bag/resume")
            client.wait_for_pause(start_s, _last_before(truth, start_s))
            print("initializer/initialize", flush=True)
            client.call("initializer/initialize")
            client.wait(
                lambda: client.has_body and client.initialization_iou is not None,
                "the body model and its fit",
            )
            client.rest(1.0)
            client.call("tracker/reset")
            first = len(client.arrivals_s)
            client.call("play_bag/resume")
            end_s = max(end for _, end in truth.spans.values())
            with progress_bar("track") as show:
                while nodes.is_running("play_bag"):
                    client.rest(0.5)
                    nodes.check()
                    if client.latest_ns:
                        time_s = (client.latest_ns - truth.start_ns) / 1e9
                        show((time_s - start_s) / (end_s - start_s))
            client.rest_until_quiet()
        finally:
            client.close()
    arrivals = client.arrivals_s[first:]
    lasted_s = arrivals[-1] - arrivals[0] if len(arrivals) > 1 else float("nan")
    return (len(arrivals) - 1) / lasted_s, client.initialization_iou or 0.0


def _start_nodes(
    nodes: Nodes, truth: GroundTruth, session: Path, preset: str, seed: int
) -> list[str]:
    """Start the nodes for one camera or several; return the topics to play."""

    def parameters(**values: object) -> list[str]:
        return [word for name, value in values.items() for word in ("-p", f"{name}:={value}")]

    several = [f"/{name}" for name in truth.cameras]
    # A replay must not lose images, while live nodes drop old ones.
    deep = [
        word
        for space in several or [""]
        for topic, end in (
            (f"{space or '/camera'}/image_raw", "subscription"),
            (f"{space}/silhouette", "publisher"),
            (f"{space}/silhouette", "subscription"),
        )
        for word in (
            *("-p", f"qos_overrides.{topic}.{end}.reliability:=reliable"),
            *("-p", f"qos_overrides.{topic}.{end}.depth:=100"),
        )
    ]
    for space in several:
        called = f"background_{space[1:]}"
        nodes.start("background", "--ros-args", "-r", f"__ns:={space}", *deep, called=called)
    if several:
        together = parameters(
            cameras=f"[{', '.join(truth.cameras)}]", extrinsics_file=session / "extrinsics.yaml"
        )
    else:
        together = []
        remap = ("-r", "image_raw:=/camera/image_raw", "-r", "camera_info:=/camera/camera_info")
        nodes.start("background", "--ros-args", *remap, *deep)
    nodes.start(
        "initializer",
        "--ros-args",
        *parameters(
            person_distance_m=truth.distance_m,
            camera_pitch_deg=truth.pitch_deg,
            side_turn=truth.side_turn,
            seed=seed,
        ),
        *together,
    )
    nodes.start("tracker", "--ros-args", *parameters(preset=preset, seed=seed), *together, *deep)
    spaces = several or ["/camera"]
    return [f"{space}/{name}" for space in spaces for name in ("image_raw", "camera_info")]


_VIDEO_HZ = 15.0


def figures(results: Results, truth: GroundTruth, start_ns: int) -> dict[str, Any]:
    """Return the errors of the images from a stamp on, metres, and how many have a posture."""
    expected = {stamp for stamp in truth.frames if stamp >= start_ns}
    points_m = results.of(POINT_COLUMNS).reshape(-1, len(POINT_COLUMNS) // 3, 3)
    images = zip(results.stamp_ns.tolist(), results.state, points_m, strict=True)
    found = {s: (state, m) for s, state, m in images if s in expected and np.isfinite(m).all()}
    return {
        "cameras": max(1, len(truth.cameras)),
        "frames": len(expected),
        "frames_tracked": len(found),
        "frames_uncertain": sum(state == UNCERTAIN for state, _ in found.values()),
        **tracking_error({stamp: m for stamp, (_, m) in found.items()}, truth),
    }


def write_report(output: Path, truth: GroundTruth, start_ns: int, run: dict[str, object]) -> None:
    """Write all files about the bag in ``output`` and the values ``run``; print the table."""
    results = read_results(output / "bag")
    report = run | figures(results, truth, start_ns)
    write_file(output / "report.json", json.dumps(report, indent=2) + "\n")
    write_file(output / "angles.png", angles_plot(results))
    topic = "".join(f"/{name}" for name in [*truth.cameras][:1]) + "/overlay"
    with BagReader(output / "bag") as bag, video_file(output / "overlay.mp4", _VIDEO_HZ) as add:
        for image in map(bag.deserialize, bag.messages([topic])):
            if stamp_ns_of(image) >= start_ns:
                add(decode_bgr(SentImage.of(image)))
    rows = {
        "images after initialization": "{frames}",
        "of them tracked": "{frames_tracked}",
        "  of these uncertain": "{frames_uncertain}",
        "mean 3D error": "{mean_3d_error_m:.3f} m",
        "  of it in depth": "{depth_error_m:.3f} m",
        "initialization IoU": "{initialization_iou:.2f}",
        "joint states a second": "{fps:.1f}",
    }
    print("\n".join(f"  {name:32s}{text.format(**report):>10s}" for name, text in rows.items()))
    print(
        f"see {output}/overlay.mp4 and {output}/angles.png; "
        f"all figures are in {output}/report.json, the bag of results is {output}/bag"
    )
    tracked, expected = report["frames_tracked"], report["frames"]
    assert isinstance(tracked, int) and isinstance(expected, int)
    if 2 * tracked < expected:
        raise CardboxError(
            f"only {tracked} of {expected} images were tracked: the nodes were too slow; "
            "end other programs on this computer and run the demo again"
        )
