"""``cardbox view --live``: the results of the running nodes in the viewer."""

from __future__ import annotations

from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import String

from cardbox_tracker.applications.viewing.scene import Handler, Scene, handlers_of
from cardbox_tracker.recordings.outputs import joints_of
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode, run_node

_ROBOT = "retarget"
_TOPICS = {
    "body_model": (String, qos.LATCHED),
    "tracking_state": (String, qos.RESULT),
    "joint_states": (JointState, qos.RESULT),
    "joint_states_stddev": (JointState, qos.RESULT),
    "keypoint_states": (DiagnosticArray, qos.RESULT),
    "keypoints": (PoseArray, qos.RESULT),
    "overlay": (Image, qos.SENSOR_DATA),
}


class LiveView(CardboxNode):
    """Passes the results of the tracker and of the node ``retarget`` to the viewer."""

    def __init__(self, scene: Scene) -> None:
        super().__init__("cardbox_view")
        self._scene = scene
        self._latest_ns: int | None = None
        self.diagnostics.wait_for(f"results on {self.resolve('joint_states')}")
        handlers = handlers_of(scene, "the tracker")
        for topic, (kind, profile) in _TOPICS.items():
            show = partial(self._show, handlers[f"/{topic}"], topic)
            self.subscribe(kind, topic, show, profile)
        description, joints = f"{_ROBOT}/robot_description", f"{_ROBOT}/joint_states"
        self.subscribe(String, description, lambda m, _: scene.robot(_ROBOT, m.data), qos.LATCHED)
        self.subscribe(JointState, joints, self._on_robot_joints, qos.RESULT)

    def _show(self, handler: Handler, topic: str, message: Any, sent_ns: int) -> None:
        if topic == "joint_states":
            self._latest_ns = conversions.stamp_ns(message.header.stamp)
            self.diagnostics.working(sent_ns)
        # The state has no stamp; it is sent before the other results of its image.
        if topic != "tracking_state" or self._latest_ns is not None:
            handler(self._latest_ns or 0, message)

    def _on_robot_joints(self, message: JointState, _: int) -> None:
        stamp_ns = conversions.stamp_ns(message.header.stamp) or self._latest_ns
        if stamp_ns:
            self._scene.robot_joints(stamp_ns, _ROBOT, joints_of(message))


def show_nodes(scene: Scene) -> int:
    """Show the nodes' results until Ctrl-C; return 0, or another exit code if it cannot start."""
    return run_node(lambda: LiveView(scene), ["cardbox_view"])
