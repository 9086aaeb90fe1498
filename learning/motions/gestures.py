"""Random sequences of everyday gestures of a person who stands and faces the camera."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from learning.motions import arms
from learning.motions.arms import Arm
from learning.motions.motion import Motion
from learning.motions.scripted import Posture, Trunk, timed
from learning.motions.wrists import MOST_DEG

# Share of gestures after which the arms hang for a while, and for how long, s.
REST_SHARE, REST_S = 0.6, (0.2, 1.5)
# Standard deviations of the sway: roll, pitch and yaw, deg, and place, lengths of the leg.
SWAY_DEG, SWAY = 2.0, 0.02
# Largest lean and turn, deg, and step, lengths of the leg.
LEAN_DEG, BOW_DEG, TURN_DEG, STEP = 30.0, 50.0, 50.0, 0.35


@dataclass(frozen=True)
class Gesture:
    """Places between which hands go to and fro.

    Args:
        places: names of ``arms.KINDS`` or ``arms.GESTURES``, in their order.
        move_s: least and largest duration of the way from one place to the next.
        times: least and largest number of rounds.
        both: share of people who do it with both arms.
    """

    places: tuple[str, ...]
    move_s: tuple[float, float] = (0.5, 1.2)
    times: tuple[int, int] = (1, 3)
    both: float = 0.5


GESTURES = (
    Gesture(("raised beside", "sideways"), (0.2, 0.6), (2, 6), 0.3),
    Gesture(("waving", "waving"), (0.15, 0.5), (2, 6), 0.3),
    Gesture(("low", "level"), (0.3, 1.0), (2, 5), 0.8),
    Gesture(("low", "high"), (0.3, 1.0), (2, 5), 0.8),
    Gesture(("apart", "together"), (0.15, 0.4), (3, 7), 1.0),
    Gesture(("before the body", "at the face"), (0.7, 1.5), (1, 2), 0.05),
    Gesture(("at the face",), both=0.2),
    Gesture(("forward",), both=0.3),
    Gesture(("level",), both=0.4),
    Gesture(("overhead",), both=0.5),
    Gesture(("folded",), (0.7, 1.5), (1, 1), 1.0),
    Gesture(("on the hip",), (0.7, 1.5), (1, 1), 0.7),
    Gesture(("near the chest",), both=0.5),
    Gesture(("near the chest", "forward"), (0.4, 1.0), (1, 4), 0.7),
    Gesture(("before the body", "before the body"), (0.3, 0.8), (1, 6), 0.7),
    Gesture(("hanging", "before the body"), (0.4, 1.0), (1, 3), 0.3),
    Gesture(("backwards", "swung"), (0.3, 0.6), (2, 5), 0.2),
    Gesture(("behind the back",), both=0.7),
    Gesture(("hanging",), (0.6, 1.5), (1, 2), 1.0),
)


def gestures(name: str, duration_s: float, rng: np.random.Generator) -> Motion:
    """Return a random sequence of gestures of some duration, s, at 30 frames a second."""
    hanging = arms.reaching(arms.HANGING, (-1.0, 0.3, 0.0))
    postures: list[Posture] = [(_upright(rng), hanging, hanging)]
    times = [0.0]

    def go(posture: Posture, move_s: float, hold_s: float = 0.0) -> None:
        # Every posture comes twice: the time between is a hold.
        postures.extend((posture, posture))
        times.extend((times[-1] + move_s, times[-1] + move_s + hold_s))

    while times[-1] < duration_s:
        gesture = GESTURES[rng.integers(len(GESTURES))]
        is_both = rng.random() < gesture.both
        sides = (True, True) if is_both else ((True, False), (False, True))[rng.integers(2)]
        trunk = _trunk(rng)
        keys: list[tuple[Arm, Arm]] = []
        last = postures[-1][1:]
        for place in gesture.places:
            left, right = (
                arms.drawn(place, arm, rng) if takes_part else arm
                for arm, takes_part in zip(last, sides, strict=True)
            )
            # Both arms mostly do the same.
            last = (left, left) if is_both and rng.random() < 0.7 else (left, right)
            keys.append(last)
        hold_s = rng.uniform(0.0, 1.5) if len(keys) == 1 else 0.0
        for _ in range(rng.integers(gesture.times[0], gesture.times[1] + 1)):
            for key in keys:
                go((_swayed(trunk, rng), *key), rng.uniform(*gesture.move_s), hold_s)
        if rng.random() < REST_SHARE:
            go((_upright(rng), hanging, hanging), rng.uniform(0.5, 1.2), rng.uniform(*REST_S))
    return replace(timed(name, postures, times, duration_s), source="gesture")


def _upright(rng: np.random.Generator) -> Trunk:
    return Trunk(
        hips=rng.normal(0, 0.5 * SWAY_DEG, 3),
        bend=rng.normal(0, 0.5 * SWAY_DEG, 3),
        head=rng.normal(0, 5, 3),
        collars=rng.uniform((-3, -4), (4, 4), (2, 2)),
        wrists=0.3 * rng.uniform(-1, 1, (2, 3)) * MOST_DEG,
        thighs=rng.normal((0, 4), (1, 1), (2, 2)),
        knees=np.zeros(2),
        place=rng.normal(0, SWAY, 2),
    )


def _trunk(rng: np.random.Generator) -> Trunk:
    """Return a trunk that is upright, leaning aside, bowing, turned, or a step away."""
    trunk = _upright(rng)
    change = rng.choice(["none", "lean", "bow", "turn", "step"], p=[0.6, 0.1, 0.1, 0.1, 0.1])
    if change == "step":
        return replace(trunk, place=rng.uniform(-STEP, STEP, 2))
    axis = {"lean": 0, "bow": 1, "turn": 2}.get(change)
    if axis is None:
        return trunk
    angle = np.zeros(3)
    low, high = {0: (-LEAN_DEG, LEAN_DEG), 1: (5.0, BOW_DEG), 2: (-TURN_DEG, TURN_DEG)}[axis]
    angle[axis] = rng.uniform(low, high)
    share = 0.7 if axis == 2 else 0.35
    return replace(trunk, hips=trunk.hips + share * angle, bend=trunk.bend + (1.0 - share) * angle)


def _swayed(trunk: Trunk, rng: np.random.Generator) -> Trunk:
    return replace(
        trunk,
        hips=trunk.hips + rng.normal(0, 0.3 * SWAY_DEG, 3),
        bend=trunk.bend + rng.normal(0, 0.3 * SWAY_DEG, 3),
        place=trunk.place + rng.normal(0, 0.3 * SWAY, 2),
    )
