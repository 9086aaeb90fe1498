"""The tracker's outputs for an image: topics and joints.

:mod:`.recordings.messages` encodes them as messages of nodes and bags, and
:mod:`.recordings.result_table` as rows of a table. Add a joint to :mod:`.person.skeleton`,
``joint_values`` and ``joint_deviations``, and a topic to ``TOPICS`` and ``OutputStream``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from cardbox_tracker.person.hands import HAND_NAMES, HAND_OPEN_NAMES, WRIST_NAMES
from cardbox_tracker.person.legs import LEG_LIMITS, LEG_NAMES
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import (
    CLAVICLE_NAMES,
    JOINT_NAMES,
    JOINT_STATE_NAMES,
    KEYPOINT_NAMES,
    NECK_NAMES,
    PLACE_NAMES,
    KeypointState,
)
from cardbox_tracker.recordings.markers import MarkerShape, marker_shapes
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.tracker import Tracker

CHANCE_KEY = "chance of an error beyond 0.3 m"
"""Key of the probability in the messages."""
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
    place has a state, too, and is wrong if its distance is. ``more`` are further texts by name.
    """

    names: tuple[str, ...]
    states: tuple[KeypointState, ...]
    chances: FloatArray
    more: Mapping[str, str] = MappingProxyType({})

    def rows(self) -> Iterator[tuple[str, KeypointState, dict[str, str]]]:
        """Yield name, state and texts by name."""
        for name, state, chance in zip(self.names, self.states, self.chances, strict=True):
            yield name, state, {CHANCE_KEY: f"{chance:.3f}", **self.more}


def keypoint_states(estimate: Estimate) -> KeypointStates | None:
    """Return the states of the keypoints of an estimate; None if the filter has none."""
    if estimate.keypoint_states is None or estimate.keypoint_chances is None:
        return None
    return KeypointStates(KEYPOINT_NAMES, estimate.keypoint_states, estimate.keypoint_chances)


def place_state(estimate: Estimate) -> KeypointStates | None:
    """Return the state of the place of an estimate; None if the filter has none."""
    place = estimate.place
    if place is None:
        return None
    more = {
        "rests on": place.rests_on,
        "standard deviation of the distance (m)": f"{place.stddev_m[0]:.3f}",
    }
    if place.contradiction:
        more["contradiction"] = place.contradiction
    return KeypointStates(("place",), (place.state,), np.array([place.chance]), more)


class JointValues(NamedTuple):
    """Values (n,) of the joints ``names``, rad and m, and velocities, rad/s and m/s, if known."""

    names: tuple[str, ...]
    values: FloatArray
    velocities: FloatArray | None = None


Value = JointValues | KeypointStates | FloatArray | tuple[MarkerShape, ...] | str
"""Joints, states, points (n, 3), metres in the optical frame, shapes to show instead of all earlier
ones, or a text."""


_NECK = [JOINT_STATE_NAMES.index(name) for name in NECK_NAMES]
_LEGS = slice(-len(LEG_NAMES), None)
# Standard deviation of values all over their range.
_ANY_LEGS = np.ptp(LEG_LIMITS, axis=1) / np.sqrt(12.0)
# The mean velocity over a longer gap is not that of the moment.
_LONGEST_NS = 1_000_000_000


def person_space(number: int) -> str:
    """Return the namespace of the topics of one of several people."""
    return f"/person_{number}"


def joint_values(estimate: Estimate, torso_place: bool = True) -> JointValues | None:
    """Return the joints of an estimate; None without a posture.

    Without ``torso_place``, these are the 12 joints of the posture. The legs are the last ones,
    behind the hands where those are measured; joints that are not known are 0.
    """
    if estimate.posture is None or not torso_place:
        return _joints(JOINT_NAMES, estimate.posture)
    names, known = (
        JOINT_STATE_NAMES,
        [place_of(estimate), neck_of(estimate), clavicles_of(estimate)],
    )
    if estimate.hands is not None:
        names = *names, *HAND_NAMES
        known += [np.zeros(3) if hand is None else hand.joints for hand in estimate.hands]
    known.append(np.zeros(len(LEG_NAMES)) if estimate.legs is None else estimate.legs.angles)
    return _joints((*names, *LEG_NAMES), estimate.posture, *known)


def joint_deviations(estimate: Estimate, torso_place: bool = True) -> JointValues | None:
    """Return the standard deviation of each joint; None if unknown.

    Neck and hands are among them only if they were seen; unknown legs may be anywhere in their
    range.
    """
    if estimate.posture_stddev is None or not torso_place:
        return _joints(JOINT_NAMES, estimate.posture_stddev)
    names, known = [*JOINT_NAMES, *PLACE_NAMES], [_or_zeros(estimate.offset_stddev_m)]
    if estimate.neck_stddev is not None:
        names, known = [*names, *NECK_NAMES], [*known, estimate.neck_stddev]
    names, known = [*names, *CLAVICLE_NAMES], [*known, _or_zeros(estimate.clavicles_stddev_m)]
    for number, hand in enumerate(estimate.hands or ()):
        if hand is not None:
            names = [*names, *HAND_NAMES[3 * number : 3 * number + 3]]
            known = [*known, hand.joints_stddev]
    known = [*known, _ANY_LEGS if estimate.legs is None else estimate.legs.angles_stddev]
    return _joints((*names, *LEG_NAMES), estimate.posture_stddev, *known)


def are_unseen(deviations: Mapping[str, float]) -> bool:
    """Return whether deviations by joint are those of legs that are not known."""
    found = [deviations.get(name, 0.0) for name in LEG_NAMES]
    return bool(np.allclose(found, _ANY_LEGS, atol=1e-6))


def open_hands(estimate: Estimate) -> JointValues | None:
    """Return how open each hand is, 0 to 1, as far as it is known; None if nothing is."""
    found = {
        name: hand.open
        for name, hand in zip(HAND_OPEN_NAMES, estimate.hands or (), strict=False)
        if hand is not None and hand.open is not None
    }
    return JointValues(tuple(found), np.array([*found.values()])) if found else None


def place_of(estimate: Estimate) -> FloatArray:
    """Return ``torso_x`` and ``torso_z`` (2,), metres; 0 if the filter keeps them constant."""
    return _or_zeros(estimate.offset_m)


def neck_of(estimate: Estimate) -> FloatArray:
    """Return ``neck_yaw`` and ``neck_pitch`` (2,), rad; 0 if the face was not seen."""
    return _or_zeros(estimate.neck)


def clavicles_of(estimate: Estimate) -> FloatArray:
    """Return the rise of both shoulders, (2,), metres; 0 if it is not known."""
    return _or_zeros(estimate.clavicles_m)


def _or_zeros(pair: FloatArray | None) -> FloatArray:
    return np.zeros(2) if pair is None else pair


def _joints(
    names: tuple[str, ...], posture: FloatArray | None, *others: FloatArray
) -> JointValues | None:
    return None if posture is None else JointValues(names, np.concatenate([posture, *others]))


def posture_from(joints: JointValues) -> FloatArray:
    """Return the posture (12,) from named joints in any order; ValueError if one is missing."""
    by_name = positions_of(joints)
    missing = [name for name in JOINT_NAMES if name not in by_name]
    if missing:
        raise ValueError(f"joints {', '.join(missing)} are missing")
    return np.array([by_name[name] for name in JOINT_NAMES])


def values_from(joints: JointValues, names: Sequence[str]) -> FloatArray | None:
    """Return the values (n,) of ``names`` from named joints; None if one is missing."""
    by_name = positions_of(joints)
    return np.array([by_name[name] for name in names]) if by_name.keys() >= set(names) else None


def wrists_from(joints: JointValues) -> FloatArray:
    """Return flexion and deviation of both wrists, (2, 2), rad; nan for one that is missing."""
    by_name = positions_of(joints)
    return np.array([[by_name.get(name, np.nan) for name in names] for names in WRIST_NAMES])


def open_hands_from(joints: JointValues) -> FloatArray:
    """Return how open both hands are, (2,), from their topic; nan for one that is missing."""
    by_name = positions_of(joints)
    return np.array([by_name.get(name, np.nan) for name in HAND_OPEN_NAMES])


def chances_of(message: Any) -> dict[str, tuple[str, float]]:
    """Return state and probability of an error by keypoint, of a message of their states."""
    return {
        one.name: (one.message, float(one.values[0].value) if one.values else 1.0)
        for one in message.status
    }


def positions_of(joints: JointValues) -> dict[str, float]:
    """Return the joint values by name."""
    return dict(zip(joints.names, np.asarray(joints.values).tolist(), strict=True))


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
        self._last: tuple[int, FloatArray, tuple[bool, bool], Tracker, BodyModel] | None = None

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
                some = None if velocities is None else velocities[: len(value.names)]
                value = value._replace(velocities=some)
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
        """Return those of :func:`joint_values`, rad/s and m/s; None without an image before.

        It has a posture of the same version of the same body and is at most ``_LONGEST_NS`` old.
        """
        before, self._last = self._last, None
        joints = joint_values(estimate)
        if joints is None:
            return None
        has = estimate.neck is not None, estimate.legs is not None
        self._last = stamp_ns, joints.values, has, tracker, tracker.body
        if before is None or before[3] is not tracker or before[4] is not tracker.body:
            return None
        step_ns = stamp_ns - before[0]
        if not 0 < step_ns <= _LONGEST_NS:
            return None
        found: FloatArray = (joints.values - before[1]) / (step_ns / 1e9)
        # A face that appears does not turn, and legs that appear do not move.
        if not (has[0] and before[2][0]):
            found[_NECK] = 0.0
        if not (has[1] and before[2][1]):
            found[_LEGS] = 0.0
        if estimate.hands is not None:
            # A hand is looked at every other image at most, and may not be known in one.
            found[[name in HAND_NAMES for name in joints.names]] = 0.0
        return found
