"""What the tracker says of an image, described once: topics, joints, figures.

The nodes, the bag of results, the CSV file and the demo encode what stands here:
:mod:`.ros.messages.results` as messages, :mod:`.recordings.result_bag` as messages of a bag,
:mod:`.recordings.track` as rows. A further joint goes into ``JOINT_STATE_NAMES`` and the two
functions after it, a further topic into ``OUTPUTS``, a further number into ``FIGURES``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cardbox_tracker.body.posture import JOINT_NAMES
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.drawing.markers import MarkerShape, marker_shapes
from cardbox_tracker.estimation.tracker import Estimate, Tracker


class JointValues(NamedTuple):
    """Values (n,) of the joints ``names``, rad and metres."""

    names: tuple[str, ...]
    values: FloatArray


class Points(NamedTuple):
    """Points (n, 3), metres in the optical frame."""

    points_m: FloatArray


class Markers(NamedTuple):
    """Shapes to show; none removes those shown before."""

    shapes: tuple[MarkerShape, ...]


Value = JointValues | Points | Markers


@dataclass(frozen=True)
class Output:
    """One topic.

    Attributes:
        topic: relative name.
        kind: class of the values, which decides the message type.
        of: value for an estimate that has a posture; None if it has no such value.
        absent: value that says that there is no posture any more; None: nothing is sent.
    """

    topic: str
    kind: type[Value]
    of: Callable[[Estimate, Tracker], Value | None]
    absent: Value | None = None


@dataclass(frozen=True)
class Figure:
    """One number of an estimate.

    Attributes:
        name: of its column.
        unit: empty for a plain number.
        format: how it is written.
        of: the number; None where there is none.
    """

    name: str
    unit: str
    format: str
    of: Callable[[Estimate], float | None]

    @property
    def label(self) -> str:
        """Name with its unit, as in the diagnostics."""
        return f"{self.name} ({self.unit})" if self.unit else self.name

    def text(self, estimate: Estimate) -> str:
        """Return the number as text; empty where there is none."""
        value = self.of(estimate)
        return "" if value is None else format(value, self.format)


JOINT_STATE_NAMES: tuple[str, ...] = JOINT_NAMES
"""Joints of ``joint_states``, in order."""


def joint_values(estimate: Estimate) -> JointValues | None:
    """Return the joints of an estimate; None without a posture."""
    return None if estimate.posture is None else JointValues(JOINT_STATE_NAMES, estimate.posture)


def joint_deviations(estimate: Estimate) -> JointValues | None:
    """Return the standard deviation of each joint; None if it is not known."""
    stddev = estimate.posture_stddev
    return None if stddev is None else JointValues(JOINT_STATE_NAMES, stddev)


def posture_from(joints: JointValues) -> FloatArray:
    """Return the posture (12,) among named joints in any order.

    Raises:
        ValueError: a joint of the posture is missing.
    """
    by_name = dict(zip(joints.names, np.asarray(joints.values).tolist(), strict=True))
    missing = [name for name in JOINT_NAMES if name not in by_name]
    if missing:
        raise ValueError(f"joints {', '.join(missing)} are missing")
    return np.array([by_name[name] for name in JOINT_NAMES])


def _keypoints(estimate: Estimate, _: Tracker) -> Points | None:
    return None if estimate.keypoints_m is None else Points(estimate.keypoints_m)


def _markers(estimate: Estimate, tracker: Tracker) -> Markers | None:
    if estimate.posture is None:
        return None
    return Markers(marker_shapes(tracker.body, tracker.camera, estimate.posture))


OUTPUTS: tuple[Output, ...] = (
    Output("joint_states", JointValues, lambda estimate, _: joint_values(estimate)),
    Output("joint_states_stddev", JointValues, lambda estimate, _: joint_deviations(estimate)),
    Output("keypoints", Points, _keypoints),
    # What is not removed stays in the air when the person has gone.
    Output("markers", Markers, _markers, absent=Markers(())),
)
"""Topics of the tracker, in the order in which they are sent."""

FIGURES: tuple[Figure, ...] = (
    Figure("cost", "px", "d", lambda estimate: estimate.cost_px),
    Figure("iou", "", ".4f", lambda estimate: estimate.iou),
)
"""How well the model fits."""


class OutputStream:
    """The values of one image after the other: a posture's, or once what says that it is gone."""

    def __init__(self) -> None:
        """Start before the first image."""
        self._state = ""

    def values(
        self,
        estimate: Estimate,
        tracker: Tracker,
        wanted: Callable[[Output], bool] = lambda _: True,
    ) -> Iterator[tuple[Output, Value]]:
        """Yield what is to be sent of an image; what is not ``wanted`` is not computed."""
        is_new, self._state = estimate.state != self._state, estimate.state
        for output in OUTPUTS:
            if estimate.posture is None and not (is_new and output.absent):
                continue
            if not wanted(output):
                continue
            value = output.absent if estimate.posture is None else output.of(estimate, tracker)
            if value is not None:
                yield output, value
