"""The node ``rula`` publishes RULA scores and their probabilities for the tracked posture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32, Float32MultiArray, MultiArrayDimension, MultiArrayLayout, String

from cardbox_tracker.applications.ergonomics.config import RulaConfig
from cardbox_tracker.applications.ergonomics.rula import (
    ABOVE,
    ACTION_LEVELS,
    SAMPLES,
    ScoreDistribution,
    expected,
    part_values,
    sampled_scores,
)
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import loads_body_model
from cardbox_tracker.recordings.outputs import wrists_from
from cardbox_tracker.ros.messages import conversions
from cardbox_tracker.ros.messages.results import joint_values_of, neck_of, posture_of
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.command_line import plain_command_line
from cardbox_tracker.ros.runtime.node import CardboxNode, run_node
from cardbox_tracker.ros.runtime.parameter_fields import AT_START, NodeParameters, parameter
from cardbox_tracker.ros.runtime.parameters import LiveParameters
from cardbox_tracker.search.particles import normal_postures

_DOES = "Score the strain on arms, neck and trunk (RULA) while the tracker follows a person."


@dataclass(frozen=True)
class RulaParameters(NodeParameters, RulaConfig):
    """Score the strain on arms, neck and trunk (RULA)."""

    seed: int = parameter(
        0, "random seed of the posture samples", limits=(0, 2**31 - 1), effect=AT_START
    )


class RulaNode(CardboxNode):
    """Scores each posture of the tracker."""

    def __init__(self, **options: Any) -> None:
        """Subscribe to what the tracker publishes and wait for a body model."""
        super().__init__("rula", **options)
        self.parameters = LiveParameters(self, RulaParameters)
        self._rng = np.random.default_rng(self.parameters.value.seed)
        self._body: BodyModel | None = None
        self._joints = JointState()
        self._score = self.advertise(Float32, "rula/score", qos.RESULT)
        self._chances = self.advertise(Float32MultiArray, "rula/chances", qos.RESULT)
        self._report = self.advertise(DiagnosticArray, "rula/report", qos.RESULT)
        self._model_topic = self.resolve("body_model")
        self._joints_topic = self.resolve("joint_states")
        self.subscribe(String, "body_model", self._on_model, qos.LATCHED)
        self.subscribe(JointState, "joint_states", self._on_joints, qos.RESULT)
        self.subscribe(JointState, "joint_states_stddev", self._on_stddev, qos.RESULT)
        self.diagnostics.source = f"postures on {self._joints_topic}"
        self._wait()

    def _wait(self) -> None:
        missing = self._model_topic if self._body is None else self._joints_topic
        self.diagnostics.wait_for(f"{missing} (are the initializer and the tracker running?)")

    def _on_model(self, message: String, _: int) -> None:
        self._body = loads_body_model(message.data, source=self._model_topic)
        self._wait()

    def _on_joints(self, message: JointState, _: int) -> None:
        self._joints = message

    def _on_stddev(self, message: JointState, sent_ns: int) -> None:
        """Score the posture; the deviations come after the joints, with the same stamp."""
        if self._joints.header.stamp != message.header.stamp or self._body is None:
            return
        if not self.diagnostics.input.add(conversions.stamp_ns(message.header.stamp)).is_usable:
            return
        posture, stddev = posture_of(self._joints), posture_of(message)
        postures = normal_postures(posture, stddev, SAMPLES, self._rng)
        # The tracker leaves out the deviations of a neck, or a hand, that it does not know.
        neck, config = (neck_of(self._joints), neck_of(message)), self.parameters.value
        wrists = np.array([wrists_from(joint_values_of(one)) for one in (self._joints, message)])
        scores, measured = sampled_scores(
            self._body, posture, postures, neck, wrists, config, self._rng
        )
        self._score.publish(Float32(data=scores.mean))
        self._chances.publish(_chances_message(scores))
        parts = part_values(scores, config, measured)
        self._report.publish(_report_message(message, scores, parts, self.get_name()))
        self.diagnostics.working(sent_ns)


def _chances_message(scores: ScoreDistribution) -> Float32MultiArray:
    count = len(scores.grand)
    layout = MultiArrayLayout(dim=[MultiArrayDimension(label="score", size=count, stride=count)])
    return Float32MultiArray(layout=layout, data=scores.grand.tolist())


def _report_message(
    message: JointState, scores: ScoreDistribution, parts: Mapping[str, str], name: str
) -> DiagnosticArray:
    """Return the scores of one image, and those of its ``parts``, under its header."""
    meaning = next(text for low, high, text in ACTION_LEVELS if low <= scores.likeliest <= high)
    values = {
        "score": f"{scores.mean:.2f}",
        "likeliest score": str(scores.likeliest),
        "score of the mean posture": str(scores.of_mean),
        f"chance above {ABOVE}": f"{scores.chance_above(ABOVE):.3f}",
        "score with the left arm": f"{expected(scores.left):.2f}",
        "score with the right arm": f"{expected(scores.right):.2f}",
        **parts,
    }
    is_high = scores.likeliest > ABOVE
    return DiagnosticArray(
        header=message.header,
        status=[
            DiagnosticStatus(
                level=DiagnosticStatus.WARN if is_high else DiagnosticStatus.OK,
                name=f"{name}: RULA",
                message=meaning,
                values=[KeyValue(key=key, value=value) for key, value in values.items()],
            )
        ],
    )


def main(args: list[str] | None = None) -> int:
    """Run the node; the exit code is 0 unless it could not start."""
    return run_node(RulaNode, plain_command_line("rula", _DOES, RulaParameters, args))
