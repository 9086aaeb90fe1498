"""RULA scores of postures: angles give scores of the parts, tables combine these.

L. McAtamney and E. N. Corlett, "RULA: a survey method for the investigation of work-related upper
limb disorders", Applied Ergonomics 24(2), 1993, pages 91-99. The parts are scored as in its
figures:

- upper arm: angle from hanging along the trunk, in any direction: 1 to 20 degrees, 2 to 45 and for
  more than 20 backwards, 3 to 90, 4 beyond; abducted adds 1;
- lower arm: 1 for 60 to 100 degrees between it and the line of the upper arm, else 2; a hand beyond
  the middle of the body, or a forearm that points outside, adds 1;
- neck: 1 to 10 degrees of flexion against the trunk, 2 to 20, 3 beyond, 4 in extension; twisted
  adds 1;
- trunk: 1 upright, 2 to 20 degrees, 3 to 60, 4 beyond, forwards or backwards; bent aside adds 1;
- wrist: 1 neutral, 2 to 15 degrees, 3 beyond, to the palm or to the back; bent aside adds 1.

Twist of the wrists, legs, twist of the trunk, load and muscle use come from the settings, and neck
and wrists where their angles are not known. A neck that bends aside is not measured. All scores
count from 1, so an index into a table or into chances is the score less one.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.settings import Settings, setting, settings_of
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.posture import LEFT_ARM, PITCH, RIGHT_ARM, ROLL
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import (
    NECK_LIMITS,
    POSTURE_GROUPS,
    Group,
    arm_directions,
    rows_of,
)

MEASURED, DECLARED, MIXED = "measured", "declared", "mixed"
"""Origins of a part score; tables and the grand score are mixed."""
NOT_SEEN = "declared, not seen"
WRISTS = "left_wrist", "right_wrist"
"""Parts that share the declared input ``wrist``."""
POSTURE_ROWS = rows_of(*POSTURE_GROUPS)
PARTS = {
    "neck": rows_of(Group.NECK),
    "legs": rows_of(Group.LEG),
    **{f"{side}_wrist": rows_of(Group.HAND, side=side)[1:] for side in ("left", "right")},
}
"""Rows of the state of neck, legs, and flexion and deviation of the wrists."""

NOT_MEASURED = "declared, since it is not measured"


@dataclass(frozen=True, kw_only=True)
class ErgonomicConfig(Settings):
    """What no image shows, of both methods.

    Raises ValueError if a value is out of its range; the text names it.
    """

    inputs: ClassVar[tuple[str, ...]]  #: names of the settings in their order on the page
    shoulders_raised: bool = setting(False, f"the shoulders are raised; {NOT_MEASURED}")
    arms_supported: bool = setting(
        False, f"the arms are supported, or the person leans; {NOT_MEASURED}"
    )
    trunk_twisted: bool = setting(
        False,
        "the trunk is twisted against the hips; declared, since torso_yaw is where the whole "
        "person faces",
    )


@dataclass(frozen=True, kw_only=True)
class RulaConfig(ErgonomicConfig):
    """Settings of RULA."""

    inputs = (
        *("neck", "wrist", "wrist_twist", "legs", "arm_load", "arm_muscle_use"),
        *("body_load", "body_muscle_use", "shoulders_raised", "arms_supported", "trunk_twisted"),
    )
    neck: int = setting(
        1,
        "score of the neck: 1 for 0 to 10 degrees of flexion, 2 to 20, 3 beyond, 4 in extension; 1 "
        "more each if twisted, bent aside; declared for images without points of a face",
        limits=(1, 6),
    )
    wrist: int = setting(
        1,
        "score of the wrists: 1 neutral, 2 to 15 degrees, 3 beyond; 1 more if bent aside; declared "
        "for images in which a hand is not measured",
        limits=(1, 4),
    )
    wrist_twist: int = setting(
        1, f"1 in the middle of the range, 2 at or near its end; {NOT_MEASURED}", limits=(1, 2)
    )
    legs: int = setting(
        1, f"1 if legs and feet are supported and balanced, else 2; {NOT_MEASURED}", limits=(1, 2)
    )
    arm_muscle_use: int = setting(
        0, "1 if the arms' posture is held for a minute or repeated 4 times in one", limits=(0, 1)
    )
    arm_load: int = setting(
        0,
        "load on the arms: 0 below 2 kg now and then, 1 for 2 to 10 kg now and then, 2 for 2 to 10 "
        "kg held or repeated, 3 beyond or with shocks",
        limits=(0, 3),
    )
    body_muscle_use: int = setting(0, "as arm_muscle_use, of neck, trunk and legs", limits=(0, 1))
    body_load: int = setting(0, "as arm_load, of neck, trunk and legs", limits=(0, 3))


class Declared(NamedTuple):
    """A declared setting, its value or ``yes`` or ``no``, and whether this is the default."""

    name: str
    value: str
    is_default: bool
    description: str

    @property
    def words(self) -> str:
        """Name and value."""
        return f"{self.name.replace('_', ' ')} {self.value}"

    def __str__(self) -> str:
        return f"{self.words} (default)" if self.is_default else self.words


def declared(
    config: ErgonomicConfig, measured: Collection[str] = frozenset()
) -> tuple[Declared, ...]:
    """Return the inputs that are declared, without parts that are ``measured``."""
    defaults = {one.name: one.default for one in fields(config)}
    found = []
    for name in config.inputs:
        if all(part in measured for part in (WRISTS if name == "wrist" else (name,))):
            continue
        value = getattr(config, name)
        text = str(value) if type(value) is int else ("no", "yes")[value]
        found.append(
            Declared(name, text, value == defaults[name], settings_of(config)[name].description)
        )
    return tuple(found)


ScoreArray = NDArray[np.int64]
Scores = Mapping[str, ScoreArray]
"""Scores (...) by the names of the parts. ``left_grand`` and ``right_grand`` are the grand scores
with one arm, and ``grand`` is that of the worse one; tables are without load and muscle use."""

# The papers name no angle for these words.
ABDUCTED_DEG, OUTWARDS_DEG, NECK_TWISTED_DEG, WRIST_ASIDE_DEG, SIDE_BENT_DEG = 30, 30, 20, 15, 10
# The papers have 0, which nobody keeps, and which is within the error of the measurement.
NECK_EXTENDED_DEG, UPRIGHT_DEG, WRIST_NEUTRAL_DEG = 10, 10, 5

SAMPLES = 500
"""Samples of a distribution; the standard error of a probability of 0.5 is then 0.02."""


INDEPENDENT = 0.25
"""Part of a standard deviation of the tracker that differs from image to image.

The rest is the same in all images of a recording, such as a wrong pitch of the camera, and the
posture contains its noise already. Drawn anew for each image, it would push scores up, because most
limits lie around the posture of the least score. On real people with a 3D reference, errors change
within a second by 0.2 to 0.5 of the deviations, and a quarter gives the true shares of time.
"""


def table_of(rows: str, *shape: int) -> ScoreArray:
    """Return a table of whole numbers of a shape."""
    table = np.array(rows.split(), dtype=np.int64).reshape(shape)
    table.setflags(write=False)
    return table


TABLE_A: ScoreArray = table_of(
    """
    1 2  2 2  2 3  3 3    2 2  2 2  3 3  3 3    2 3  3 3  3 3  4 4
    2 3  3 3  3 4  4 4    3 3  3 3  3 4  4 4    3 4  4 4  4 4  5 5
    3 3  4 4  4 4  5 5    3 4  4 4  4 4  5 5    4 4  4 4  4 5  5 5
    4 4  4 4  4 5  5 5    4 4  4 4  4 5  5 5    4 4  4 5  5 5  6 6
    5 5  5 5  5 6  6 7    5 6  6 6  6 7  7 7    6 6  6 7  7 7  7 8
    7 7  7 7  7 8  8 9    8 8  8 8  8 9  9 9    9 9  9 9  9 9  9 9
    """,
    *(6, 3, 4, 2),
)
"""Posture of one arm: upper arm (6), lower arm (3), wrist (4), wrist twist (2)."""

TABLE_B: ScoreArray = table_of(
    """
    1 3  2 3  3 4  5 5  6 6  7 7
    2 3  2 3  4 5  5 5  6 7  7 7
    3 3  3 4  4 5  5 6  6 7  7 7
    5 5  5 6  6 7  7 7  7 7  8 8
    7 7  7 7  7 8  8 8  8 8  8 8
    8 8  8 8  8 8  8 9  9 9  9 9
    """,
    *(6, 6, 2),
)
"""Posture of the rest: neck (6), trunk (6), legs (2)."""

TABLE_C: ScoreArray = table_of(
    """
    1 2 3 3 4 5 5
    2 2 3 4 4 5 5
    3 3 3 4 4 5 6
    3 3 3 4 5 6 6
    4 4 4 5 6 7 7
    4 4 5 6 6 7 7
    5 5 6 6 7 7 7
    5 5 6 7 7 7 7
    """,
    *(8, 7),
)
"""Grand score: wrist and arm (8 or more), neck, trunk and legs (7 or more)."""


class Part(NamedTuple):
    """A part score: column of the tables, words, highest score."""

    name: str
    words: str
    highest: int


def part(words: str, highest: int, side: str = "") -> Part:
    """Return a part of the body, or of the arm of a ``side``, by its words."""
    name = words.lower().replace(" ", "_")
    return (
        Part(f"{side}_{name}", f"{words}, {side}", highest) if side else Part(name, words, highest)
    )


def of_both_arms(words: str, highest: int) -> tuple[Part, Part]:
    """Return a part of the left and of the right arm."""
    return part(words, highest, "left"), part(words, highest, "right")


class Method(NamedTuple):
    """What tables and pages of scores need to know of a method."""

    name: str  #: its name
    highest: int  #: highest grand score
    above: int  #: grand score above which work has to be changed soon or at once
    #: lowest and highest grand score of each action level, and its meaning
    levels: tuple[tuple[int, int, str], ...]
    parts: tuple[Part, ...]  #: parts and tables whose scores are shown
    declared_parts: Mapping[str, int]  #: highest score of each part that no image shows
    #: names of the parts that are measured in some images and declared in others
    measurable: tuple[str, ...]


RULA = Method(
    "RULA",
    7,
    5,
    (
        (1, 2, "acceptable unless it is held or repeated for long"),
        (3, 4, "investigate further; changes may be required"),
        (5, 6, "investigate and change soon"),
        (7, 7, "investigate and change immediately"),
    ),
    (
        *of_both_arms("upper arm", 6),
        *of_both_arms("lower arm", 3),
        *(part("trunk", 6), part("neck", 6)),
        *of_both_arms("table A", 9),
        part("table B", 9),
        *of_both_arms("wrist", 4),
    ),
    {"wrist_twist": 2, "legs": 2},
    ("neck", *WRISTS),
)
"""Table A rates upper arm, lower arm and wrist, table B neck, trunk and legs; both without load and
muscle use."""


class ScoreDistribution(NamedTuple):
    """Chances (n,) of the grand scores 1 to n, which is 7 in RULA; each array adds up to 1."""

    grand: FloatArray  #: chances for the worse arm
    left: FloatArray  #: chances for the left arm
    right: FloatArray  #: chances for the right arm
    #: the same of the scores of each part, by its name; empty if they are not known
    parts: Mapping[str, FloatArray] = MappingProxyType({})
    #: score of the mean posture, from which the samples deviate; 0 if it is not known
    of_mean: int = 0

    @property
    def mean(self) -> float:
        """Expected grand score."""
        return expected(self.grand)

    @property
    def likeliest(self) -> int:
        """Most probable grand score; the lowest of equally probable ones."""
        return int(np.argmax(self.grand)) + 1

    def chance_above(self, score: int) -> float:
        """Return the chance that the grand score is higher than ``score``."""
        return float(self.grand[score:].sum())


def expected(chances: FloatArray) -> float:
    """Return the expected score of the chances (n,) of the scores 1 to n."""
    return float(chances @ np.arange(1, len(chances) + 1))


def neck_samples(
    neck: FloatArray, stddev: FloatArray, count: int, rng: np.random.Generator
) -> FloatArray:
    """Return normal samples (count, 2) of ``neck_yaw`` and ``neck_pitch``, rad, in their limits."""
    drawn = neck + stddev * rng.standard_normal((count, len(neck)))
    return np.asarray(np.clip(drawn, NECK_LIMITS[:, 0], NECK_LIMITS[:, 1]))


def wrists_of(joints: FloatArray) -> FloatArray:
    """Return flexion and deviation of both wrists, and standard deviations, (2, 2, 2), of a state.

    The state is (2, n), see below; a wrist whose deviations are unknown is nan.
    """
    wrists = joints[:, [PARTS[name] for name in WRISTS]]
    return np.where(np.isfinite(wrists[1]), wrists, np.nan)


def wrist_samples(wrists: FloatArray, count: int, rng: np.random.Generator) -> FloatArray | None:
    """Return normal samples (count, 2, 2) of the wrists, rad; None if both are unknown.

    ``wrists`` (2, 2, 2) are flexion and deviation of both, and standard deviations, rad, nan if
    unknown. A wrist is drawn with its whole deviation, because so little of it is measured: a
    quarter would make nearly every wrist straight.
    """
    mean, stddev = wrists
    if np.isnan(stddev).all():
        return None
    return np.asarray(mean + stddev * rng.standard_normal((count, 2, 2)))


def measured_parts(joints: FloatArray) -> frozenset[str]:
    """Return the names of neck, legs and wrists that are known in a state, see below."""
    return frozenset(name for name, rows in PARTS.items() if np.isfinite(joints[:, rows]).all())


def sampled_scores(
    body: BodyModel,
    joints: FloatArray,
    drawn: FloatArray,
    config: RulaConfig,
    rng: np.random.Generator,
) -> tuple[ScoreDistribution, frozenset[str]]:
    """Return the scores of an uncertain posture, and which of the measurable parts are measured.

    ``joints`` (2, n) are values and deviations of ``STATE_NAMES``, nan where they are unknown,
    ``drawn`` (m, 12) are samples of the posture with its whole deviation, rad and metres.
    """
    measured, neck, necks = measured_parts(joints), None, None
    posture, wrists = joints[0, POSTURE_ROWS], wrists_of(joints)
    if "neck" in measured:
        neck, stddev = joints[:, PARTS["neck"]]
        necks = neck_samples(neck, INDEPENDENT * stddev, len(drawn), rng)
    bent = wrist_samples(wrists, len(drawn), rng)
    found = score_distribution(body, posture + INDEPENDENT * (drawn - posture), config, necks, bent)
    of_mean = rula_scores(body, posture, config, neck, wrists[0])["grand"]
    return found._replace(of_mean=int(of_mean)), measured & {*RULA.measurable}


def score_distribution(
    body: BodyModel,
    postures: FloatArray,
    config: RulaConfig,
    necks: FloatArray | None = None,
    wrists: FloatArray | None = None,
) -> ScoreDistribution:
    """Return the distribution of :func:`rula_scores` of equally likely postures (n, 12)."""
    return distribution_of(rula_scores(body, postures, config, necks, wrists), RULA)


def distribution_of(scores: Scores, method: Method, of_mean: int = 0) -> ScoreDistribution:
    """Return the distribution of the scores (n,) of equally likely postures."""

    def chances(name: str, highest: int = method.highest) -> FloatArray:
        found = scores[name]
        return np.asarray(np.bincount(found, minlength=highest + 1)[1:] / len(found))

    parts = {part.name: chances(part.name, part.highest) for part in method.parts}
    grand, left, right = map(chances, ("grand", "left_grand", "right_grand"))
    return ScoreDistribution(grand, left, right, parts, of_mean)


def rula_scores(
    body: BodyModel,
    postures: FloatArray,
    config: RulaConfig,
    necks: FloatArray | None = None,
    wrists: FloatArray | None = None,
) -> Scores:
    """Return the scores of postures (..., 12), rad and metres, of ``body``.

    ``necks`` (..., 2) are ``neck_yaw`` and ``neck_pitch``, rad, or None; ``wrists`` (..., 2, 2)
    flexion and deviation of the left and the right wrist, rad, nan or None if unknown.
    """
    trunk = trunk_scores(postures, config)
    neck = np.full(trunk.shape, config.neck) if necks is None else neck_scores(necks, 4, 10.0, 20.0)
    table_b = TABLE_B[neck - 1, trunk - 1, config.legs - 1]
    rest = table_b + config.body_muscle_use + config.body_load
    parts = body_parts(body.sizes)

    def arm(upper: FloatArray, fore: FloatArray, side: float, angles: FloatArray) -> Scores:
        hand_m = parts.shoulder_aside_m + side * (
            parts.upper_arm.height_m * upper[..., 1] + parts.forearm.height_m * fore[..., 1]
        )
        is_away = (hand_m < 0.0) | (_aside_deg(fore, side) > OUTWARDS_DEG)
        upper_arm = upper_arm_scores(upper, side, config)
        lower_arm = elbow_scores(upper, fore) + is_away
        wrist = wrist_scores(angles, (WRIST_NEUTRAL_DEG, 15.0), config.wrist)
        table_a = TABLE_A[upper_arm - 1, lower_arm - 1, wrist - 1, config.wrist_twist - 1]
        grand = grand_score(table_a + config.arm_muscle_use + config.arm_load, rest)
        return {
            "upper_arm": upper_arm,
            "lower_arm": lower_arm,
            "wrist": wrist,
            "table_a": table_a,
            "grand": grand,
        }

    return with_arms({"trunk": trunk, "neck": neck, "table_b": table_b}, postures, wrists, arm)


def with_arms(
    body: Scores,
    postures: FloatArray,
    wrists: FloatArray | None,
    arm: Callable[[FloatArray, FloatArray, float, FloatArray], Scores],
) -> Scores:
    """Return the scores of the ``body`` with those of both arms in postures (..., 12).

    ``arm`` returns the scores of an arm for the directions (..., 3) of upper arm and forearm in the
    trunk's frame, +1 for left or -1, and the angles (..., 2) of the wrist, rad, nan if unknown.
    """
    if wrists is None:
        wrists = np.full((*postures.shape[:-1], 2, 2), np.nan)
    found = dict(body)
    for number, (name, joints, side) in enumerate(
        (("left", LEFT_ARM, 1.0), ("right", RIGHT_ARM, -1.0))
    ):
        directions = arm_directions(postures[..., joints], side)
        scores = arm(*directions, side, wrists[..., number, :])
        found |= {f"{name}_{part}": of_part for part, of_part in scores.items()}
    return found | {"grand": np.maximum(found["left_grand"], found["right_grand"])}


def trunk_scores(postures: FloatArray, config: ErgonomicConfig) -> ScoreArray:
    """Return the scores of the trunk in postures (..., 12)."""
    bow_deg, bend_deg = (np.abs(np.degrees(postures[..., joint])) for joint in (PITCH, ROLL))
    trunk = _steps(bow_deg, UPRIGHT_DEG, 20.0, 60.0) + (bend_deg > SIDE_BENT_DEG)
    return np.asarray(trunk + config.trunk_twisted)


def neck_scores(necks: FloatArray, extended: int, *limits_deg: float) -> ScoreArray:
    """Return the scores of necks (..., 2), rad; a neck in extension has the score ``extended``.

    The score is 1 up to the first of the limits of the flexion, and 1 more beyond each of them; a
    twisted neck adds 1.
    """
    yaw_deg, pitch_deg = (np.degrees(necks[..., joint]) for joint in (0, 1))
    score = np.where(pitch_deg < -NECK_EXTENDED_DEG, extended, _steps(pitch_deg, *limits_deg))
    return np.asarray(score + (np.abs(yaw_deg) > NECK_TWISTED_DEG))


def wrist_scores(wrists: FloatArray, limits_deg: Sequence[float], declared: int) -> ScoreArray:
    """Return the scores of wrists (..., 2), rad: flexion and deviation.

    The score is 1 up to the first of the limits of the flexion, and 1 more beyond each of them; a
    hand that is bent aside adds 1. Wrists with nan have the ``declared`` score.
    """
    bent_deg, aside_deg = np.moveaxis(np.abs(np.degrees(wrists)), -1, 0)
    score = _steps(bent_deg, *limits_deg) + (aside_deg > WRIST_ASIDE_DEG)
    return np.asarray(np.where(np.isnan(bent_deg), declared, score))


def upper_arm_scores(upper: FloatArray, side: float, config: ErgonomicConfig) -> ScoreArray:
    """Return the scores of upper arms with the directions (..., 3) in the trunk's frame."""
    # In the trunk's frame X points forwards, Y to the left, Z up.
    raised_deg = np.degrees(np.arccos(np.clip(-upper[..., 2], -1.0, 1.0)))
    is_backwards = (-upper[..., 0] > np.abs(upper[..., 1])) & (raised_deg > 20.0)
    score = np.where(is_backwards, 2, _steps(raised_deg, 20.0, 45.0, 90.0))
    score = score + (_aside_deg(upper, side) > ABDUCTED_DEG)
    return np.asarray(np.clip(score + config.shoulders_raised - config.arms_supported, 1, 6))


def elbow_scores(upper: FloatArray, fore: FloatArray) -> ScoreArray:
    """Return 1 for elbows that are bent by 60 to 100 degrees, else 2."""
    bent_deg = np.degrees(np.arccos(np.clip((upper * fore).sum(axis=-1), -1.0, 1.0)))
    return np.where((bent_deg >= 60.0) & (bent_deg <= 100.0), 1, 2)


def _aside_deg(limb: FloatArray, side: float) -> FloatArray:
    return np.asarray(np.degrees(np.arcsin(np.clip(side * limb[..., 1], -1.0, 1.0))))


def grand_score(arm: ScoreArray, rest: ScoreArray) -> ScoreArray:
    """Look up table C with the scores of arm and wrist, and of neck, trunk and legs."""
    return np.asarray(TABLE_C[np.minimum(arm, 8) - 1, np.minimum(rest, 7) - 1])


def _steps(angle_deg: FloatArray, *limits_deg: float) -> ScoreArray:
    """Return 1 up to the first limit, and 1 more beyond each."""
    return np.asarray(1 + np.searchsorted(limits_deg, angle_deg))


def part_values(
    scores: ScoreDistribution, config: RulaConfig, measured: Collection[str]
) -> dict[str, str]:
    """Return the part scores of one image in words, and the inputs that were not seen."""
    values = {}
    for part in RULA.parts:
        from_ = MEASURED if part.name in measured else DECLARED
        name = part.words + (f" ({from_})" if part.name in RULA.measurable else "")
        values[name] = f"{expected(scores.parts[part.name]):.2f}"
    for name in RULA.declared_parts:
        values[f"{name.replace('_', ' ')} ({DECLARED})"] = str(getattr(config, name))
    return values | {NOT_SEEN: ", ".join(map(str, declared(config, measured)))}
