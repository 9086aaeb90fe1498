"""Read a bag of results from ``cardbox track --bag`` or from running nodes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.model_file import loads_body_model
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.errors import BagError
from cardbox_tracker.estimation.estimate import TRACKING, UNCERTAIN
from cardbox_tracker.outputs import JointValues, neck_from, posture_from
from cardbox_tracker.recordings.bag_reader import BagReader, stamp_ns_of

MODEL = "/body_model"
_STATE, _JOINTS, _STDDEV = "/tracking_state", "/joint_states", "/joint_states_stddev"


class Result(NamedTuple):
    """The tracker's result for one image.

    Attributes:
        stamp_ns: stamp of the image.
        state: tracking state.
        body: the measured person; None before it was published.
        posture: d1..d12, rad and metres, and the neck if the bag has it, (12,) or (14,); None if
            there is no estimate.
        stddev: standard deviations, without the neck where it is not known, (12,) or (14,); None
            if they are not known.
    """

    stamp_ns: int
    state: str
    body: BodyModel | None = None
    posture: FloatArray | None = None
    stddev: FloatArray | None = None


def has_results(bag: BagReader) -> bool:
    """Return whether a recording has results of the tracker."""
    return any(topic.endswith(MODEL) for topic in bag.topics)


def namespace_of(bag: BagReader) -> str:
    """Return the first namespace with the tracker's topics, such as "" or "/left".

    Raises:
        BagError: the bag has no results of the tracker.
    """
    models = sorted(topic for topic in bag.topics if topic.endswith(MODEL))
    if not models:
        raise BagError(
            f"{bag.path} has no results of the tracker (no topic body_model); make them with "
            "'cardbox track BAG ... --bag RESULTS'"
        )
    return models[0].removesuffix(MODEL)


def joints_of(message: Any) -> JointValues:
    """Return names and positions of a JointState."""
    return JointValues(tuple(message.name), np.array(message.position, np.float64))


def points_of(message: Any) -> FloatArray:
    """Return the positions (n, 3), metres, of a PoseArray."""
    points = [(p.position.x, p.position.y, p.position.z) for p in message.poses]
    return np.array(points, np.float64).reshape(-1, 3)


def read_results(bag: BagReader) -> Iterator[Result]:
    """Yield the result of each image in order.

    Raises:
        BagError: the bag has no results of the tracker, or is damaged.
    """
    space = namespace_of(bag)
    topics = [space + name for name in (MODEL, _STATE, _JOINTS, _STDDEV)]
    reader = _Results(space)
    for message in bag.messages([topic for topic in topics if topic in bag.topics]):
        content = bag.deserialize(message)
        try:
            found = reader.take(message.topic, message.time_ns, content)
        except (AttributeError, TypeError, ValueError) as error:
            # The message type is defined by the recording and may lack fields.
            where = f"{message.topic} of {bag.path}"
            raise BagError(f"{where} has a damaged message: {error}; record it again") from None
        if found is not None:
            yield found


class _Results:
    """Joins the joint states and the deviations of one image, which have the same stamp."""

    def __init__(self, space: str) -> None:
        self._space = space
        self._state = ""
        self._body: BodyModel | None = None
        self._joints: Result | None = None

    def take(self, topic: str, time_ns: int, message: Any) -> Result | None:
        """Return the result that a message completes."""
        name = topic.removeprefix(self._space)
        if name == MODEL:
            self._body = loads_body_model(str(message.data), source=topic)
        elif name == _STATE:
            self._state = str(message.data)
            if self._state not in (TRACKING, UNCERTAIN):
                return Result(time_ns, self._state, self._body)
        elif name == _JOINTS:
            posture = _posture_and_neck(message)
            self._joints = Result(stamp_ns_of(message), self._state, self._body, posture)
        elif self._joints is not None and self._joints.stamp_ns == stamp_ns_of(message):
            return self._joints._replace(stddev=_posture_and_neck(message))
        return None


def _posture_and_neck(message: Any) -> FloatArray:
    """Return the joints of the posture, and of the neck if they are there, (12,) or (14,)."""
    joints = joints_of(message)
    posture, neck = posture_from(joints), neck_from(joints)
    return posture if neck is None else np.concatenate([posture, neck])
