"""Joins the tracker's messages of each image, for nodes that use its postures."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import loads_body_model
from cardbox_tracker.recordings.outputs import chances_of
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.tracking.estimate import TRACKING, UNCERTAIN


class Tracked(NamedTuple):
    """What the tracker says of an image.

    Attributes:
        stamp_ns: its stamp; without a posture that of the image before.
        state: tracking state.
        body: the person; None if not known yet.
        joints: joint states; None without a posture, as the rest.
        stddev: their deviations.
        hands: how open the hands are; None if that is not known.
        keypoints: state and chance to be wrong by keypoint; None if not known.
    """

    stamp_ns: int
    state: str
    body: BodyModel | None
    joints: JointState | None = None
    stddev: JointState | None = None
    hands: JointState | None = None
    keypoints: dict[str, tuple[str, float]] | None = None


class PostureInput:
    """Calls a function with what the tracker says of each image, with or without a posture."""

    def __init__(
        self, node: CardboxNode, take: Callable[[Tracked], None], has_states: bool = True
    ) -> None:
        """Subscribe for ``node``; with ``has_states`` also to states, keypoints and hands."""
        self._node, self._take = node, take
        self._body: BodyModel | None = None
        self._state, self._stamp_ns = "", 0
        self._joints, self._hands, self._points = JointState(), JointState(), DiagnosticArray()
        node.subscribe(String, "body_model", self._on_model, qos.LATCHED)
        if has_states:
            node.subscribe(String, "tracking_state", self._on_state, qos.RESULT)
            node.subscribe(DiagnosticArray, "keypoint_states", self._on_points, qos.RESULT)
            node.subscribe(JointState, "hands", self._on_hands, qos.RESULT)
        node.subscribe(JointState, "joint_states", self._on_joints, qos.RESULT)
        node.subscribe(JointState, "joint_states_stddev", self._on_stddev, qos.RESULT)
        postures = f"postures on {node.resolve('joint_states')}"
        node.diagnostics.source = postures
        node.diagnostics.wait_for(f"{postures} (is the tracker running?)")

    def _on_model(self, message: String, _: int) -> None:
        self._body = loads_body_model(message.data, source=self._node.resolve("body_model"))

    def _on_state(self, message: String, _: int) -> None:
        # The state comes before the joints of its image, or without joints.
        self._state = message.data
        if message.data not in (TRACKING, UNCERTAIN):
            self._take(Tracked(self._stamp_ns, message.data, self._body))

    def _on_points(self, message: DiagnosticArray, _: int) -> None:
        self._points = message

    def _on_joints(self, message: JointState, _: int) -> None:
        self._joints = message

    def _on_hands(self, message: JointState, _: int) -> None:
        self._hands = message

    def _on_stddev(self, message: JointState, sent_ns: int) -> None:
        """Take the image; the deviations come after the joints, with the same stamp."""
        stamp = message.header.stamp
        if self._joints.header.stamp != stamp:
            return
        stamp_ns = conversions.stamp_ns(stamp)
        if not self._node.diagnostics.input.add(stamp_ns).is_usable:
            return
        self._stamp_ns = stamp_ns
        hands = self._hands if self._hands.header.stamp == stamp else None
        points = chances_of(self._points) if self._points.header.stamp == stamp else None
        found = self._joints, message, hands, points
        self._take(Tracked(stamp_ns, self._state, self._body, *found))
        if self._body is None:
            self._node.diagnostics.wait_for(
                f"the body model on {self._node.resolve('body_model')}; the node initializer "
                "sends it when it starts with its parameter model_file, or after it has measured "
                "the person"
            )
            return
        self._node.diagnostics.working(sent_ns)
