"""The node ``rula`` publishes RULA scores and their probabilities for the tracked posture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32, Float32MultiArray, MultiArrayDimension, MultiArrayLayout

from cardbox_tracker.applications.ergonomics.rula import (
    POSTURE_ROWS,
    RULA,
    SAMPLES,
    RulaConfig,
    ScoreDistribution,
    expected,
    part_values,
    sampled_scores,
)
from cardbox_tracker.ros.messages.results import state_of
from cardbox_tracker.ros.nodes.posture_input import PostureInput, Tracked
from cardbox_tracker.ros.runtime import qos
from cardbox_tracker.ros.runtime.command_line import node_main
from cardbox_tracker.ros.runtime.node import CardboxNode
from cardbox_tracker.ros.runtime.parameter_fields import NodeParameters, at_start
from cardbox_tracker.ros.runtime.parameters import LiveParameters
from cardbox_tracker.search.particles import normal_postures


@dataclass(frozen=True)
class RulaParameters(NodeParameters, RulaConfig):
    """Score the strain on arms, neck and trunk (RULA) while the tracker follows a person."""

    seed: int = at_start(0, "random seed of the posture samples", limits=(0, 2**31 - 1))


class RulaNode(CardboxNode):
    """Scores each posture of the tracker."""

    def __init__(self, **options: Any) -> None:
        super().__init__("rula", **options)
        self.parameters = LiveParameters(self, RulaParameters)
        self._rng = np.random.default_rng(self.parameters.value.seed)
        self._score = self.advertise(Float32, "rula/score", qos.RESULT)
        self._chances = self.advertise(Float32MultiArray, "rula/chances", qos.RESULT)
        self._report = self.advertise(DiagnosticArray, "rula/report", qos.RESULT)
        self._input = PostureInput(self, self._rate, has_states=False)

    def _rate(self, image: Tracked) -> None:
        joints, message = image.joints, image.stddev
        if joints is None or message is None or image.body is None:
            return
        known, config = state_of(joints, message), self.parameters.value
        posture, stddev = known[:, POSTURE_ROWS]
        postures = normal_postures(posture, stddev, SAMPLES, self._rng)
        # The tracker leaves out the deviations of a neck, or a hand, that it does not know.
        scores, measured = sampled_scores(image.body, known, postures, config, self._rng)
        self._score.publish(Float32(data=scores.mean))
        count = len(scores.grand)
        each = MultiArrayDimension(label="score", size=count, stride=count)
        layout = MultiArrayLayout(dim=[each])
        self._chances.publish(Float32MultiArray(layout=layout, data=scores.grand.tolist()))
        parts = part_values(scores, config, measured)
        self._report.publish(_report_message(message, scores, parts, self.get_name()))


def _report_message(
    message: JointState, scores: ScoreDistribution, parts: Mapping[str, str], name: str
) -> DiagnosticArray:
    """Return the scores of one image, and those of its ``parts``, under its header."""
    meaning = next(text for low, high, text in RULA.levels if low <= scores.likeliest <= high)
    values = {
        "score": f"{scores.mean:.2f}",
        "likeliest score": str(scores.likeliest),
        "score of the mean posture": str(scores.of_mean),
        f"chance above {RULA.above}": f"{scores.chance_above(RULA.above):.3f}",
        "score with the left arm": f"{expected(scores.left):.2f}",
        "score with the right arm": f"{expected(scores.right):.2f}",
        **parts,
    }
    is_high = scores.likeliest > RULA.above
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


main = node_main("rula", RulaNode, RulaParameters)
