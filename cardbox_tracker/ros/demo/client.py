"""The demo's ROS client, which calls services, subscribes to topics and records the results."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.utilities import try_shutdown
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import String
from std_srvs.srv import Trigger

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.outputs import OUTPUTS, positions_of
from cardbox_tracker.recordings.result_bag import BagTransforms
from cardbox_tracker.ros.messages import results
from cardbox_tracker.ros.messages.results import mean_iou_of
from cardbox_tracker.ros.nodes.camera_poses import silhouettes_of
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.processes import Nodes

# Without a cache, each node compiles at its start.
_START_S = 600.0
_QUIET_S = 3.0
_UNRELIABLE = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
# The bag of 'cardbox track --bag' has the same topics; /tf is derived from two of them.
_OF_PERSON = {
    "body_model": (String, qos.LATCHED),
    "robot_description": (String, qos.LATCHED),
    **{output.topic: (results.message_type(output.kind), qos.REPLAY) for output in OUTPUTS},
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
        """Subscribe to the topics of nodes for one camera, or for several camera namespaces."""
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
            self._transforms.write(self._stamp_ns, positions_of(results.joint_values_of(message)))
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
        """Wait until the player pauses at ``time_s`` and its images have come out as silhouettes.

        Args:
            time_s: time from the start of the bag.
            stamp_ns: stamp of the last image before it.
        """
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
