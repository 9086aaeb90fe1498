"""``cardbox view --live``: the results of the running nodes in the viewer."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import String

from cardbox_tracker.applications.viewing.scene import Scene
from cardbox_tracker.ros.messages import conversions, results
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode, run_node

_ROBOT = "retarget"


class LiveView(CardboxNode):
    """Passes the results of the tracker and of the node ``retarget`` to the viewer."""

    def __init__(self, scene: Scene) -> None:
        """Subscribe."""
        super().__init__("cardbox_view")
        self._scene = scene
        self._latest_ns: int | None = None
        self.diagnostics.wait_for(f"results on {self.resolve('joint_states')}")
        self.subscribe(String, "body_model", self._on_model, qos.LATCHED)
        self.subscribe(String, "tracking_state", self._on_state, qos.RESULT)
        self.subscribe(JointState, "joint_states", self._on_joints, qos.RESULT)
        self.subscribe(
            JointState,
            "joint_states_stddev",
            lambda m, _: scene.deviations(_stamp_ns(m), results.joint_values_of(m)),
            qos.RESULT,
        )
        self.subscribe(
            DiagnosticArray,
            "keypoint_states",
            lambda m, _: scene.keypoint_states(_stamp_ns(m), [one.message for one in m.status]),
            qos.RESULT,
        )
        self.subscribe(
            PoseArray,
            "keypoints",
            lambda m, _: scene.keypoints(_stamp_ns(m), results.points_of(m).points_m),
            qos.RESULT,
        )
        self.subscribe(
            String,
            f"{_ROBOT}/robot_description",
            lambda m, _: scene.robot(_ROBOT, m.data),
            qos.LATCHED,
        )
        self.subscribe(JointState, f"{_ROBOT}/joint_states", self._on_robot_joints, qos.RESULT)
        self.subscribe(
            Image,
            "overlay",
            lambda m, _: scene.image(_stamp_ns(m), conversions.image_of(m)),
            qos.SENSOR_DATA,
        )

    def _on_model(self, message: String, _: int) -> None:
        self._scene.model(message.data, self.resolve("body_model"))

    def _on_joints(self, message: JointState, sent_ns: int) -> None:
        self._latest_ns = _stamp_ns(message)
        self._scene.joints(self._latest_ns, results.joint_values_of(message))
        self.diagnostics.working(sent_ns)

    def _on_robot_joints(self, message: JointState, _: int) -> None:
        stamp_ns = _stamp_ns(message) or self._latest_ns
        if stamp_ns:
            self._scene.robot_joints(stamp_ns, _ROBOT, results.joint_values_of(message))

    def _on_state(self, message: String, _: int) -> None:
        # The state has no stamp; it is sent before the other results of its image.
        if self._latest_ns is not None:
            self._scene.state(self._latest_ns, message.data)


def _stamp_ns(message: DiagnosticArray | Image | JointState | PoseArray) -> int:
    return conversions.stamp_ns(message.header.stamp)


def show_nodes(scene: Scene) -> int:
    """Show the nodes' results until Ctrl-C; return 0, or another exit code if it cannot start."""
    return run_node(lambda: LiveView(scene), ["cardbox_view"])
