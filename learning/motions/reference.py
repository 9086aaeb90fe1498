"""The reference postures of the measurement, as people take them, and ways between poses."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from learning.motions.motion import Motion
from learning.motions.rotations import about_axis, about_vector, between, from_quaternions
from learning.motions.rotations import to_quaternions as quaternions_of
from learning.segments import SEGMENTS

FloatArray = NDArray[np.float64]
Pose = tuple[FloatArray, FloatArray]
"""Turns (segments, 3, 3) and place (3,), see :mod:`learning.segments`."""

_HANGING_DEG, _STRETCHED_DEG = 20.0, 80.0
# Deviation of each angle of people who take a posture, and of their place in lengths of the leg.
_SCATTER_DEG, _SCATTER = 4.0, 0.01
# Collar bones rise by a fraction of the arm's elevation beyond 30 degrees (Inman et al., 1944).
_COLLAR_RISE, _SETTING_DEG = 0.18, 30.0
_T_POSE_DEG = 90.0


def reference_pose(name: str, rng: np.random.Generator | None = None) -> Pose:
    """Return the pose ``front``, ``side`` (turned to the left) or ``arms``.

    Args:
        name: of the reference posture.
        rng: source of the scatter with which people take it; None for the exact posture.
    """
    abduction_deg = _STRETCHED_DEG if name == "arms" else _HANGING_DEG

    def scatter() -> float:
        return 0.0 if rng is None else float(rng.normal(0.0, _SCATTER_DEG))

    turns = np.tile(np.eye(3), (len(SEGMENTS), 1, 1))
    trunk = _about(2, 0.3 * scatter()) @ _about(1, 0.5 * scatter()) @ _about(0, 0.3 * scatter())
    for side, sign in (("left", 1.0), ("right", -1.0)):
        elevation = abduction_deg + scatter()
        rise = _COLLAR_RISE * max(elevation - _SETTING_DEG, 0.0)
        collar = _about(0, sign * rise)
        forward = _about(2, -sign * 0.5 * scatter())
        # The arm sinks from the T-pose, palms down, so that hanging palms face the thighs.
        upper_arm = forward @ _about(0, -sign * (_T_POSE_DEG - elevation))
        bent = upper_arm @ _about(2, -sign * abs(scatter() + 5.0))
        parts = {"collar": collar, "upper_arm": upper_arm, "forearm": bent, "hand": bent}
        for part, turn in parts.items():
            turns[SEGMENTS.index(f"{side}_{part}")] = trunk @ turn
    for part in ("spine", "chest", "neck", "head"):
        turns[SEGMENTS.index(part)] = trunk
    if name == "side":
        turns = _about(2, 90.0 + 1.5 * scatter()) @ turns
    place = np.array([0.0, 0.0, 1.0])
    if rng is not None:
        place[:2] += rng.normal(0.0, _SCATTER, 2)
    return turns, place


def way(start: Pose, end: Pose, count: int) -> Iterator[Pose]:
    """Yield ``count`` poses on the way between two poses, which ease in and out."""
    first, last = quaternions_of(start[0]), quaternions_of(end[0])
    for number in range(count):
        part = (number + 1) / (count + 1)
        part = part * part * (3.0 - 2.0 * part)
        turns = from_quaternions(between(first, last, np.full(len(SEGMENTS), part)))
        yield turns, start[1] + part * (end[1] - start[1])


def poses(motion: Motion) -> Iterator[Pose]:
    """Yield the poses of a motion."""
    yield from zip(motion.turns, motion.places, strict=True)


def with_slouch(motion: Motion, rng: np.random.Generator, deviation_deg: float = 4.0) -> Motion:
    """Return the motion of a person whose trunk leans constantly a little differently."""
    lean = about_vector(np.radians(rng.normal(0.0, deviation_deg, 3) * (0.4, 1.0, 0.4)))
    trunk = [SEGMENTS.index(name) for name in ("spine", "chest", "neck", "head")]
    turns = motion.turns.copy()
    chest = turns[:, SEGMENTS.index("chest")]
    moved = chest @ lean @ np.swapaxes(chest, 1, 2)
    arms = [i for i, name in enumerate(SEGMENTS) if _is_of_arm(name)]
    for index in (*trunk, *arms):
        turns[:, index] = moved @ turns[:, index]
    return Motion(motion.name, motion.source, motion.fps, turns.astype(np.float32), motion.places)


def _is_of_arm(name: str) -> bool:
    return name.endswith(("collar", "arm", "hand"))


def _about(axis: int, angle_deg: float) -> FloatArray:
    return np.asarray(about_axis(axis, np.radians(angle_deg)))
