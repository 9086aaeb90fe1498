"""How good the results of a recording are, in the words of ``cardbox track``."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.skeleton import JOINT_NAMES, KEYPOINT_NAMES, UNITS, KeypointState
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.tracking.estimate import LOST, TRACKING, UNCERTAIN, Estimate
from cardbox_tracker.tracking.tracker import Tracker

MOST_MOMENTS, GAP_S = 5, 3.0
"""Number of worst moments that are named, and the least time between two of them, s."""

_HANDS = [KEYPOINT_NAMES.index(f"{side}_hand") for side in ("left", "right")]
_SHOULDERS = [KEYPOINT_NAMES.index(f"{side}_shoulder") for side in ("left", "right")]
_ANGLES = [number for number, name in enumerate(JOINT_NAMES) if UNITS[name] == "rad"]


class _Moment(NamedTuple):
    """An image whose posture may be wrong: its chance, its time, and what is doubtful."""

    chance: float
    time_s: float
    what: str


class Quality:
    """Observer of :func:`~cardbox_tracker.recordings.track.track_recording`; see :meth:`lines`."""

    def __init__(self) -> None:
        """Begin without an image."""
        self._images = self._sure = self._sure_hands = self._sure_places = 0
        self._moments: list[_Moment] = []
        self._angles_rad: list[float] = []
        self._hands_m: list[float] = []
        self._distances_m: list[float] = []

    def __call__(self, frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        """Count one image."""
        self._images += 1
        self._sure += estimate.state == TRACKING
        states = estimate.keypoint_states or ()
        sure = [states[hand] == KeypointState.TRACKED for hand in _HANDS] if states else []
        self._sure_hands += sum(sure)
        place = estimate.place
        self._sure_places += place is not None and place.state == KeypointState.TRACKED
        if estimate.state in (UNCERTAIN, LOST):
            self._moments.append(_moment(frame.time_s, estimate))
        if estimate.posture is None or estimate.posture_stddev is None:
            return
        self._angles_rad += estimate.posture_stddev[_ANGLES].tolist()
        moved = estimate.posture + np.diag(estimate.posture_stddev)
        points_m = pose(tracker.body, np.vstack([estimate.posture, moved])).keypoints_m
        hands_m = points_m[:, _HANDS] - points_m[:, _SHOULDERS].mean(axis=1, keepdims=True)
        self._hands_m += np.linalg.norm(hands_m[1:] - hands_m[0], axis=(0, 2)).tolist()
        if place is not None:
            self._distances_m.append(float(place.stddev_m[0]))

    def lines(self) -> Iterator[str]:
        """Yield shares of sure images and hands, typical deviations, and the worst moments.

        Hands and distances are sure in the state ``tracked``. Typical is the median over images
        with a posture; a hand moves beside the shoulders with the deviations of all joints.
        """
        if not self._images:
            return
        yield (
            f"sure: {self._sure / self._images:.0%} of {self._images} images, "
            f"{self._sure_hands / (2 * self._images):.0%} of the hands in them, "
            f"{self._sure_places / self._images:.0%} of the distances (to 0.3 m)"
        )
        if self._angles_rad:
            typical = [
                f"{np.degrees(np.median(self._angles_rad)):.0f} degrees of an angle",
                f"{100 * np.median(self._hands_m):.0f} cm of a hand beside the shoulders",
            ]
            if self._distances_m:
                typical.append(f"{100 * np.median(self._distances_m):.0f} cm of the distance")
            yield f"typical standard deviation: {', '.join(typical)}"
        if worst := self._worst():
            moments = (f"{one.time_s:.1f} s ({one.what})" for one in worst)
            yield f"least sure, look at them: {', '.join(moments)}"

    def _worst(self) -> list[_Moment]:
        """Return up to ``MOST_MOMENTS`` moments of the highest chances, in the order of time."""
        found: list[_Moment] = []
        for one in sorted(self._moments, key=lambda one: (-one.chance, one.time_s)):
            if all(abs(one.time_s - other.time_s) >= GAP_S for other in found):
                found.append(one)
            if len(found) == MOST_MOMENTS:
                break
        return sorted(found, key=lambda one: one.time_s)


def _moment(time_s: float, estimate: Estimate) -> _Moment:
    states, chances = estimate.keypoint_states, estimate.keypoint_chances
    if states is None or chances is None:
        return _Moment(1.0, time_s, estimate.state)
    doubtful = [
        KEYPOINT_NAMES[hand].replace("_", " ")
        for hand in _HANDS
        if states[hand] in (KeypointState.UNCERTAIN, KeypointState.LOST)
    ]
    what = " and ".join(doubtful) or "whole posture"
    return _Moment(float(np.max(chances)), time_s, what)
