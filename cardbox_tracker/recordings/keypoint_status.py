"""States of keypoints as the tracker publishes them: a diagnostic status for each keypoint."""

from __future__ import annotations

from typing import NamedTuple

from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES, KeypointState
from cardbox_tracker.tracking.estimate import Estimate

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

    A keypoint is wrong if it is off by over 30 cm relative to the middle of the shoulders.
    """

    names: tuple[str, ...]
    states: tuple[KeypointState, ...]
    chances: FloatArray


def keypoint_states(estimate: Estimate) -> KeypointStates | None:
    """Return the states of the keypoints of an estimate; None if the filter has none."""
    if estimate.keypoint_states is None or estimate.keypoint_chances is None:
        return None
    return KeypointStates(KEYPOINT_NAMES, estimate.keypoint_states, estimate.keypoint_chances)


def chance_text(chance: float) -> str:
    """Return a probability as the messages have it."""
    return f"{chance:.3f}"
