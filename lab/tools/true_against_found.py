"""Rate the true posture against the found one.

``python -m lab.tools.true_against_found SESSION...``

The tool tracks recorded sessions with ground truth. In each scored image it poses the tracked body
at the true joints, moved so that the middle of the shoulders stays where the search found it, and
searches for the best rating within a few centimetres of them, as the found state is a best one,
too. The ratings of both are compared term by term. So it tells whether the search or the cost is to
blame for an error, and which term of the cost.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.commands.arguments import at_least
from cardbox_tracker.common.compiling import kernel
from cardbox_tracker.person.kinematics import jacobian
from cardbox_tracker.person.model import BodyModel, body_from_proportions
from cardbox_tracker.person.posture import ARM_ANGLES, FIRST_ANGLES
from cardbox_tracker.recordings.truth import SHOULDERS, beside_shoulders
from cardbox_tracker.search.config import PRESETS
from cardbox_tracker.search.whole_body import WholeBodyFilter
from cardbox_tracker.terms.body_priors import PENETRATION, WEIGHT, penetration, priors
from cardbox_tracker.terms.whole_body import WholeBodyCost
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.tracker import Tracker
from lab.evaluation.session import RecordedSession, load_session
from lab.evaluation.tracking import InputSelection, track_session

FloatArray = NDArray[np.float64]

TERMS = ("pixels", "torso", "left arm", "right arm", "penetration", "colours and others")
"""Summands of a rating; the priors of an arm are without its penetration."""

HANDS = (2, 5)
FAR_M = 0.20
"""Error of a hand, aligned, from which on an image is counted as wrong."""

# The true state may differ from the found one by this in place and angles of the torso and arms.
_STDDEV = np.array([0.02, 0.05, 0.05, 0.05, *[0.5] * (2 * ARM_ANGLES), 0.02, 0.02])
# Gauss-Newton steps, the deviation of a joint from its wanted place, m, and the fits that begin
# with other arms.
_STEPS, _SPREAD_M, _STARTS = 10, 0.01, 8
# Search near the true joints: rounds, states in a round, first noise, its decay, and the distance
# that a joint may move, m.
_ROUNDS, _STATES, _DECAY, _REACH_M = 6, 60, 0.7, 0.04
_NOISE = np.array([0.01, 0.02, 0.02, 0.03, *[0.06] * (2 * ARM_ANGLES), 0.01, 0.01])


class Compared(NamedTuple):
    """One image.

    Attributes:
        found: terms of the best state of the search, (6,), as shares of the silhouette.
        true: terms of the state at the true joints, (6,).
        away_m: largest aligned error of a hand of the best state, metres.
        missed_m: largest distance of an elbow or hand of the state at the true joints from them.
    """

    found: FloatArray
    true: FloatArray
    away_m: float
    missed_m: float


@kernel
def _depth_inside(points: FloatArray, parts: FloatArray) -> float:
    return penetration(points, parts)


def terms_of(cost: WholeBodyCost, state: FloatArray) -> FloatArray:
    """Return the ``TERMS`` of the rating of a state (14,), (6,), as shares of the silhouette."""
    rated = cost.bodies(state[None])
    rating, differing_px = float(rated.ratings[0]), float(rated.costs_px[0])
    pixels = differing_px / max(cost.silhouette_px, 1)
    prior = cost._prior
    by_part = np.array(priors(state, cost.body, prior))
    rules = prior[1]
    inside = np.zeros(len(FIRST_ANGLES))
    for arm, first in enumerate(FIRST_ANGLES):
        joints = cost.joints(state[None, first : first + ARM_ANGLES], arm)[0]
        inside[arm] = rules[WEIGHT] * rules[PENETRATION] * _depth_inside(joints, cost.parts)
    arms = by_part[1:] - inside
    rest = rating - pixels - by_part.sum()
    return np.array([pixels, by_part[0], *arms, inside.sum(), rest])


def state_at(
    cost: WholeBodyCost, found: FloatArray, keypoints_m: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Return a state (14,) whose arms are as true ones and whose torso is near that of ``found``.

    Args:
        cost: cost of the tracked body.
        found: state of the search, (14,).
        keypoints_m: true keypoints (6, 3), metres in the optical frame.
        rng: source of the arms from which the fits begin.
    """
    middle = cost.keypoints(found)[list(SHOULDERS)].mean(axis=0)
    wanted = keypoints_m - keypoints_m[list(SHOULDERS)].mean(axis=0) + middle
    low, high = cost.limits.T
    starts = np.repeat(found[None], _STARTS, axis=0)
    for first in FIRST_ANGLES:
        arm = slice(first, first + ARM_ANGLES)
        starts[1:, arm] = rng.uniform(low[arm], high[arm], (_STARTS - 1, ARM_ANGLES))
    fits = [_fitted(cost, start, found, wanted) for start in starts]
    return min(fits, key=lambda state: float(np.linalg.norm(cost.keypoints(state) - wanted)))


def _fitted(
    cost: WholeBodyCost, state: FloatArray, found: FloatArray, wanted: FloatArray
) -> FloatArray:
    """Return the state (14,) after Gauss-Newton steps to keypoints (6, 3), m, near ``found``."""
    torso = np.ones(len(state), dtype=bool)
    torso[FIRST_ANGLES[0] : FIRST_ANGLES[0] + 2 * ARM_ANGLES] = False
    weights = 1.0 / _STDDEV**2
    for _ in range(_STEPS):
        off = (wanted - cost.keypoints(state)).ravel()
        by_state = (
            jacobian(cost.person, state, cost.pitch_rad)[-len(wanted) :].reshape(-1, len(state)).T
        )
        matrix = by_state @ by_state.T / _SPREAD_M**2 + np.diag(weights)
        back = np.where(torso, weights * (found - state), 0.0)
        change = np.linalg.solve(matrix, by_state @ off / _SPREAD_M**2 + back)
        state = np.clip(state + change, *cost.limits.T)
    return state


def best_near(cost: WholeBodyCost, state: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the best rated state (14,) of those with all joints near those of ``state`` (14,)."""
    joints_m, best, noise = cost.keypoints(state), state, _NOISE
    for _ in range(_ROUNDS):
        states = best + noise * rng.standard_normal((_STATES, len(state)))
        states = np.clip(states, cost.limits[:, 0], cost.limits[:, 1])
        moved = np.array([cost.keypoints(one) for one in states]) - joints_m
        is_near = np.linalg.norm(beside_shoulders(moved), axis=2).max(axis=1) < _REACH_M
        states = np.concatenate([best[None], states[is_near]])
        best = states[np.argmin(cost.bodies(states).ratings)]
        noise = _DECAY * noise
    return best


def compare(
    cost: WholeBodyCost, found: FloatArray, keypoints_m: FloatArray, rng: np.random.Generator
) -> Compared:
    """Compare the state ``found`` (14,) of the search with the one at true keypoints (6, 3)."""
    true = best_near(cost, state_at(cost, found, keypoints_m, rng), rng)
    off = beside_shoulders(np.stack([cost.keypoints(s) - keypoints_m for s in (found, true)]))
    away = np.linalg.norm(off, axis=2)
    joints = [j for j in range(len(keypoints_m)) if j not in SHOULDERS]
    return Compared(
        terms_of(cost, found),
        terms_of(cost, true),
        float(away[0, list(HANDS)].max()),
        float(away[1, joints].max()),
    )


def compared(session: RecordedSession, seed: int, body: BodyModel | None = None) -> list[Compared]:
    """Return the comparison of each scored image of a session, tracked with its first camera."""
    truth = dict(zip(session.stamps_ns.tolist(), session.keypoints_m, strict=True))
    found: list[Compared] = []
    rng = np.random.default_rng(seed)

    def observe(_: int, stamp_ns: int, estimate: Estimate, tracker: Tracker) -> None:
        search = tracker.filter
        if stamp_ns not in truth or estimate.posture is None:
            return
        if isinstance(search, WholeBodyFilter):
            best = search.rated.best(1)[0]
            found.append(compare(search._cost.costs[0], best, truth[stamp_ns], rng))

    only = InputSelection(only=session.truth.cameras[0] if session.truth.cameras else None)
    track_session(session, PRESETS["default"](), (seed,), only, observe, body)
    return found


def table(name: str, images: Sequence[Compared]) -> list[str]:
    """Return rows of a Markdown table: for images with and without a far hand, each term."""
    rows = []
    for kind, chosen in (
        (f"hand beyond {100 * FAR_M:.0f} cm", [one for one in images if one.away_m > FAR_M]),
        ("others", [one for one in images if one.away_m <= FAR_M]),
    ):
        if not chosen:
            continue
        found, true = (np.array([getattr(one, key) for one in chosen]) for key in ("found", "true"))
        missed_cm = 100 * float(np.median([one.missed_m for one in chosen]))
        cells = [_cell(found.sum(axis=1), true.sum(axis=1))]
        cells += [_cell(f, t) for f, t in zip(found.T, true.T, strict=True)]
        rows.append(
            f"| {name} | {kind} | {len(chosen)} | {missed_cm:.1f} | " + " | ".join(cells) + " |"
        )
    return rows


def _cell(found: FloatArray, true: FloatArray) -> str:
    wins = 100 * float(np.mean(true < found))
    return f"{found.mean():.3f} / {true.mean():.3f}, {wins:.0f} %"


def main(args: list[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--runs", type=at_least(1), default=1, help="runs with consecutive seeds")
    parser.add_argument(
        "--unmeasured", action="store_true", help="the body has the proportions of the stature"
    )
    given = parser.parse_args(args)
    print("Found / true, as a share of the silhouette; share of the images in which true is less.")
    names = ("session", "images", "number", "missed, cm", "all", *TERMS)
    print(f"\n| {' | '.join(names)} |\n|{'---|' * len(names)}")
    for folder in given.sessions:
        session = load_session(folder)
        body = _guessed(session) if given.unmeasured else None
        run = partial(compared, session, body=body)
        images = [one for seed in range(given.seed, given.seed + given.runs) for one in run(seed)]
        print("\n".join(table(session.name, images)), flush=True)


def _guessed(session: RecordedSession) -> BodyModel:
    truth = session.truth
    pitch_rad = float(np.radians(truth.pitch_deg))
    stature_m = truth.stature_m or 1.7
    return body_from_proportions(stature_m, truth.distance_m, camera_pitch_rad=pitch_rad)


if __name__ == "__main__":
    main()
