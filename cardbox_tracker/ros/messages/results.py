"""Conversion of results, of tracking and of a measurement, to messages, and of some back."""

from __future__ import annotations

import array
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, Pose, PoseArray, Quaternion, Vector3
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA, Header, String
from visualization_msgs.msg import Marker, MarkerArray

from cardbox_tracker.common.errors import CardboxError, NotFiniteError
from cardbox_tracker.measuring.config import InitializationResult, fit_text
from cardbox_tracker.person.sizes import SIZE_NAMES, FloatArray
from cardbox_tracker.person.skeleton import NECK_NAMES
from cardbox_tracker.recordings.markers import MarkerShape, Rgba
from cardbox_tracker.recordings.outputs import (
    LEVELS,
    JointValues,
    KeypointStates,
    Markers,
    Points,
    Text,
    Value,
    posture_from,
    values_from,
)


def joint_state_message(header: Header, joints: JointValues) -> JointState:
    """Return joint values or deviations, rad and m, and velocities, or raise NotFiniteError."""
    message = JointState(
        header=header,
        name=list(joints.names),
        position=array.array("d", _finite(joints.values, "joint states").tolist()),
    )
    if joints.velocities is not None:
        finite = _finite(joints.velocities, "velocities of the joints")
        message.velocity = array.array("d", finite.tolist())
    return message


def joint_values_of(message: JointState) -> JointValues:
    """Return the names and positions of a message."""
    return JointValues(tuple(message.name), np.array(message.position))


def posture_of(message: JointState) -> FloatArray:
    """Return the posture (12,), or its deviations, of a message of the tracker.

    Raises NotFiniteError if a value is not a finite number, and CardboxError if a joint is missing,
    or the numbers of names and values differ.
    """
    try:
        found = posture_from(joint_values_of(message))
    except ValueError as error:
        raise CardboxError(f"joint states are not the tracker's: {error}") from None
    return _finite(found, "joint states")


def neck_of(message: JointState) -> FloatArray | None:
    """Return ``neck_yaw`` and ``neck_pitch`` (2,), rad, or deviations; None if missing.

    Raises NotFiniteError if a value is not a finite number.
    """
    found = values_from(joint_values_of(message), NECK_NAMES)
    return None if found is None else _finite(found, "joint states")


def posture_and_neck_of(message: JointState) -> FloatArray:
    """Return the posture, and the neck if it is there, or their deviations; (12,) or (14,).

    Raises NotFiniteError if a value is not a finite number, and CardboxError if a joint is missing,
    or the numbers of names and values differ.
    """
    posture, neck = posture_of(message), neck_of(message)
    return posture if neck is None else np.concatenate([posture, neck])


def points_message(header: Header, points: Points) -> PoseArray:
    """Return points, m in the frame of ``header``, without rotation, or raise NotFiniteError."""
    upright = Quaternion(w=1.0)
    return PoseArray(
        header=header,
        poses=[Pose(position=point, orientation=upright) for point in _points(points.points_m)],
    )


def markers_message(header: Header, markers: Markers) -> MarkerArray:
    """Return shapes in the frame of ``header``, instead of all before, or raise NotFiniteError."""
    if not markers.shapes:
        return MarkerArray(markers=[Marker(header=header, action=Marker.DELETEALL)])
    return MarkerArray(markers=[_marker(header, shape) for shape in markers.shapes])


def keypoint_states_message(header: Header, found: KeypointStates) -> DiagnosticArray:
    """Return a status for each keypoint: name, level, state, and the probability of an error."""
    return DiagnosticArray(
        header=header,
        status=[
            DiagnosticStatus(
                level=bytes([LEVELS[state]]),
                name=name,
                message=state,
                values=[KeyValue(key=key, value=text) for key, text in texts.items()],
            )
            for name, state, texts in found.rows()
        ],
    )


_ENCODERS: dict[type[Value], tuple[Any, Callable[[Header, Any], Any]]] = {
    JointValues: (JointState, joint_state_message),
    Points: (PoseArray, points_message),
    Markers: (MarkerArray, markers_message),
    KeypointStates: (DiagnosticArray, keypoint_states_message),
    Text: (String, lambda _, text: String(data=text.text)),
}


def message_type(kind: type[Value]) -> Any:
    """Return the class of the messages that carry values of ``kind``."""
    return _ENCODERS[kind][0]


def message_of(header: Header, value: Value) -> Any:
    """Return the message that carries ``value``."""
    return _ENCODERS[type(value)][1](header, value)


def _marker(header: Header, shape: MarkerShape) -> Marker:
    return Marker(
        header=header,
        ns=shape.namespace,
        type=shape.kind,
        action=Marker.ADD,
        pose=Pose(orientation=Quaternion(w=1.0)),
        scale=Vector3(x=shape.scale, y=shape.scale, z=shape.scale),
        color=_color(shape.rgba),
        points=_points(shape.points_m),
        colors=[_color(rgba) for rgba in shape.colors],
    )


def _points(points_m: FloatArray) -> list[Point]:
    return [Point(x=x, y=y, z=z) for x, y, z in _finite(points_m, "points").tolist()]


def _finite(values: FloatArray, what: str) -> FloatArray:
    """Return ``values`` after a last check before they are published."""
    if not np.isfinite(values).all():
        raise NotFiniteError(
            f"the {what} of an image have values that are not finite numbers, so they are not "
            "published; please report it, with the body model and the CameraInfo"
        )
    return values


@lru_cache(maxsize=16)  # a handful of colours, ninety corners an image
def _color(rgba: Rgba) -> ColorRGBA:
    r, g, b, a = rgba
    return ColorRGBA(r=r, g=g, b=b, a=a)


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
