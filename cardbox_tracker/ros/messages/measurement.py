"""Conversion of the outcome of an initialization to a message and back."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from cardbox_tracker.measuring.config import InitializationResult, fit_text
from cardbox_tracker.person.sizes import SIZE_NAMES

_NAME = "initialization"
_HARDWARE_ID = "cardbox_tracker"
_MEAN_IOU = "mean iou"


def measured_message(result: InitializationResult, text: str) -> DiagnosticStatus:
    """Return level OK, ``text``, and the fit: ``mean iou``, and ``iou`` of each reference."""
    values = {_MEAN_IOU: result.mean_iou}
    values |= {f"iou {name}": iou for name, iou in result.iou.items()}
    return DiagnosticStatus(
        level=DiagnosticStatus.OK,
        name=_NAME,
        message=text,
        hardware_id=_HARDWARE_ID,
        values=[KeyValue(key=key, value=f"{value:.4f}") for key, value in values.items()],
    )


def refused_message(text: str) -> DiagnosticStatus:
    """Return level ERROR and ``text``, the reason."""
    return DiagnosticStatus(
        level=DiagnosticStatus.ERROR, name=_NAME, message=text, hardware_id=_HARDWARE_ID
    )


def mean_iou_of(message: DiagnosticStatus) -> float:
    """Return the mean fit of the references, 0 to 1.

    Raises:
        ValueError: the initialization failed; the text has the reason.
    """
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
