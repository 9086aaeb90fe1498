"""Random smooth movements between postures that motion capture seldom contains."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from learning.motions import arms
from learning.motions.arms import Arm
from learning.motions.figure import ANKLE, SHIN, THIGH
from learning.motions.motion import Motion
from learning.motions.rotations import (
    FloatArray,
    about_axis,
    about_vector,
    between,
    from_quaternions,
)
from learning.motions.wrists import MOST_DEG, SIDES, bend
from learning.segments import SEGMENTS

FPS = 30.0
MOVE_S, HOLD_S = (0.4, 2.0), (0.0, 1.0)
SEATED_SHARE, CHANGE_SHARE = 0.3, 0.08
BOTH_SHARE, ONE_SHARE = 0.45, 0.4
COLLAR_PER_ELEVATION = 0.25


@dataclass(frozen=True)
class Trunk:
    """Angles of the trunk and the legs, deg, as arrays that can be mixed.

    Args:
        hips: roll, pitch and yaw (3,) of the hips; positive pitch bends forward.
        bend: roll, pitch and yaw (3,) of the chest against the hips.
        head: roll, pitch and yaw (3,) of the head against the chest.
        collars: raise and advance of the left and the right collar bone (2, 2).
        wrists: pronation, flexion and deviation of the left and the right hand (2, 3).
        thighs: forward and sideways swing of the left and the right thigh (2, 2).
        knees: flexion of the left and the right knee (2,).
        place: of the hips on the floor (2,), in lengths of the leg.
    """

    hips: FloatArray
    bend: FloatArray
    head: FloatArray
    collars: FloatArray
    wrists: FloatArray
    thighs: FloatArray
    knees: FloatArray
    place: FloatArray


Posture = tuple[Trunk, Arm, Arm]


def random_trunk(is_seated: bool, rng: np.random.Generator) -> Trunk:
    """Return random angles of trunk and legs; about half are nearly upright."""
    much = rng.choice([0.25, 1.0])
    thighs = rng.normal((0, 4), (6, 4), (2, 2))
    knees = np.abs(rng.normal(0, 6, 2)) + np.maximum(thighs[:, 0], 0)
    if is_seated:
        thighs = rng.uniform((70, -3), (95, 22), (2, 2))
        knees = thighs[:, 0] + rng.uniform(-30, 20, 2)
    stoop = 0.0 if is_seated else rng.choice([0.0, 0.0, 1.0]) * rng.uniform(0, 45)
    return Trunk(
        hips=np.array([rng.normal(0, 3), stoop + rng.normal(0, 4), much * rng.uniform(-60, 60)]),
        bend=much * np.array([rng.normal(0, 12), rng.uniform(-12, 35), rng.uniform(-30, 30)]),
        head=np.array([rng.normal(0, 8), rng.uniform(-25, 30), rng.uniform(-50, 50)]),
        collars=rng.uniform((-5, -12), (12, 18), (2, 2)),
        wrists=rng.choice([0.3, 1.0]) * rng.uniform(-1, 1, (2, 3)) * MOST_DEG,
        thighs=thighs,
        knees=knees,
        place=rng.normal(0, 0.08, 2),
    )


def random_arms(before: tuple[Arm, Arm], rng: np.random.Generator) -> tuple[Arm, Arm]:
    """Return new arms: both of one kind, one of them, or each of its own kind."""
    choice = rng.random()
    kinds = [arms.random_kind(rng), arms.random_kind(rng)]
    if choice < BOTH_SHARE:
        kinds[1] = kinds[0]
    left, right = (arms.drawn(kind, arm, rng) for kind, arm in zip(kinds, before, strict=True))
    if BOTH_SHARE <= choice < BOTH_SHARE + ONE_SHARE:
        return (left, before[1]) if rng.random() < 0.5 else (before[0], right)
    return left, right


def scripted(name: str, duration_s: float, rng: np.random.Generator) -> Motion:
    """Return a random motion of some duration, s, at 30 frames a second."""
    is_seated = bool(rng.random() < SEATED_SHARE)
    hanging = arms.reaching(arms.HANGING, (-1.0, 0.3, 0.0))
    postures: list[Posture] = [(random_trunk(is_seated, rng), hanging, hanging)]
    times = [0.0]
    # Every posture comes twice: the time between is a hold.
    while times[-1] < duration_s:
        is_seated ^= bool(rng.random() < CHANGE_SHARE)
        following = random_trunk(is_seated, rng), *random_arms(postures[-1][1:], rng)
        postures += [following, following]
        arrival = times[-1] + rng.uniform(*MOVE_S)
        times += [arrival, arrival + rng.choice([0.0, 1.0]) * rng.uniform(*HOLD_S)]
    return timed(name, postures, times, duration_s)


def timed(name: str, postures: list[Posture], times: list[float], duration_s: float) -> Motion:
    """Return the motion that takes postures at times, s, with movements of least jerk between."""
    at = np.arange(round(duration_s * FPS)) / FPS
    low = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    share = (at - np.take(times, low)) / np.maximum(np.diff(times)[low], 1e-9)
    return performed(name, postures, low, eased(share))


def eased(share: NDArray[np.float64]) -> FloatArray:
    """Return the way done of a movement of least jerk, 0 to 1, at shares of its time."""
    s = np.clip(share, 0, 1)
    return np.asarray(s**3 * (10 - 15 * s + 6 * s**2))


def performed(
    name: str, postures: list[Posture], low: NDArray[np.int64], share: FloatArray
) -> Motion:
    """Return the motion whose frames lie between postures.

    Args:
        name: of the motion.
        postures: keys.
        low: index of the posture before each frame (n,).
        share: of the way to the posture after it (n,).
    """

    def mixed(values: list[FloatArray]) -> FloatArray:
        stacked = np.array(values)
        part = share.reshape(-1, *(1,) * (stacked.ndim - 1))
        return np.asarray(stacked[low] * (1 - part) + stacked[low + 1] * part)

    trunk = Trunk(**{f.name: mixed([getattr(p[0], f.name) for p in postures])
                     for f in fields(Trunk)})  # fmt: skip
    turns = np.empty((len(share), len(SEGMENTS), 3, 3))
    index = SEGMENTS.index
    turns[:, index("hips")] = hips = roll_pitch_yaw(trunk.hips)
    turns[:, index("spine")] = hips @ roll_pitch_yaw(trunk.bend / 2)
    turns[:, index("chest")] = chest = hips @ roll_pitch_yaw(trunk.bend)
    turns[:, index("neck")] = chest @ roll_pitch_yaw(trunk.head / 2)
    turns[:, index("head")] = chest @ roll_pitch_yaw(trunk.head)
    ankles = []
    heading = about_axis(2, np.radians(trunk.hips[:, 2]))
    of_sides = [p[1] for p in postures], [p[2] for p in postures]
    for k, (side, keys) in enumerate(zip(SIDES, of_sides, strict=True)):
        upper = np.array([key.upper for key in keys])
        arm = (
            between(upper[low], upper[low + 1], share),
            mixed([np.array(key.elbow_rad) for key in keys]),
        )
        limbs = arm_turns(chest, arm, (trunk.collars[:, k], trunk.wrists[:, k]), side)
        legs = leg_turns(heading, trunk.thighs[:, k], trunk.knees[:, k], side)
        for limb, values in (limbs | legs).items():
            turns[:, index(f"{side}_{limb}")] = values
        ankles.append(-THIGH * legs["thigh"][:, 2, 2] - SHIN * legs["shin"][:, 2, 2])
    height = ANKLE - np.minimum(*ankles)
    places = np.concatenate([trunk.place, height[:, None]], axis=1)
    motion = Motion(name, "scripted", FPS, turns.astype(np.float32), places.astype(np.float32))
    return motion.facing_forward()


def roll_pitch_yaw(angles_deg: FloatArray) -> FloatArray:
    """Return rotations (n, 3, 3): roll about x, then pitch about y, then yaw about z, deg."""
    x, y, z = (about_axis(k, np.radians(angles_deg[:, k])) for k in range(3))
    return np.asarray(z @ y @ x)


def mirrored(turns: FloatArray, side: str) -> FloatArray:
    """Return rotations of the left side, or their mirror images for the right one."""
    flip = np.diag([1.0, 1.0 if side == "left" else -1.0, 1.0])
    return np.asarray(flip @ turns @ flip)


def arm_turns(
    chest: FloatArray,
    arm: tuple[FloatArray, FloatArray],
    joints_deg: tuple[FloatArray, FloatArray],
    side: str,
) -> dict[str, FloatArray]:
    """Return world rotations (n, 3, 3) of collar, upper arm, forearm and hand.

    Args:
        chest: rotations (n, 3, 3).
        arm: quaternions (n, 4) of the upper arm and flexions of the elbow (n,), rad.
        joints_deg: raise and advance (n, 2) of the collar and angles (n, 3) of the wrist.
        side: "left" or "right".
    """
    upper = from_quaternions(arm[0])
    fore = upper @ about_axis(2, -arm[1])
    # The collar bone follows the arm upwards.
    elevation = np.arcsin(np.clip(upper[:, 2, 1], -1, 1)) + np.pi / 2
    raised = np.radians(joints_deg[0][:, 0]) + COLLAR_PER_ELEVATION * (elevation - np.pi / 4)
    advanced = np.radians(joints_deg[0][:, 1])
    zero = np.zeros_like(raised)
    collar = about_vector(np.stack([raised, zero, -advanced], axis=1))
    hand = chest @ mirrored(fore, side) @ bend(np.radians(joints_deg[1]), side)
    limbs = {"collar": collar, "upper_arm": upper, "forearm": fore}
    return {limb: chest @ mirrored(turn, side) for limb, turn in limbs.items()} | {"hand": hand}


def leg_turns(
    heading: FloatArray, thigh_deg: FloatArray, knee_deg: FloatArray, side: str
) -> dict[str, FloatArray]:
    """Return world rotations (n, 3, 3) of thigh, shin and foot.

    Args:
        heading: of the hips (n, 3, 3), about the vertical.
        thigh_deg: forward and sideways swing (n, 2), deg.
        knee_deg: flexion (n,), deg.
        side: "left" or "right".
    """
    aside = about_axis(2, np.radians(thigh_deg[:, 1])) @ about_axis(0, np.radians(thigh_deg[:, 1]))
    # A thigh forward turns about the left axis the negative way.
    thigh = aside @ about_axis(1, np.radians(-thigh_deg[:, 0]))
    shin = thigh @ about_axis(1, np.radians(knee_deg))
    limbs = {"thigh": thigh, "shin": shin, "foot": aside}
    return {limb: heading @ mirrored(turn, side) for limb, turn in limbs.items()}
