"""Doubt: how probably a result is wrong, joint by joint, and the deviations of a state.

A keypoint is wrong if it is off by more than 30 cm relative to the middle of the shoulders; a whole
result is lost if its elbows and hands are, on average. Both probabilities are
logistic regressions

    p = 1 / (1 + exp(-(intercept + sum of coefficient * evidence)))

of what search, silhouette and terms say about the result. There is one model for each kind of
keypoint and for the whole, and one set of models for outlines of a measured person, for outlines
of a person of mean proportions, with points, and for the paper's filter. ``python -m
lab.fits.doubt`` fits them on recorded sessions with ground truth and checks each on sessions that
were left out (``doubt.json`` beside this file).
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from enum import StrEnum
from functools import cache
from itertools import compress
from math import exp, log, sqrt
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.compiling import inlined_kernel, kernel
from cardbox_tracker.common.least_squares import DIFFERENCE
from cardbox_tracker.person.kinematics import keypoints
from cardbox_tracker.person.posture import (
    LEFT_ARM,
    N_STATE,
    PITCH,
    RIGHT_ARM,
    ROLL,
    TORSO_X,
    TURNS,
    YAW,
)
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import KeypointState
from cardbox_tracker.terms.kernel_arguments import BodyTuple, body_of

BoolArray = NDArray[np.bool_]
Values = Mapping[str, FloatArray]
"""Evidence by name, one value for each keypoint, (6,)."""

FAR_M = 0.30
"""A keypoint that is farther off is wrong, m."""
LOST_FROM = 0.5
"""Probability of being wrong above which a keypoint is lost, and of being lost above which a result
is uncertain: it is rather wrong than right."""
WHOLE_LOST_FROM = 0.9
"""Probability of being lost above which a result counts as a poor one."""
KINDS = ("shoulder", "elbow", "hand") * 2
"""Kind of each keypoint; the models have these names, and ``whole``."""
ELBOWS, HANDS = ([i for i, one in enumerate(KINDS) if one == kind] for kind in ("elbow", "hand"))
"""Indices of the elbows and the hands among the keypoints."""
IMAGE = "image"
"""Name of the model of an image that has a wrong keypoint, where there is one."""
BACK, WHOLE = "the person is seen from behind", "the whole posture may be another one"
"""Reasons why a whole result is uncertain."""
SETTLED_FRAMES = 15
"""Images after which a search has settled, and what was seen in all of them is no accident."""

_FILE = Path(__file__).with_name("doubt.json")
# Weight of the previous probability of loss in the smoothed one.
_MEMORY = 0.5
# What stays, from one image to the next, of the doubt about hands beyond the present one: an arm
# that was wrongly chosen is often rated well in single images.
_DOUBT_STAYS = 0.85
STAYS_SURE = 1.25
"""Share of the limit of this doubt below which a sure posture stays so: a robot that follows would
stop and go on where the doubt is about the limit."""
_AREAS = 0.1, 3.0
# Least probability of a keypoint, and of its opposite, that counts in the doubt about an image.
_LEAST_CHANCE = 1e-3
# How much better than its rivals a result is rated, as a share of the silhouette: least, usual and
# highest value; rating by which a mirrored arm is less likely by e; least move that counts, m.
_BETTER, _MIRROR_RATING, _LEAST_MOVE_M = (1e-3, 0.03, 0.5), 0.05, 0.02
# How far outside of the trunk a joint counts as seen, or as hidden inside, m.
_BESIDE_M = 0.2

# Deviations of the states do not include errors of model and silhouette. These factors and floors,
# chosen on motion capture, make two deviations cover about 95 % of the errors; rad and m.
_GAINS, _FLOORS = np.full(N_STATE, 2.0), np.full(N_STATE, 0.02)
_FLOORS[TURNS], _FLOORS[ROLL] = 0.15, 0.06
for _arm in (LEFT_ARM, RIGHT_ARM):
    _GAINS[_arm], _FLOORS[_arm] = 3.0, 0.20


class Source(StrEnum):
    """What a result rests on; each has its own models."""

    OUTLINE = "outline"
    MEASURED = "measured outline"
    POINTS = "points"
    PAPER = "paper"


class Model(NamedTuple):
    """A logistic regression."""

    intercept: float  #: logit without evidence
    coefficients: Mapping[str, float]  #: by the names of the evidence


class Models(NamedTuple):
    """The models of results that rest on the same."""

    #: probability of being wrong above which a keypoint is uncertain: the highest one with which at
    #: most 2 % of the tracked keypoints of left-out sources are wrong
    uncertain_from: float
    #: that of the image or, without points, of a hand over time (:func:`remembered`), above which
    #: the posture is uncertain, and without points the hand: the highest one with which at most
    #: 2 % of the images that are ``tracking``, with points 2.5 % of those of real people, have a
    #: wrong keypoint
    doubtful_from: float
    by_kind: Mapping[str, Model]  #: by the names of :data:`KINDS`, ``whole`` and ``IMAGE``


class Judgement(NamedTuple):
    """The doubt about one result."""

    chances: FloatArray  #: probability of each keypoint to be wrong, (6,)
    states: tuple[KeypointState, ...]  #: state of each keypoint
    reason: str  #: why the posture may be wrong; empty if it is sure
    is_poor: bool  #: whether it does not fit; several such results in a row mean a lost person
    evidence: Values  #: what the probabilities follow from, by name

    @property
    def is_uncertain(self) -> bool:
        """Whether the posture may be wrong."""
        return bool(self.reason)


class Doubt:
    """The doubt about the results of one person over time."""

    def __init__(self) -> None:
        """Begin without results."""
        self._models = models()
        self.forget()

    def forget(self) -> None:
        """Forget the previous results."""
        self._whole: float | None = None
        self._hands = np.zeros(len(HANDS))
        self._source: Source | None = None
        self._is_sure = False

    def judge(
        self, evidence: Values, source: Source, hidden: BoolArray, veto: str = ""
    ) -> Judgement:
        """Return the doubt about a result that rests on ``source``, by its evidence.

        ``hidden`` (6,) says whether no camera sees a keypoint; a ``veto``, such as ``BACK``, is a
        reason why the whole result is uncertain.
        """
        if source is not self._source:
            # What an outline left open, points show.
            self.forget()
            self._source = source
        uncertain_from, doubtful_from, of = self._models[source]
        values = {name: each.tolist() for name, each in evidence.items()}
        chances = np.array([_chance(of[kind], values, i) for i, kind in enumerate(KINDS)])
        whole = _chance(of["whole"], values, 0)
        self._whole = whole if self._whole is None else _MEMORY * (self._whole + whole)
        reason = veto or (WHOLE if self._whole > LOST_FROM else "")
        is_doubted = bool(reason)
        is_unsure = chances > uncertain_from
        self._hands = remembered(self._hands, chances[HANDS])
        doubts = self._hands
        if IMAGE in of:
            seen = evidence_of_image(float(doubts.max()), chances, values["left over"][0])
            # No hand of a sure image is uncertain.
            doubts = np.maximum(_chance(of[IMAGE], seen, 0), doubts * (doubts > uncertain_from))
        # The paper's filter finds hands so badly that its state only says whether it is lost.
        if source is not Source.PAPER:
            limit = doubtful_from
            if self._is_sure:
                limit = min(STAYS_SURE * doubtful_from, uncertain_from)
            if doubts.max() > limit:
                sides = ("left hand", "right hand")
                least = min(limit, float(self._hands.max()))
                doubtful = " and ".join(compress(sides, self._hands >= least))
                reason = reason or f"the {doubtful} may be elsewhere"
            # An outline shows hands so badly that they make the images uncertain.
            if source is not Source.POINTS:
                is_unsure[HANDS] = self._hands > limit
        self._is_sure = not reason
        given = zip(
            chances.tolist(), hidden.tolist(), (is_unsure | is_doubted).tolist(), strict=True
        )
        states = tuple(_state_of(*one) for one in given)
        return Judgement(chances, states, reason, self._whole > WHOLE_LOST_FROM, evidence)


def remembered(before: FloatArray, chances: FloatArray) -> FloatArray:
    """Return the doubt (2,) about each hand after one image: it rises at once, and fades slowly."""
    faded: FloatArray = _DOUBT_STAYS * before + (1.0 - _DOUBT_STAYS) * chances
    return np.maximum(chances, faded)


def evidence_of_image(
    hand: float, chances: FloatArray, left_over: float
) -> dict[str, tuple[float]]:
    """Return the evidence of an image.

    ``hand`` is the doubt about the worse hand over time, ``chances`` (6,) those of the keypoints,
    and ``left_over`` the share of the silhouette that the model does not cover.
    """
    worst = {"hand": hand, "elbow": float(chances[ELBOWS].max())}
    found = dict[str, tuple[float]]()
    for name, one in worst.items():
        inside = min(max(one, _LEAST_CHANCE), 1.0 - _LEAST_CHANCE)
        found[name] = (log(inside / (1.0 - inside)),)
    return found | {"left over": (left_over,)}


def doubted(states: Sequence[KeypointState]) -> tuple[KeypointState, ...]:
    """Return the ``states`` of a result that is doubtful as a whole: nothing is tracked."""
    doubt = {KeypointState.TRACKED: KeypointState.UNCERTAIN}
    return tuple(doubt.get(state, state) for state in states)


@cache
def models() -> Mapping[Source, Models]:
    """Return the package's models by what a result rests on."""
    stored = json.loads(_FILE.read_text(encoding="utf-8"))
    return MappingProxyType(
        {
            Source(source): Models(
                one["uncertain_from"],
                one["doubtful_from"],
                {kind: Model(*model) for kind, model in one["models"].items()},
            )
            for source, one in stored.items()
        }
    )


def _chance(model: Model, evidence: Mapping[str, Sequence[float]], index: int) -> float:
    logit = model.intercept
    for name, coefficient in model.coefficients.items():
        if name in evidence:
            logit += coefficient * evidence[name][index]
    return 1.0 / (1.0 + exp(-min(max(logit, -50.0), 50.0)))


def _state_of(chance: float, is_hidden: bool, is_uncertain: bool) -> KeypointState:
    if is_hidden:
        return KeypointState.HIDDEN
    if chance > LOST_FROM:
        return KeypointState.LOST
    return KeypointState.UNCERTAIN if is_uncertain else KeypointState.TRACKED


def evidence_of_search(
    pixels: tuple[float, float, float, float],
    prior: float,
    spreads_m: Sequence[float],
    result: tuple[FloatArray, FloatArray],
    body: BodyTuple,
    age: int,
) -> dict[str, FloatArray]:
    """Return the evidence of search and silhouettes; numbers of pixels become shares.

    ``pixels`` are those of the silhouettes, of the model in the front posture at the person's
    distance, of the model in the result, and those in which the result differs. ``prior`` is the
    rating of the best state beyond these; ``spreads_m`` the deviation of left elbow and hand, then
    right ones, in the search of the arms; ``result`` the state (14,) and its deviations (14,), see
    :func:`deviations_of`; ``age`` the number of frames since the search began.
    """
    silhouette_px, frontal_px, model_px, differing_px = pixels
    state, deviations = result
    # A person at the border may have no pixels above the hips.
    total = max(silhouette_px, 1.0)
    common = 0.5 * (silhouette_px + model_px - differing_px)
    area = log(min(max(total / max(frontal_px, 1.0), _AREAS[0]), _AREAS[1]))
    spread_m = np.empty(6)
    _spreads(state, deviations, body, spread_m)
    left_elbow, left_hand, right_elbow, right_hand = spreads_m
    whole = {
        "residual": differing_px / total,
        "left over": (total - common) / total,
        "outside": (model_px - common) / total,
        "area": area,
        "area difference": abs(area),
        "prior": prior,
        "distance spread": float(deviations[TORSO_X]),
        "yaw": abs(float(state[YAW])),
        "pitch": abs(float(state[PITCH])),
        "freshness": exp(-age / SETTLED_FRAMES),
    }
    found = _of_all_keypoints(whole)
    found["spread"] = np.log(np.maximum(spread_m, 1e-3) / 0.1)
    found["arm spread"] = np.array(
        [left_elbow, left_elbow, left_hand, right_elbow, right_elbow, right_hand]
    )
    return found


def evidence_of_arms(
    keypoints_m: FloatArray,
    seen_m: FloatArray,
    rating: float,
    rated: tuple[FloatArray, FloatArray],
    mirrored: tuple[FloatArray, FloatArray],
) -> dict[str, FloatArray]:
    """Return the evidence of single arms: whether others fit as well, and whether they are seen.

    One outline is that of several arms. They are those that the search ``rated``, keypoints (N, 6,
    3) and ratings (N,), and the ``mirrored`` images of the result in depth, whose outlines hardly
    differ: keypoints (6, 6, 3) and ratings (6,) with upper arm, forearm, and both, of the left arm,
    then of the right one. ``keypoints_m`` (6, 3) and ``rating`` are of the result, and ``seen_m``
    (6, 3) its keypoints before the camera that shows it best.

    By name: ``better``, by how much states are rated worse in which the keypoint is more than
    ``FAR_M`` away (logarithm); ``sure``, that times how little the mirrored arms move it;
    ``slope``, the cosine between upper arm and line of sight; ``beside trunk``, how far the joints
    up to the keypoint are beside or above the trunk in the image, m.
    """
    found = np.zeros((4, 6))
    _arms(keypoints_m, seen_m, rating, *rated, *mirrored, found)
    return dict(zip(("better", "sure", "slope", "beside trunk"), found, strict=True))


@inlined_kernel
def _apart_m(one_m: FloatArray, other_m: FloatArray, point: int) -> float:
    """Return how far a keypoint is apart in two results (6, 3), beside the shoulders' middle."""
    squares = 0.0
    for axis in range(3):
        change = one_m[point, axis] - other_m[point, axis]
        middle = one_m[0, axis] + one_m[3, axis] - other_m[0, axis] - other_m[3, axis]
        squares += (change - 0.5 * middle) ** 2
    return sqrt(squares)


@kernel
def _arms(
    points_m: FloatArray,
    seen_m: FloatArray,
    rating: float,
    rated_m: FloatArray,
    ratings: FloatArray,
    mirrored_m: FloatArray,
    mirrored_ratings: FloatArray,
    found: FloatArray,
) -> None:
    """Write the evidence (4, 6) of :func:`evidence_of_arms`."""
    least, usual, most = _BETTER
    middle_m = 0.5 * (seen_m[0] + seen_m[3])
    breadth_m = sqrt((seen_m[0, 0] - seen_m[3, 0]) ** 2 + (seen_m[0, 1] - seen_m[3, 1]) ** 2)
    best = min(rating, ratings.min())
    for arm in range(2):
        shoulder = 3 * arm
        beside_m = _BESIDE_M
        upper_m, elbow_m = seen_m[shoulder + 1] - seen_m[shoulder], seen_m[shoulder + 1]
        along = abs((upper_m * elbow_m).sum())
        slope = along / (sqrt((upper_m**2).sum() * (elbow_m**2).sum()) + 1e-9)
        for point in range(shoulder + 1, shoulder + 3):
            rival = np.inf
            for i in range(rated_m.shape[0]):
                if ratings[i] < rival and _apart_m(rated_m[i], points_m, point) > FAR_M:
                    rival = ratings[i]
            weights, squares = 1.0, 0.0
            for i in range(shoulder, shoulder + 3):
                moved_m = _apart_m(mirrored_m[i], points_m, point)
                weight = exp(-max(mirrored_ratings[i] - rating, 0.0) / _MIRROR_RATING)
                weights, squares = weights + weight, squares + weight * moved_m**2
                if moved_m > FAR_M:
                    rival = min(rival, mirrored_ratings[i])
            better = log(min(max(rival - best, least), most) / usual)
            move_m = max(sqrt(squares / weights), _LEAST_MOVE_M)
            scale = middle_m[2] / max(seen_m[point, 2], 1e-3)
            aside_m = abs(seen_m[point, 0] * scale - middle_m[0]) - 0.5 * breadth_m
            above_m = middle_m[1] - seen_m[point, 1] * scale
            beside_m = min(beside_m, max(aside_m, above_m, -_BESIDE_M))
            found[0, point] = better
            found[1, point] = max(better, 0.0) * max(log(FAR_M / move_m), 0.0)
            found[2, point], found[3, point] = slope, beside_m


def evidence_of_particles(
    iou: float, area: float, posture: FloatArray, stddev: FloatArray, body: BodyTuple
) -> dict[str, FloatArray]:
    """Return the evidence of the paper's filter, of posture and deviations (12,) of particles.

    ``area`` are pixels of the silhouette divided by those of the model in the front posture.
    """
    state, deviations, spread_m = np.zeros(N_STATE), np.zeros(N_STATE), np.empty(6)
    state[: len(posture)], deviations[: len(stddev)] = posture, stddev
    _spreads(state, deviations, body, spread_m)
    log_area = log(min(max(area, _AREAS[0]), _AREAS[1]))
    whole = {
        "misfit": 1.0 - iou,
        "area": log_area,
        "area difference": abs(log_area),
        "yaw": abs(float(state[YAW])),
        "pitch": abs(float(state[PITCH])),
    }
    found = _of_all_keypoints(whole)
    found["spread"] = np.log(np.maximum(spread_m, 1e-3) / 0.1)
    return found


def _of_all_keypoints(values: Mapping[str, float]) -> dict[str, FloatArray]:
    """Return values of the whole result for each keypoint, (6,)."""
    rows = np.empty((len(values), 6))
    rows.T[:] = list(values.values())
    return dict(zip(values, rows, strict=True))


@kernel
def _spreads(
    state: FloatArray, deviations: FloatArray, body: BodyTuple, spread_m: FloatArray
) -> None:
    """Write the deviation (6,) of each keypoint beside the shoulders' middle, m.

    It is the root of the trace of the covariance that follows from the derivatives by the elements
    of the state, which are taken as independent.
    """
    middle_m, moved_m, moved = np.empty((6, 3)), np.empty((6, 3)), state.copy()
    of = body_of(body)
    keypoints(state, of, middle_m)
    spread_m[:] = 0.0
    for number in range(len(state)):
        if deviations[number] == 0.0:
            continue
        moved[number] = state[number] + DIFFERENCE
        keypoints(moved, of, moved_m)
        moved[number] = state[number]
        for point in range(6):
            for axis in range(3):
                common = 0.5 * (moved_m[0, axis] + moved_m[3, axis])
                common -= 0.5 * (middle_m[0, axis] + middle_m[3, axis])
                change = moved_m[point, axis] - middle_m[point, axis] - common
                spread_m[point] += (change * deviations[number] / DIFFERENCE) ** 2
    for point in range(6):
        spread_m[point] = np.sqrt(spread_m[point])


def deviations_of(stddev: FloatArray) -> FloatArray:
    """Return calibrated standard deviations (14,) of a result from those of the states (14,)."""
    calibrated: FloatArray = np.hypot(_GAINS * stddev, _FLOORS)
    return calibrated


def calibrated_deviations(deviations: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return differences (n, 14) from a result with the deviations of :func:`deviations_of`.

    ``deviations`` (n, 14) are those of states, drawn by their weights, from the mean.
    """
    calibrated: FloatArray = _GAINS * deviations + _FLOORS * rng.standard_normal(deviations.shape)
    return calibrated
