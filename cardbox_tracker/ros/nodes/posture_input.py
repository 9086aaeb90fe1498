"""Joins the tracker's messages of each image, for nodes that use its postures."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

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
    """What the tracker says of an image."""

    stamp_ns: int  #: its stamp; without a posture that of the image before
    state: str  #: tracking state
    body: BodyModel | None  #: the person; None if not known yet
    joints: JointState | None = None  #: joint states; None without a posture, as the rest
    stddev: JointState | None = None  #: their deviations
    hands: JointState | None = None  #: how open the hands are; None if that is not known
    #: state and chance to be wrong by keypoint; None if not known
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
        self._latest: dict[str, Any] = {}
        node.subscribe(String, "body_model", self._on_model, qos.LATCHED)
        if has_states:
            node.subscribe(String, "tracking_state", self._on_state, qos.RESULT)
        kept = {"keypoint_states": DiagnosticArray, "hands": JointState} if has_states else {}
        for topic, kind in (kept | {"joint_states": JointState}).items():
            node.subscribe(kind, topic, partial(self._keep, topic), qos.RESULT)
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

    def _keep(self, topic: str, message: Any, _: int) -> None:
        self._latest[topic] = message

    def _on_stddev(self, message: JointState, sent_ns: int) -> None:
        """Take the image; the deviations come after the joints, with the same stamp."""
        stamp = message.header.stamp
        here = {topic: one for topic, one in self._latest.items() if one.header.stamp == stamp}
        if "joint_states" not in here:
            return
        stamp_ns = conversions.stamp_ns(stamp)
        if not self._node.diagnostics.input.add(stamp_ns).is_usable:
            return
        self._stamp_ns = stamp_ns
        states = here.get("keypoint_states")
        points = None if states is None else chances_of(states)
        found = here["joint_states"], message, here.get("hands"), points
        self._take(Tracked(stamp_ns, self._state, self._body, *found))
        if self._body is None:
            self._node.diagnostics.wait_for(
                f"the body model on {self._node.resolve('body_model')}; the node initializer "
                "sends it when it starts with its parameter model_file, or after it has measured "
                "the person"
            )
            return
        self._node.diagnostics.working(sent_ns)
