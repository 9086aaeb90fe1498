"""States of keypoints as the tracker publishes them: a diagnostic status for each keypoint."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

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
