"""Conversion of results, of tracking and of a measurement, to messages, and of some back."""

from __future__ import annotations

from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.measuring.config import InitializationResult, fit_text
from cardbox_tracker.person.sizes import SIZE_NAMES, FloatArray
from cardbox_tracker.person.skeleton import STATE_NAMES
from cardbox_tracker.recordings import messages
from cardbox_tracker.recordings.messages import finite
from cardbox_tracker.recordings.outputs import Value, joints_of
from cardbox_tracker.ros.messages.types import new_message


def message_of(header: Header, value: Value) -> Any:
    """Return the message of :func:`.recordings.messages.message_of`; it raises the same errors."""
    return messages.message_of(new_message, header, value)


def state_of(values: JointState, stddev: JointState) -> FloatArray:
    """Return values and deviations of ``STATE_NAMES``, (2, n), nan for those that are missing.

    Raises NotFiniteError if a value is not a finite number, and CardboxError if a joint of the
    posture is missing, or the numbers of names and values differ.
    """
    try:
        both = joints_of(values), joints_of(stddev)
        for joints in both:
            finite(joints.posture, "joint states")
            finite(joints.values, "joint states")
    except ValueError as error:
        raise CardboxError(f"joint states are not the tracker's: {error}") from None
    return np.array([joints.of(STATE_NAMES) for joints in both])


_MEAN_IOU = "mean iou"


def measured_message(result: InitializationResult, text: str) -> DiagnosticStatus:
    """Return level OK, ``text``, and the fit: ``mean iou``, and ``iou`` of each reference."""
    values = {_MEAN_IOU: result.mean_iou}
    values |= {f"iou {name}": iou for name, iou in result.iou.items()}
    message = refused_message(text)
    message.level = DiagnosticStatus.OK
    message.values = [KeyValue(key=key, value=f"{value:.4f}") for key, value in values.items()]
    return message


def refused_message(text: str) -> DiagnosticStatus:
    """Return level ERROR and ``text``, the reason."""
    named = {"name": "initialization", "hardware_id": "cardbox_tracker"}
    return DiagnosticStatus(level=DiagnosticStatus.ERROR, message=text, **named)


def mean_iou_of(message: DiagnosticStatus) -> float:
    """Return the mean fit of the references, 0 to 1, or raise ValueError with the reason."""
    values = {entry.key: entry.value for entry in message.values}
    if _MEAN_IOU not in values:
        raise ValueError(message.message)
    return float(values[_MEAN_IOU])


def answer_text(result: InitializationResult) -> str:
    """Return the answer of the service with the fit and the sizes in cm."""
    sizes = ", ".join(
        f"{name} {100 * value:.1f}"
        for name, value in zip(SIZE_NAMES, result.body.sizes, strict=True)
    )
    return f"measured; {fit_text(result)}; sizes in cm: {sizes}"
