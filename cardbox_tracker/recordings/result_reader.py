"""Read a bag of results from ``cardbox track --bag`` or from running nodes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cardbox_tracker.common.errors import BagError
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import loads_body_model
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.recordings.bag_reader import BagReader, stamp_ns_of
from cardbox_tracker.recordings.outputs import (
    JointValues,
    chances_of,
    neck_from,
    open_hands_from,
    person_space,
    place_from,
    posture_from,
)
from cardbox_tracker.tracking.estimate import NO_PERSON, TRACKING, UNCERTAIN

MODEL = "/body_model"
_STATE, _JOINTS, _STDDEV = "/tracking_state", "/joint_states", "/joint_states_stddev"
_KEYPOINTS, _HANDS, _STATES = "/keypoints", "/hands", "/keypoint_states"


@dataclass(frozen=True)
class Result:
    """The tracker's result for one image.

    Attributes:
        stamp_ns: stamp of the image.
        state: tracking state.
        body: the measured person; None before it was published.
        posture: d1..d12, rad and metres, and the neck if the bag has it, (12,) or (14,); None if
            there is no estimate.
        stddev: standard deviations, without the neck where it is not known, (12,) or (14,); None
            if they are not known.
        place_m: ``torso_x`` and ``torso_z``, (2,); None if the bag has none.
        keypoints_m: (n, 3), metres in the optical frame of the first camera; None without any.
        hands_open: how open both hands are, (2,), nan for one that is not known; None without any.
        chances: state and probability of an error of each keypoint by name; None without them.
    """

    stamp_ns: int
    state: str
    body: BodyModel | None = None
    posture: FloatArray | None = None
    stddev: FloatArray | None = None
    place_m: FloatArray | None = None
    keypoints_m: FloatArray | None = None
    hands_open: FloatArray | None = None
    chances: dict[str, tuple[str, float]] | None = None


def has_results(bag: BagReader) -> bool:
    """Return whether a recording has results of the tracker."""
    return any(topic.endswith(MODEL) for topic in bag.topics)


def namespace_of(bag: BagReader, person: int | None = None) -> str:
    """Return the first namespace with the tracker's topics, such as "" or "/left".

    With ``person``, that of one of several people.

    Raises:
        BagError: the bag has no results of the tracker, or of that person.
    """
    models = sorted(topic for topic in bag.topics if topic.endswith(MODEL))
    if not models:
        raise BagError(
            f"{bag.path} has no results of the tracker (no topic body_model); make them with "
            "'cardbox track BAG ... --bag RESULTS'"
        )
    spaces = [topic.removesuffix(MODEL) for topic in models]
    if person is None:
        return spaces[0]
    chosen = [space for space in spaces if space.endswith(person_space(person))]
    if not chosen:
        raise BagError(
            f"{bag.path} has no results of person {person}, only those on {', '.join(models)}"
        )
    return chosen[0]


def joints_of(message: Any) -> JointValues:
    """Return names and positions of a JointState."""
    return JointValues(tuple(message.name), np.array(message.position, np.float64))


def points_of(message: Any) -> FloatArray:
    """Return the positions (n, 3), metres, of a PoseArray."""
    points = [(p.position.x, p.position.y, p.position.z) for p in message.poses]
    return np.array(points, np.float64).reshape(-1, 3)


def read_results(bag: BagReader, person: int | None = None) -> list[Result]:
    """Return the results of the images in order of their stamps; the last one of each stamp.

    ``person`` is as in :func:`namespace_of`.

    Raises:
        BagError: the bag has no results of the tracker, or is damaged.
    """
    space = namespace_of(bag, person)
    topics = [
        space + name for name in (MODEL, _STATE, _JOINTS, _STDDEV, _KEYPOINTS, _HANDS, _STATES)
    ]
    found = _Results()
    for message in bag.messages([topic for topic in topics if topic in bag.topics]):
        content = bag.deserialize(message)
        try:
            found.take(message.topic.removeprefix(space), message.time_ns, content)
        except (AttributeError, TypeError, ValueError) as error:
            # The message type is defined by the recording and may lack fields.
            where = f"{message.topic} of {bag.path}"
            raise BagError(f"{where} has a damaged message: {error}; record it again") from None
    return [one for _, one in sorted(found.by_stamp.items())]


class _Results:
    """Joins the messages of each image, of which joints, deviations and points have its stamp."""

    def __init__(self) -> None:
        self._state = NO_PERSON
        self._body: BodyModel | None = None
        self._chances: tuple[int, dict[str, tuple[str, float]]] | None = None
        self.by_stamp: dict[int, Result] = {}

    def take(self, name: str, time_ns: int, message: Any) -> None:
        if name == MODEL:
            self._body = loads_body_model(str(message.data), source=name)
        elif name == _STATE:
            self._state = str(message.data)
            if self._state not in (TRACKING, UNCERTAIN):
                self.by_stamp[time_ns] = Result(time_ns, self._state, self._body)
        elif name == _STATES:
            # They come before the joints of their image.
            self._chances = stamp_ns_of(message), chances_of(message)
        elif name == _JOINTS:
            stamp_ns, joints = stamp_ns_of(message), joints_of(message)
            of_image = self._chances is not None and self._chances[0] == stamp_ns
            self.by_stamp[stamp_ns] = Result(
                stamp_ns,
                self._state,
                self._body,
                _with_neck(joints),
                place_m=place_from(joints),
                chances=self._chances[1] if self._chances and of_image else None,
            )
        elif (found := self.by_stamp.get(stamp_ns_of(message))) is not None:
            if name == _KEYPOINTS:
                found = replace(found, keypoints_m=points_of(message))
            elif name == _HANDS:
                found = replace(found, hands_open=open_hands_from(joints_of(message)))
            else:
                found = replace(found, stddev=_with_neck(joints_of(message)))
            self.by_stamp[found.stamp_ns] = found


def _with_neck(joints: JointValues) -> FloatArray:
    """Return the joints of the posture, and of the neck if they are there, (12,) or (14,)."""
    posture, neck = posture_from(joints), neck_from(joints)
    return posture if neck is None else np.concatenate([posture, neck])
