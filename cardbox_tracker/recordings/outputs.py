"""The tracker's outputs for an image: topics and joints.

:mod:`.recordings.messages` encodes them as messages of nodes and bags, and
:mod:`.recordings.result_table` as rows of a table. Add a topic to ``TOPICS`` and
``OutputStream``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from itertools import compress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import (
    HAND_OPEN_NAMES,
    JOINT_NAMES,
    KEYPOINT_NAMES,
    POSTURE_GROUPS,
    STATE,
    STATE_NAMES,
    Group,
    KeypointState,
    rows_of,
)
from cardbox_tracker.recordings.markers import MarkerShape, marker_shapes
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.tracker import Tracker

CHANCE_KEY = "chance of an error beyond 0.3 m"
"""Key of the probability in the messages."""
PITCH_KEY = "standard deviation of the camera's pitch (degrees)"
"""Key of what the vertical rests on in the messages."""
LEVELS = {
    KeypointState.TRACKED: 0,
    KeypointState.UNCERTAIN: 1,
    KeypointState.LOST: 2,
    KeypointState.HIDDEN: 3,
}
"""Levels of diagnostic_msgs/DiagnosticStatus: ok, warning, error, stale."""


class KeypointStates(NamedTuple):
    """States of the keypoints ``names``, and their probabilities of being wrong.

    A keypoint is wrong if it is off by over 30 cm relative to the middle of the shoulders. The
    place has a state, too, and is wrong if its distance is; the vertical has no probability (nan).
    ``more`` are further texts of each by name.
    """

    names: tuple[str, ...]
    states: tuple[KeypointState, ...]
    chances: FloatArray
    more: tuple[Mapping[str, str], ...] = ()

    def rows(self) -> Iterator[tuple[str, KeypointState, dict[str, str]]]:
        """Yield name, state and texts by name."""
        more = self.more or ({},) * len(self.names)
        for name, state, chance, texts in zip(*self[:3], more, strict=True):
            chances = {CHANCE_KEY: f"{chance:.3f}"} if np.isfinite(chance) else {}
            yield name, state, {**chances, **texts}


def keypoint_states(estimate: Estimate) -> KeypointStates | None:
    """Return the states of the keypoints of an estimate; None if the filter has none."""
    if estimate.keypoint_states is None or estimate.keypoint_chances is None:
        return None
    return KeypointStates(KEYPOINT_NAMES, estimate.keypoint_states, estimate.keypoint_chances)


def place_state(estimate: Estimate) -> KeypointStates | None:
    """Return the states of place and vertical of an estimate; None if the filter has no place."""
    place, vertical = estimate.place, estimate.vertical_state
    if place is None:
        return None
    more = {
        "rests on": place.rests_on,
        "standard deviation of the distance (m)": f"{place.stddev_m[0]:.3f}",
    }
    if place.contradiction:
        more["contradiction"] = place.contradiction
    if vertical is None or estimate.pitch_stddev_rad is None:
        return KeypointStates(("place",), (place.state,), np.array([place.chance]), (more,))
    pitch = {PITCH_KEY: f"{np.degrees(estimate.pitch_stddev_rad):.1f}"}
    states, chances = (place.state, vertical), np.array([place.chance, np.nan])
    return KeypointStates(("place", "vertical"), states, chances, (more, pitch))


class JointValues(NamedTuple):
    """Values (n,) of the joints ``names``, rad and m, and velocities, rad/s and m/s, if known."""

    names: tuple[str, ...]
    values: FloatArray
    velocities: FloatArray | None = None

    @property
    def by_name(self) -> dict[str, float]:
        """The values by name."""
        return dict(zip(self.names, np.asarray(self.values).tolist(), strict=True))

    def of(self, names: Sequence[str]) -> FloatArray:
        """Return the values of joints, (n,); nan for one that is missing."""
        by_name = self.by_name
        return np.array([by_name.get(name, np.nan) for name in names])

    @property
    def posture(self) -> FloatArray:
        """The posture (12,); raises ValueError if a joint is missing."""
        missing = [name for name in JOINT_NAMES if name not in self.names]
        if missing:
            raise ValueError(f"joints {', '.join(missing)} are missing")
        return self.of(JOINT_NAMES)


Value = JointValues | KeypointStates | FloatArray | tuple[MarkerShape, ...] | str
"""Joints, states, points (n, 3), metres in the optical frame, shapes to show instead of all earlier
ones, or a text."""


# Joints that an image may not show.
_MAY_BE_HIDDEN = np.array([joint.group not in (*POSTURE_GROUPS, Group.PLACE) for joint in STATE])
# Deviations of legs that are not known.
_ANYWHERE = np.array([joint.any_stddev if joint.group == Group.LEG else np.nan for joint in STATE])
# The mean velocity over a longer gap is not that of the moment.
_LONGEST_NS = 1_000_000_000


def person_space(number: int) -> str:
    """Return the namespace of the topics of one of several people."""
    return f"/person_{number}"


def joint_values(estimate: Estimate, torso_place: bool = True) -> JointValues | None:
    """Return the joints of an estimate; None without a posture.

    Without ``torso_place``, these are the 12 joints of the posture. Hands are among them where they
    are measured; joints that are not known are 0.
    """
    if estimate.posture is None:
        return None
    rows, values = _rows(estimate.hands is not None, torso_place), estimate.joints[0]
    return JointValues(_names(rows), np.where(_MAY_BE_HIDDEN & np.isnan(values), 0.0, values)[rows])


def joint_deviations(estimate: Estimate, torso_place: bool = True) -> JointValues | None:
    """Return the standard deviation of each joint; None if unknown.

    Neck and hands are among them only if they were seen; unknown legs may be anywhere in their
    range.
    """
    if estimate.posture_stddev is None:
        return None
    stddev = np.where(np.isnan(estimate.joints[1]), _ANYWHERE, estimate.joints[1])
    rows = _rows(estimate.hands is not None, torso_place) & np.isfinite(stddev)
    return JointValues(_names(rows), stddev[rows])


@cache
def _rows(has_hands: bool, torso_place: bool) -> NDArray[np.bool_]:
    """Return which joints of ``STATE`` are published, (n,)."""
    without = set() if has_hands else {Group.HAND}
    groups = {*Group} - without if torso_place else {*POSTURE_GROUPS}
    return np.array([joint.group in groups for joint in STATE])


def _names(rows: NDArray[np.bool_]) -> tuple[str, ...]:
    return tuple(compress(STATE_NAMES, rows))


def known_deviations(joints: JointValues) -> dict[str, float]:
    """Return the deviations by name of joints that are known."""
    anywhere = dict(zip(STATE_NAMES, _ANYWHERE.tolist(), strict=True))
    found = {name: one for name, one in joints.by_name.items() if name in anywhere}
    return {name: one for name, one in found.items() if not abs(one - anywhere[name]) < 1e-6}


def open_hands(estimate: Estimate) -> JointValues | None:
    """Return how open each hand is, 0 to 1, as far as it is known; None if nothing is."""
    found = {
        name: hand.open
        for name, hand in zip(HAND_OPEN_NAMES, estimate.hands or (), strict=False)
        if hand is not None and hand.open is not None
    }
    return JointValues(tuple(found), np.array([*found.values()])) if found else None


def joints_of(message: Any) -> JointValues:
    """Return names and positions of a JointState; ValueError if they are not as many."""
    if len(message.name) != len(message.position):
        raise ValueError(f"{len(message.name)} joints with {len(message.position)} positions")
    return JointValues(tuple(message.name), np.array(message.position, np.float64))


def chances_of(message: Any) -> dict[str, tuple[str, float]]:
    """Return state and probability of an error by keypoint, of a message of their states."""
    return {
        one.name: (one.message, float(one.values[0].value) if one.values else 1.0)
        for one in message.status
    }


TOPICS = {
    # The states come first, so that subscribers have them when the posture arrives.
    "tracking_state": "std_msgs/msg/String",
    "keypoint_states": "diagnostic_msgs/msg/DiagnosticArray",
    "place_state": "diagnostic_msgs/msg/DiagnosticArray",
    "joint_states": "sensor_msgs/msg/JointState",
    # Who waits for the deviations has the hands by then.
    "hands": "sensor_msgs/msg/JointState",
    "joint_states_stddev": "sensor_msgs/msg/JointState",
    "keypoints": "geometry_msgs/msg/PoseArray",
    "markers": "visualization_msgs/msg/MarkerArray",
}
"""Topics of the tracker in the order of publication, and the types of their messages."""


class OutputStream:
    """The output values of a sequence of images, also velocities of the joints."""

    def __init__(self, torso_place: bool = True) -> None:
        """Begin before the first image; see :func:`joint_values` for ``torso_place``."""
        self._torso_place, self._state = torso_place, ""
        self._last: tuple[int, FloatArray, Tracker, BodyModel] | None = None

    def values(
        self,
        stamp_ns: int,
        estimate: Estimate,
        tracker: Tracker,
        wanted: Callable[[str], bool] = lambda _: True,
    ) -> Iterator[tuple[str, Value]]:
        """Yield topics and values for the image of a stamp; only ``wanted`` ones are computed."""
        is_new, self._state = estimate.state != self._state, estimate.state
        estimate = estimate.as_camera_stands(tracker.body.camera_pose.roll_rad)
        velocities = self._velocities(stamp_ns, estimate, tracker)
        for topic in filter(wanted, TOPICS):
            value = self._value(topic, estimate, tracker, is_new)
            if topic == "joint_states" and isinstance(value, JointValues):
                rows = _rows(estimate.hands is not None, self._torso_place)
                value = value._replace(velocities=None if velocities is None else velocities[rows])
            if value is not None:
                yield topic, value

    def _value(
        self, topic: str, estimate: Estimate, tracker: Tracker, is_new: bool
    ) -> Value | None:
        """Return the value of a topic; None if the estimate has none."""
        if topic == "tracking_state":
            return estimate.state
        if estimate.posture is None:
            # Markers stay visible until they are removed.
            return () if topic == "markers" and is_new else None
        match topic:
            case "keypoint_states":
                return keypoint_states(estimate)
            case "place_state":
                return place_state(estimate)
            case "joint_states":
                return joint_values(estimate, self._torso_place)
            case "hands":
                return open_hands(estimate)
            case "joint_states_stddev":
                return joint_deviations(estimate, self._torso_place)
            case "keypoints":
                return estimate.keypoints_m
        body = estimate.placed(tracker.body)
        return marker_shapes(body, estimate.posture, estimate.neck)

    def _velocities(self, stamp_ns: int, estimate: Estimate, tracker: Tracker) -> FloatArray | None:
        """Return those of ``STATE``, (n,), rad/s and m/s; None without an image before.

        It has a posture of the same version of the same body and is at most ``_LONGEST_NS`` old.
        """
        before, self._last = self._last, None
        if estimate.posture is None:
            return None
        self._last = stamp_ns, estimate.joints[0], tracker, tracker.body
        if before is None or before[2] is not tracker or before[3] is not tracker.body:
            return None
        step_ns = stamp_ns - before[0]
        if not 0 < step_ns <= _LONGEST_NS:
            return None
        found: FloatArray = (estimate.joints[0] - before[1]) / (step_ns / 1e9)
        # A hand is looked at every other image at most, and may not be known in one.
        found[rows_of(Group.HAND)] = 0.0
        # A face that appears does not turn, and legs that appear do not move.
        return np.nan_to_num(found)
