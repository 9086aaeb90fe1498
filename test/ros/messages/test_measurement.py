"""Messages about the outcome of an initialization."""

from __future__ import annotations

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from cardbox_tracker.measuring.config import InitializationResult
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.ros.messages.results import mean_iou_of, measured_message, refused_message


def test_a_measurement_has_the_fit_of_each_reference_and_their_mean() -> None:
    result = InitializationResult(BodyModel(), {"front": 0.9, "side": 0.84, "arms": 0.87}, {}, {})
    message = measured_message(result, "measured; fit ...")
    assert (message.level, message.message) == (DiagnosticStatus.OK, "measured; fit ...")
    assert {entry.key: entry.value for entry in message.values} == {
        "mean iou": "0.8700",
        "iou front": "0.9000",
        "iou side": "0.8400",
        "iou arms": "0.8700",
    }
    assert mean_iou_of(message) == 0.87


def test_a_refusal_has_the_reason_and_no_fit() -> None:
    message = refused_message("nobody is in the image")
    assert (message.level, message.values) == (DiagnosticStatus.ERROR, [])
    with pytest.raises(ValueError, match="nobody"):
        mean_iou_of(message)
