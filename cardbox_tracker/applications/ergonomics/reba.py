"""REBA scores of results, with their legs.

S. Hignett and L. McAtamney, "Rapid Entire Body Assessment (REBA)", Applied Ergonomics 31(2), 2000,
pages 201-205. Upper arms are scored as in :mod:`.rula`; the other parts as follows:

- trunk: 1 upright, 2 to 20 degrees, 3 to 60, 4 beyond, forwards or backwards (backwards ends at 3);
  bent aside adds 1;
- neck: 1 to 20 degrees of flexion against the trunk, 2 beyond or in extension; twisted adds 1;
- legs: 1 if both feet carry weight, and walking or sitting, 2 if one does; the knee of a leg that
  carries weight adds 1 from 30 degrees on, 2 beyond 60, but not while sitting;
- lower arm: 1 for 60 to 100 degrees between it and the line of the upper arm, else 2;
- wrist: 1 to 15 degrees to the palm or to the back, 2 beyond; bent aside adds 1.

Load, coupling and activity come from the settings, and so do neck, legs and wrists where they were
not measured. A foot that is 10 cm higher than the other one carries no weight, so a step of a walk
counts as standing on one leg. Bent knees count unless the person is seen to sit: for a second, the
thighs are level and the centre of mass lies behind the heels, from where anybody else would fall.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cardbox_tracker.applications.ergonomics.recording import RulaRow
from cardbox_tracker.applications.ergonomics.rula import (
    INDEPENDENT,
    NOT_MEASURED,
    PARTS,
    POSTURE_ROWS,
    SAMPLES,
    WRISTS,
    ErgonomicConfig,
    Method,
    ScoreArray,
    ScoreDistribution,
    Scores,
    distribution_of,
    elbow_scores,
    measured_parts,
    neck_samples,
    neck_scores,
    of_both_arms,
    part,
    table_of,
    trunk_scores,
    upper_arm_scores,
    with_arms,
    wrist_samples,
    wrist_scores,
    wrists_of,
)
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.settings import setting
from cardbox_tracker.person.legs import LEG_KEYPOINT_NAMES, leg_directions
from cardbox_tracker.person.posture import PITCH
from cardbox_tracker.person.proportions import MASS_SHARES
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import LEG_NAMES, STATE_NAMES, KeypointState
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.recordings.result_table import LEG_POINT_COLUMNS, POINT_COLUMNS
from cardbox_tracker.search.particles import normal_postures


@dataclass(frozen=True, kw_only=True)
class RebaConfig(ErgonomicConfig):
    """Settings of REBA."""

    inputs = (
        *("neck", "legs", "wrist", "load", "coupling", "activity"),
        *("shoulders_raised", "arms_supported", "trunk_twisted"),
    )
    neck: int = setting(
        1,
        "score of the neck: 1 for 0 to 20 degrees of flexion, 2 beyond or in extension; 1 more if "
        "twisted or bent aside; declared for images without points of the face",
        limits=(1, 3),
    )
    legs: int = setting(
        1,
        "score of the legs: 1 if both feet carry weight, walking or sitting, 2 if one does or the "
        "posture is unstable; 1 more with knees bent by 30 to 60 degrees, 2 beyond; declared for "
        "images that do not show both legs",
        limits=(1, 4),
    )
    wrist: int = setting(
        1,
        "score of the wrists: 1 to 15 degrees, 2 beyond; 1 more if bent aside or twisted; declared "
        "for images in which a hand is not measured",
        limits=(1, 3),
    )
    load: int = setting(
        0, "0 below 5 kg, 1 for 5 to 10 kg, 2 above; 1 more with shocks", limits=(0, 3)
    )
    coupling: int = setting(0, "handles: 0 good, 1 fair, 2 poor, 3 unacceptable", limits=(0, 3))
    activity: int = setting(
        0,
        "1 each if a part of the body is held for longer than a minute, if a small motion is "
        "repeated more than 4 times in one, if the posture changes widely and fast",
        limits=(0, 3),
    )
    arms_supported: bool = setting(
        False, f"the arms are supported, the person leans, or gravity helps; {NOT_MEASURED}"
    )


TABLE_A: ScoreArray = table_of(
    """
    1 2 3 4  1 2 3 4  3 3 5 6
    2 3 4 5  3 4 5 6  4 5 6 7
    2 4 5 6  4 5 6 7  5 6 7 8
    3 5 6 7  5 6 7 8  6 7 8 9
    4 6 7 8  6 7 8 9  7 8 9 9
    """,
    *(5, 3, 4),
)
"""Posture of the body: trunk (5), neck (3), legs (4)."""

TABLE_B: ScoreArray = table_of(
    """
    1 2 2  1 2 3
    1 2 3  2 3 4
    3 4 5  4 5 5
    4 5 5  5 6 7
    6 7 8  7 8 8
    7 8 8  8 9 9
    """,
    *(6, 2, 3),
)
"""Posture of one arm: upper arm (6), lower arm (2), wrist (3)."""

TABLE_C: ScoreArray = table_of(
    """
    1 1 1 2 3 3 4 5 6 7 7 7
    1 2 2 3 4 4 5 6 6 7 7 8
    2 3 3 3 4 5 6 7 7 8 8 8
    3 4 4 4 5 6 7 8 8 9 9 9
    4 4 4 5 6 7 8 8 9 9 9 9
    6 6 6 7 8 8 9 9 10 10 10 10
    7 7 7 8 9 9 9 10 10 11 11 11
    8 8 8 9 10 10 10 10 10 11 11 11
    9 9 9 10 10 10 11 11 11 12 12 12
    10 10 10 11 11 11 11 12 12 12 12 12
    11 11 11 11 12 12 12 12 12 12 12 12
    12 12 12 12 12 12 12 12 12 12 12 12
    """,
    *(12, 12),
)
"""Score of body and load (12), and of arm and coupling (12)."""


REBA = Method(
    "REBA",
    15,
    7,
    (
        (1, 1, "negligible risk"),
        (2, 3, "low risk; change may be needed"),
        (4, 7, "medium risk; change is needed"),
        (8, 10, "high risk; change soon"),
        (11, 15, "very high risk; change now"),
    ),
    (
        *of_both_arms("upper arm", 6),
        *of_both_arms("lower arm", 2),
        *(part("trunk", 5), part("neck", 3), part("legs", 4)),
        *of_both_arms("table B", 9),
        part("table A", 9),
        *of_both_arms("wrist", 3),
    ),
    {},
    ("neck", "legs", *WRISTS),
)

# Height above the other foot from which a foot carries no weight, m.
_LIFTED_M = 0.10
# Heel behind the ankle, m, and margin of the middle of the mass, m: two deviations where hips,
# knees and trunk are wrong by 9 degrees.
_HEEL_M, _MARGIN_M = 0.05, 0.17
# Slope up to which thighs are level, rad; time after which somebody like that sits, ns.
_LEVEL_RAD, _SITS_NS = math.radians(30.0), 1_000_000_000


class Seen(NamedTuple):
    """One image of a table."""

    stamp_ns: int  #: its stamp
    time_s: float  #: seconds from the recording's start
    state: str  #: of the tracker
    #: values and deviations of ``STATE_NAMES``, (2, n), rad and m; nan where they are unknown, and
    #: for legs unless both are ``tracked``
    joints: FloatArray
    #: hips to shoulders, then thigh and shank of the left and the right leg, (5,)
    lengths_m: FloatArray

    @property
    def has_posture(self) -> bool:
        """Whether the posture is known."""
        return bool(np.isfinite(self.joints[:, POSTURE_ROWS]).all())

    @property
    def measured(self) -> frozenset[str]:
        """Names of the known ones among neck, legs and wrists."""
        return measured_parts(self.joints)


def images_of(results: Results) -> list[Seen]:
    """Return the images of a table of results; CardboxError if it has no legs."""
    missing = [name for name in LEG_NAMES if name not in results.numbers]
    if missing:
        raise CardboxError(
            f"{results.path} has no column {missing[0]}; make a table with 'cardbox track "
            "RECORDING --detector mediapipe --csv OUT.csv'"
        )
    shape = len(results.state), 2, 3, 3
    legs_m = results.of(LEG_POINT_COLUMNS).reshape(shape)
    shoulders_m = results.of(POINT_COLUMNS).reshape(shape)[:, :, 0].mean(axis=1)
    trunk_m = np.linalg.norm(shoulders_m - legs_m[:, :, 0].mean(axis=1), axis=-1)
    bones_m = np.linalg.norm(np.diff(legs_m, axis=2), axis=-1).reshape(len(legs_m), 4)
    states = [results.texts_of(f"{name}_state") for name in LEG_KEYPOINT_NAMES]
    are_tracked = np.all(np.array(states) == KeypointState.TRACKED, axis=0)
    joints = np.stack([results.of(STATE_NAMES), results.deviations_of(STATE_NAMES)], axis=1)
    joints[np.ix_(~are_tracked, np.arange(2), PARTS["legs"])] = np.nan
    lengths_m, upright = np.column_stack([trunk_m, bones_m]), results.upright_state
    times = zip(results.stamp_ns.tolist(), results.time_s.tolist(), upright, strict=True)
    return [Seen(*at, *of) for at, *of in zip(times, joints, lengths_m, strict=True)]


def score_reba(results: Results, config: RebaConfig, seed: int) -> list[RulaRow]:
    """Return the scores of each image of results; CardboxError if they have no columns of legs."""
    return score_table(images_of(results), config, seed)


def score_table(images: Sequence[Seen], config: RebaConfig, seed: int) -> list[RulaRow]:
    """Return the scores of each image, for samples of its posture as in :mod:`.rula`."""
    rng = np.random.default_rng(seed)
    is_seated = _seated(images)
    return [
        RulaRow(
            seen.stamp_ns,
            seen.state,
            _distribution(seen, config, rng, is_sitting) if seen.has_posture else None,
            seen.time_s,
            seen.measured,
        )
        for seen, is_sitting in zip(images, is_seated, strict=True)
    ]


def _seated(images: Sequence[Seen]) -> list[bool]:
    """Return for each image whether the person is seen to sit; hidden legs change nothing."""
    found, run, began_ns, last_ns = [False] * len(images), list[int](), 0, 0
    for number, seen in enumerate(images):
        if not seen.has_posture or "legs" not in seen.measured:
            continue
        values = seen.joints[0]
        if not sits(values[PARTS["legs"]], values[PITCH], seen.lengths_m):
            run.clear()
            continue
        if not run or seen.stamp_ns - last_ns > _SITS_NS:
            run, began_ns = [], seen.stamp_ns
        run.append(number)
        last_ns = seen.stamp_ns
        if last_ns - began_ns >= _SITS_NS:
            for one in run:
                found[one] = True
    return found


def _distribution(
    seen: Seen, config: RebaConfig, rng: np.random.Generator, is_seated: bool
) -> ScoreDistribution:
    mean, stddev = seen.joints[:, POSTURE_ROWS]
    postures = normal_postures(mean, INDEPENDENT * stddev, SAMPLES, rng)
    neck = necks = leg = legs = None
    if "neck" in seen.measured:
        neck, spread = seen.joints[:, PARTS["neck"]]
        necks = neck_samples(neck, INDEPENDENT * spread, SAMPLES, rng)
    if "legs" in seen.measured:
        leg, spread = seen.joints[:, PARTS["legs"]]
        legs = leg + INDEPENDENT * spread * rng.standard_normal((SAMPLES, len(leg)))
    wrists = wrists_of(seen.joints)
    rest = seen.lengths_m, is_seated
    drawn = wrist_samples(wrists, SAMPLES, rng)
    scores = reba_scores(postures, config, necks, legs, drawn, *rest)
    of_mean = reba_scores(mean, config, neck, leg, wrists[0], *rest)
    return distribution_of(scores, REBA, int(of_mean["grand"]))


def reba_scores(
    postures: FloatArray,
    config: RebaConfig,
    necks: FloatArray | None = None,
    legs: FloatArray | None = None,
    wrists: FloatArray | None = None,
    lengths_m: FloatArray | None = None,
    is_seated: bool = False,
) -> Scores:
    """Return the scores of postures.

    Args:
        postures: shape (..., 12), rad and metres.
        config: settings.
        necks: ``neck_yaw`` and ``neck_pitch`` of each posture, (..., 2), rad; None if unknown.
        legs: ``LEG_NAMES`` of each posture, (..., 8), rad; None if unknown.
        wrists: flexion and deviation of the left and the right wrist in each posture,
            (..., 2, 2), rad; nan or None if unknown.
        lengths_m: see :class:`Seen`; needed with legs.
        is_seated: whether the person sits, so that bent knees do not count.
    """
    is_far_back = np.degrees(postures[..., PITCH]) < -60.0
    trunk = trunk_scores(postures, config) - is_far_back
    neck = np.full(trunk.shape, config.neck) if necks is None else neck_scores(necks, 2, 20.0)
    leg = np.full(trunk.shape, config.legs)
    if legs is not None and lengths_m is not None:
        leg = _legs(legs, lengths_m, is_seated)
    table_a = TABLE_A[trunk - 1, neck - 1, leg - 1]
    body = np.minimum(table_a + config.load, 12)

    def arm(upper: FloatArray, fore: FloatArray, side: float, angles: FloatArray) -> Scores:
        upper_arm, lower_arm = upper_arm_scores(upper, side, config), elbow_scores(upper, fore)
        wrist = wrist_scores(angles, (15.0,), config.wrist)
        table_b = TABLE_B[upper_arm - 1, lower_arm - 1, wrist - 1]
        grand = TABLE_C[body - 1, np.minimum(table_b + config.coupling, 12) - 1] + config.activity
        return {
            "upper_arm": upper_arm,
            "lower_arm": lower_arm,
            "wrist": wrist,
            "table_b": table_b,
            "grand": grand,
        }

    of_body = {"trunk": trunk, "neck": neck, "legs": leg, "table_a": table_a}
    return with_arms(of_body, postures, wrists, arm)


def _legs(angles: FloatArray, lengths_m: FloatArray, is_seated: bool) -> ScoreArray:
    """Return the scores of legs (..., 8)."""
    _, ankle_m = _limbs_m(angles, lengths_m)
    carries = ankle_m[..., 2] <= ankle_m[..., 2].min(axis=0) + _LIFTED_M
    if is_seated:
        return np.ones(carries.shape[1:], int)
    bent_deg = np.where(carries, np.degrees(angles[..., [3, 7]].T.reshape(carries.shape)), 0.0)
    most_deg = bent_deg.max(axis=0)
    bent = np.where(most_deg > 60.0, 2, np.where(most_deg >= 30.0, 1, 0))
    return np.asarray(np.where(carries.all(axis=0), 1, 2) + bent)


def _limbs_m(angles: FloatArray, lengths_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return both knees and ankles (2, ..., 3) below the hips; X points forwards, Z up."""
    knees, ankles = [], []
    for number, side in enumerate((1.0, -1.0)):
        thigh, shank = leg_directions(angles[..., 4 * number : 4 * number + 4], side)
        knees.append(lengths_m[1 + 2 * number] * thigh)
        ankles.append(knees[-1] + lengths_m[2 + 2 * number] * shank)
    return np.stack(knees), np.stack(ankles)


def sits(angles: FloatArray, pitch: FloatArray, lengths_m: FloatArray) -> ScoreArray:
    """Return whether thighs are level, and the weight is behind the feet.

    Args:
        angles: ``LEG_NAMES``, (..., 8), rad.
        pitch: of the trunk, (...), rad.
        lengths_m: see :class:`Seen`.
    """
    knee_m, ankle_m = _limbs_m(angles, lengths_m)
    of_shoulders, _, of_knees, of_ankles = MASS_SHARES
    legs_m = of_knees * knee_m[..., 0] + of_ankles * ankle_m[..., 0]
    centre_m = of_shoulders * lengths_m[0] * np.sin(pitch) + legs_m.mean(axis=0)
    heels_m = ankle_m[..., 0].min(axis=0) - _HEEL_M
    slopes_rad = np.abs(np.arcsin(knee_m[..., 2] / np.linalg.norm(knee_m, axis=-1)))
    is_level = (slopes_rad < _LEVEL_RAD).all(axis=0)
    return np.asarray(is_level & (centre_m < heels_m - _MARGIN_M))
