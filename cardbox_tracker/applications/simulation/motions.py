"""The timeline of a synthetic person's postures.

A session starts with the empty scene; the person walks in, holds the three reference postures and
performs the motions. All movements are minimum-jerk, so speed is continuous.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.posture import (
    LEFT_ARM,
    PITCH,
    RIGHT_ARM,
    ROLL,
    SHOULDER_ABDUCTION,
    SHOULDER_FLEXION,
    reference_posture,
)

FloatArray = NDArray[np.float64]

EMPTY_S, ENTER_S, HOLD_S, TRANSITION_S, NEUTRAL_S = 4.0, 2.5, 2.0, 1.0, 1.0
_ENTER_FROM_M = 1.6


@dataclass(frozen=True)
class Segment:
    """Part of the timeline."""

    name: str  #: name of the motion or reference posture
    start_s: float  #: start, seconds from the session's start
    end_s: float  #: end, seconds from the session's start
    #: posture (12,) at a time in seconds from ``start_s``; None in the empty scene
    pose: Callable[[float], FloatArray] | None


def smooth(t: float) -> float:
    """Minimum-jerk step from 0 at t = 0 to 1 at t = 1."""
    t = min(max(t, 0.0), 1.0)
    return t**3 * (10.0 - 15.0 * t + 6.0 * t**2)


def _between(a: FloatArray, b: FloatArray, duration_s: float) -> Callable[[float], FloatArray]:
    return lambda t: a + (b - a) * smooth(t / duration_s)


def _envelope(t: float, duration_s: float, ramp_s: float) -> float:
    return smooth(t / ramp_s) * smooth((duration_s - t) / ramp_s)


def _ramp(angle_rad: float) -> float:
    """Return max(0, angle), smoothed at 0 so that the speed of an arm is continuous."""
    rounding_rad = np.radians(5.0)
    return float((angle_rad + np.hypot(angle_rad, rounding_rad) - rounding_rad) / 2.0)


WAVE_S, BEND_S, BOW_S = 10.0, 12.0, 7.0


def wave(t: float) -> FloatArray:
    """Raise both arms sideways and wave the forearms, for ``WAVE_S`` seconds."""
    raised = _envelope(t, WAVE_S, 1.8)
    posture = reference_posture("front")
    swing = np.radians(25.0) * np.sin(2.0 * np.pi * 0.6 * t) * raised
    for shoulder, elbow, sign in ((4, 6, 1.0), (8, 10, -1.0)):
        posture[shoulder] += np.radians(55.0) * raised
        posture[elbow] += np.radians(70.0) * raised + sign * swing
    return posture


def bend(t: float) -> FloatArray:
    """Bend sideways to both sides, twice, for ``BEND_S`` seconds."""
    posture = reference_posture("front")
    roll = np.radians(22.0) * np.sin(2.0 * np.pi * 2.0 * t / BEND_S) * _envelope(t, BEND_S, 1.0)
    posture[ROLL] = roll
    # The arms hang vertically, so the arm on the bent side moves away from the torso.
    posture[LEFT_ARM.start + SHOULDER_ABDUCTION] += _ramp(-roll)
    posture[RIGHT_ARM.start + SHOULDER_ABDUCTION] += _ramp(roll)
    return posture


def bow(t: float) -> FloatArray:
    """Bow forward once and come up again, for ``BOW_S`` seconds."""
    posture = reference_posture("front")
    pitch = np.radians(35.0) * _envelope(t, BOW_S, 2.5)
    posture[PITCH] = pitch
    # The arms stay almost vertical while the torso leans.
    for arm in (LEFT_ARM, RIGHT_ARM):
        posture[arm.start + SHOULDER_FLEXION] = 0.6 * pitch
    return posture


MOTIONS: dict[str, tuple[float, Callable[[float], FloatArray]]] = {
    "wave": (WAVE_S, wave),
    "bend": (BEND_S, bend),
    "bow": (BOW_S, bow),
}
"""Duration in seconds, and posture as a function of time, by name."""


def timeline(motion: str, side_turn: str = "left") -> list[Segment]:
    """Return the segments of a session with a motion of ``MOTIONS``, or ``all`` in turn.

    For the side reference the person turns to ``side_turn``. Raises CardboxError if the motion is
    unknown.
    """
    if motion != "all" and motion not in MOTIONS:
        raise CardboxError(f"motion '{motion}' is unknown; expected {', '.join(MOTIONS)} or all")
    references = {n: reference_posture(n, side_turn) for n in ("front", "side", "arms")}
    front = references["front"]
    aside = front.copy()
    aside[0] = _ENTER_FROM_M
    steps: list[tuple[str, float, Callable[[float], FloatArray] | None]] = [
        ("empty", EMPTY_S, None),
        ("enter", ENTER_S, _between(aside, front, ENTER_S)),
    ]
    before = front
    for name, posture in references.items():
        if name != "front":
            steps.append(("transition", TRANSITION_S, _between(before, posture, TRANSITION_S)))
        steps.append((name, HOLD_S, _between(posture, posture, HOLD_S)))
        before = posture
    steps.append(("transition", TRANSITION_S, _between(before, front, TRANSITION_S)))
    still = _between(front, front, NEUTRAL_S)
    for name in MOTIONS if motion == "all" else [motion]:
        steps.append(("neutral", NEUTRAL_S, still))
        steps.append((name, *MOTIONS[name]))
    steps.append(("neutral", NEUTRAL_S, still))

    segments, start = [], 0.0
    for name, duration, pose in steps:
        segments.append(Segment(name, start, start + duration, pose))
        start += duration
    return segments
