"""Results of recordings, each by the images before and after it.

An error of a joint has a part that lasts and a part that changes from image to image. The
fixed-interval smoother for a motion whose acceleration is white noise, whose backward pass gives
the same as the equation below, takes the second part away. It is the cubic smoothing spline (Kohn &
Ansley, "A new algorithm for spline smoothing based on smoothing a stochastic process", 1987): the x
with the least

    sum of w_k (z_k - x(t_k))^2 + (2 pi f)^-4 integral of x''^2,

which is a low-pass of fourth order without delay: a motion of the frequency f keeps half of its
amplitude. Of some frequencies up to 4 Hz it is the one with which the limbs in the images around
are most likely (Wecker & Ansley, "The signal extraction approach to nonlinear regression and spline
smoothing", 1983), so slow motions are smoothed more. The weight w of an image is the time around
it, times (v + n) / (v + e^2) of an error e, in deviations, of its n values: the errors have
Student's distribution with v degrees of freedom, whose estimate are repeated least squares (Lange,
Little & Taylor, "Robust statistical modeling using the t distribution", 1989). So an arm that a few
images show at another depth stays. What is smoothed are directions of limbs, since angles of a
straight arm jump.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.rates import carried
from cardbox_tracker.person.kinematics import angles_of_arms, clavicles, pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import (
    LEFT_ARM,
    N_JOINTS,
    PLACE,
    RIGHT_ARM,
    TORSO_X,
    TORSO_Y,
    TORSO_Z,
    TURNS,
    YAW,
)
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import (
    KEYPOINT_NAMES,
    POSTURE_GROUPS,
    STATE_NAMES,
    UNITS,
    Group,
    KeypointState,
    arm_directions,
    rows_of,
)
from cardbox_tracker.search.arm_search import ARM_LIMITS
from cardbox_tracker.tracking.estimate import CONTRADICTED, FILLED, Estimate

T = TypeVar("T")

LAG_S = 0.5
"""Seconds on either side of an image that count; others change it by less than 1 mm."""

# Below the first, images count that are farther than LAG_S; arms are never faster than the last.
_CUTOFFS_HZ = np.array([1.5, 2.0, 2.5, 3.0, 3.5, 4.0])
# Deviation of the part that changes, m or rad, in images of this rate.
_NOISE, _RATE_HZ = 0.05, 30.0
_FREEDOM, _ROUNDS = 4.0, 8
# In how many values the usual noise counts beside that of the residuals.
_PRIOR = 1.0
# Nobody turns as far between two images: the tracker has found that it was wrong.
_TURN_RAD = 0.5 * np.pi
_PLACES = [TORSO_Y, TORSO_X, TORSO_Z]
_SIDES = (LEFT_ARM, 1.0), (RIGHT_ARM, -1.0)
# Values that are smoothed with one weight: place, turns of the trunk, four limbs, neck, legs. The
# logarithms of deviations and the points of the legs go with them.
_OWN = np.repeat(np.arange(8), (3, 3, 3, 3, 3, 3, 2, 8))
_WITH = np.concatenate([[0, 1, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 0, 0], [7] * 18])
_OF = np.concatenate([_OWN, _WITH])
_BEGINS, _COUNTS = np.unique(_OWN, return_index=True, return_counts=True)[1:]
_LIMB_GROUPS = slice(2, 6)
_LIMBS = slice(_BEGINS[_LIMB_GROUPS.start], _BEGINS[_LIMB_GROUPS.stop])
_PLACED, _STDDEVS = slice(_LIMBS.stop), slice(len(_OWN), len(_OWN) + PLACE.stop)
_NECK, _LEGS = slice(_LIMBS.stop, _BEGINS[-1]), slice(_BEGINS[-1], len(_OWN))
_LEG_POINTS = slice(_STDDEVS.stop, len(_OF))
# The rows of the skeleton that are smoothed as they are, and their values.
_FOLLOWING, _FOLLOWED = rows_of(Group.NECK, Group.LEG), slice(_NECK.start, _LEGS.stop)
# The deviations that belong to place, trunk and each limb.
_LASTING = [np.flatnonzero(_WITH[: PLACE.stop] == group) for group in range(6)]
# What has rates: the joints of posture and place, the rises of the shoulders, then keypoints.
_MOVED = np.concatenate([rows_of(*POSTURE_GROUPS, Group.PLACE), rows_of(Group.CLAVICLE)])
_ARE_ANGLES = np.array(
    [*(UNITS[STATE_NAMES[row]] == "rad" for row in _MOVED), *[False] * 3 * len(KEYPOINT_NAMES)]
)


class _Result(NamedTuple):
    """The result of one person in one image."""

    estimate: Estimate
    body: BodyModel
    values: FloatArray  #: (60,), nan where they are not known


class Spline(NamedTuple):
    """Smooth values at n times, and what is known of them, by values or by groups of values."""

    values: FloatArray  #: (n, 60)
    stddev: FloatArray  #: of the groups, (n, 8)
    cutoff_hz: float  #: frequency of which half is left
    #: velocities, their deviations, accelerations and their deviations, (4, n, 28)
    rates: FloatArray | None = None


class _Image(NamedTuple, Generic[T]):
    image: T
    stamp_ns: int
    results: list[_Result]  #: by person


class Smoothing(NamedTuple):
    """How estimates are smoothed."""

    lag_s: float = LAG_S  #: seconds of later images that count for an image; 0: none is smoothed
    every_s: float = LAG_S  #: seconds whose images are smoothed at once
    has_rates: bool = False  #: whether estimates get velocities and accelerations
    #: images without a posture get one between two that have it, at most so many seconds apart
    longest_gap_s: float = 0.0


OF_RECORDINGS = Smoothing()
"""How recordings are smoothed unless asked otherwise."""


class Smoother(Generic[T]):
    """Smooths the estimates of images, in order of time, of one person or several.

    Estimates without a place, as those of the preset ``paper``, stay as they are, and so do states
    and chances.
    """

    def __init__(self, smoothing: Smoothing = OF_RECORDINGS) -> None:
        """Begin before the first image."""
        self._how = smoothing
        self._around_s = max(LAG_S, smoothing.longest_gap_s)
        self._images: list[_Image[T]] = []
        self._done = 0

    def add(
        self, image: T, stamp_ns: int, estimates: Sequence[Estimate], bodies: Iterable[BodyModel]
    ) -> list[tuple[T, list[Estimate]]]:
        """Take an image and its estimates by person; return images that are finished likewise."""
        if not self._how.lag_s:
            return [(image, list(estimates))]
        if self._images and stamp_ns <= self._images[-1].stamp_ns:
            # What comes after a clock went back is another motion, and would be waited for.
            early, self._images, self._done = self.finish(), [], 0
            return early + self.add(image, stamp_ns, estimates, bodies)
        pairs = zip(estimates, bodies, strict=True)
        results = [_Result(estimate, body, _values(estimate)) for estimate, body in pairs]
        for person, result in enumerate(results):
            if result.estimate.reason == CONTRADICTED:
                self._doubt(person)
        self._images.append(_Image(image, stamp_ns, results))
        waiting_s = (stamp_ns - self._images[self._done].stamp_ns) / 1e9
        lag_s = max(self._how.lag_s, self._how.longest_gap_s)
        if waiting_s < lag_s + self._how.every_s:
            return []
        return self._finished(stamp_ns - round(1e9 * lag_s))

    def _doubt(self, person: int) -> None:
        """Doubt the latest images of a person, which came before cameras were known to be wrong."""
        for one in self._images[self._done :]:
            if person < len(one.results):
                before = one.results[person]
                one.results[person] = before._replace(estimate=before.estimate.contradicted())

    def finish(self) -> list[tuple[T, list[Estimate]]]:
        """Return all images that were not yet returned."""
        waiting = self._images[self._done :]
        return self._finished(max(one.stamp_ns for one in waiting)) if waiting else []

    def _finished(self, until_ns: int) -> list[tuple[T, list[Estimate]]]:
        """Return images until a stamp, and forget those that no other one needs."""
        images, begin = self._images, self._done
        later = (i for i in range(begin, len(images)) if images[i].stamp_ns > until_ns)
        end = next(later, len(images))
        found: list[tuple[T, list[Estimate]]] = [(one.image, []) for one in images[begin:end]]
        for person in range(len(images[-1].results)):
            # People who come later follow the others.
            of = [one for one in images if person < len(one.results)]
            first = len(images) - len(of)
            time_s = np.array([one.stamp_ns - images[0].stamp_ns for one in of]) / 1e9
            wanted = range(max(begin - first, 0), end - first)
            results = [one.results[person] for one in of]
            smooth = _smoothed(time_s, results, wanted, self._how)
            for i, estimate in zip(wanted, smooth, strict=True):
                found[first + i - begin][1].append(estimate)
        oldest_ns = images[end - 1].stamp_ns - round(1e9 * self._around_s)
        kept = next(i for i, one in enumerate(images) if one.stamp_ns >= oldest_ns)
        self._images, self._done = images[kept:], end - kept
        return found


def _values(estimate: Estimate) -> FloatArray:
    """Return the values (60,) of an estimate; nan where they are not known."""
    found = np.full(len(_OF), np.nan)
    if estimate.offset_stddev_m is None or estimate.posture_stddev is None:
        return found
    state = estimate.placed_posture
    limbs = [np.concatenate(arm_directions(state[arm], side)) for arm, side in _SIDES]
    found[: _LIMBS.stop] = np.concatenate([state[_PLACES], state[TURNS], *limbs])
    stddev = np.concatenate([estimate.posture_stddev, estimate.offset_stddev_m])
    found[_STDDEVS] = np.log(np.maximum(stddev, 1e-6))
    found[_FOLLOWED] = estimate.joints[0, _FOLLOWING]
    if estimate.legs is not None:
        found[_LEG_POINTS] = estimate.legs.points_m.ravel()
    return found


def _smoothed(
    time_s: FloatArray, results: Sequence[_Result], wanted: range, how: Smoothing
) -> Iterator[Estimate]:
    """Yield the ``wanted`` ones of the estimates of one person at times (n,)."""
    values = np.array([result.values for result in results])
    yaw = 3 + YAW - TURNS.start
    is_seen = np.isfinite(values[:, yaw])
    values[is_seen, yaw] = np.unwrap(values[is_seen, yaw])
    last = np.nan
    begins = [0]
    for i, (before, result) in enumerate(pairwise(results), 1):
        last = values[i - 1, yaw] if is_seen[i - 1] else last
        is_other = result.body is not before.body or abs(values[i, yaw] - last) > _TURN_RAD
        if is_other or not time_s[i] > time_s[i - 1]:
            begins.append(i)
            last = np.nan
    for begin, end in pairwise([*begins, len(results)]):
        part = slice(begin, end)
        of = range(max(begin, wanted.start), min(end, wanted.stop))
        estimates = {i: results[i].estimate for i in of}
        if end - begin > 2:
            filled = dict(_filled(time_s, results, np.flatnonzero(is_seen[part]) + begin, how))
            known = {i: filled.get(i, results[i]) for i in of if is_seen[i] or i in filled}
            smooth = spline(time_s[part], values[part], how.has_rates)
            for i, one in known.items():
                estimates[i] = _estimate(one, smooth, i - begin)
            if how.has_rates and known:
                rates = _rates([*known.values()], smooth, np.array([*known]) - begin)
                for i, found in zip(known, rates, strict=True):
                    estimates[i] = replace(estimates[i], rates=found)
        yield from estimates.values()


def _filled(
    time_s: FloatArray, results: Sequence[_Result], seen: NDArray[np.intp], how: Smoothing
) -> Iterator[tuple[int, _Result]]:
    """Yield the images of short gaps between those that are ``seen``, with the result before."""
    for first, last in pairwise(seen.tolist()):
        if not 0.0 < time_s[last] - time_s[first] <= how.longest_gap_s + 1e-6:
            continue
        for i in range(first + 1, last):
            before, after = results[first].estimate, results[last].estimate
            states = before.keypoint_states and tuple(
                one if one == KeypointState.HIDDEN else KeypointState.UNCERTAIN
                for one in before.keypoint_states
            )
            chances = before.keypoint_chances
            if chances is not None and after.keypoint_chances is not None:
                chances = np.maximum(chances, after.keypoint_chances)
            unknown = dict.fromkeys(("cost_px", "iou", "evidence", "hands"))
            given = {"state": FILLED, "keypoint_states": states, "keypoint_chances": chances}
            whose = {"person": results[i].estimate.person, "reason": ""}
            filled = replace(before, **unknown, **given, **whose)
            yield i, results[first]._replace(estimate=filled)


def spline(time_s: FloatArray, values: FloatArray, has_rates: bool = False) -> Spline:
    """Return smooth values of values (n, 60) at n > 2 rising times; rates if they are wanted.

    The bending is that of Green & Silverman, "Nonparametric Regression and Generalized Linear
    Models", 1994, equation (2.3).
    """
    steps_s, i = np.diff(time_s), np.arange(len(time_s) - 2)
    q, r = np.zeros((len(time_s), len(i))), np.diag((steps_s[:-1] + steps_s[1:]) / 3.0)
    q[i, i], q[i + 2, i] = 1.0 / steps_s[:-1], 1.0 / steps_s[1:]
    q[i + 1, i] = -q[i, i] - q[i + 2, i]
    r[i[1:], i[:-1]] = r[i[:-1], i[1:]] = steps_s[1:-1] / 6.0
    curves, eye = np.linalg.solve(r, q.T), np.eye(len(time_s))
    # An image beside a gap does not count for all of it.
    around_s = np.minimum(np.gradient(time_s), 2.0 * np.median(steps_s))
    usual = (np.isfinite(values[:, _BEGINS]) * around_s[:, None]).T
    known = np.nan_to_num(values).T
    # The values by group, filled up with zeros.
    own = np.zeros((len(_COUNTS), len(time_s), _COUNTS.max()))
    for group, (first, count) in enumerate(zip(_BEGINS, _COUNTS, strict=True)):
        own[group, :, :count] = known[first : first + count].T

    def precision(cutoff_hz: float, weights: FloatArray) -> FloatArray:
        bending = (2.0 * np.pi * cutoff_hz) ** -4 * (q @ curves) + 1e-9 * eye
        return np.asarray(bending + weights[..., None] * eye)

    def fitted(cutoff_hz: float, groups: slice) -> tuple[FloatArray, FloatArray]:
        """Return the weights (k, n) of groups after some rounds, and squares of errors (k, n)."""
        seen, weights = own[groups], usual[groups]
        for _ in range(_ROUNDS):
            smooth = np.linalg.solve(precision(cutoff_hz, weights), weights[..., None] * seen)
            squares = np.sum((seen - smooth) ** 2, axis=2)
            errors = squares * (_RATE_HZ * around_s) / _NOISE**2
            freedom = _FREEDOM + _COUNTS[groups, None]
            weights = usual[groups] * freedom / (_FREEDOM + errors)
        return weights, squares

    limbs = own[_LIMB_GROUPS, :, :3]
    weights = fitted(_CUTOFFS_HZ[-1], _LIMB_GROUPS)[0]

    def misfit(cutoff_hz: float) -> float:
        """Return -2 times the logarithm of the likelihood of the limbs, less a constant."""
        inverted, weighted = precision(cutoff_hz, weights), weights[..., None] * limbs
        fit = np.sum(weighted * (limbs - np.linalg.solve(inverted, weighted))) * _RATE_HZ
        spread = np.linalg.slogdet(inverted)[1].sum() + 16.0 * len(i) * np.log(cutoff_hz)
        return float(fit / _NOISE**2 + 3.0 * spread)

    cutoff_hz = float(min(_CUTOFFS_HZ, key=misfit))
    used, squares = fitted(cutoff_hz, slice(None))
    inverse = np.linalg.inv(precision(cutoff_hz, used))
    smooth = np.einsum("kij,kj->ki", inverse[_OF], used[_OF] * known)
    variance = _NOISE**2 / _RATE_HZ * np.diagonal(inverse, axis1=1, axis2=2)
    found = Spline(smooth.T, np.sqrt(variance).T, cutoff_hz)
    if not has_rates:
        return found
    # Second and first derivatives are linear in the smooth values.
    second = np.pad(curves, ((1, 1), (0, 0)))
    third = steps_s[:, None] / 6.0
    first = np.diff(eye, axis=0) / steps_s[:, None]
    ahead = first[:1] - third[:1] * (2.0 * second[:1] + second[1:2])
    first = np.vstack([ahead, first + third * (second[:-1] + 2.0 * second[1:])])
    # What changes from image to image shows in the residuals.
    free = _COUNTS * (np.sum(used > 0.0, axis=1) - np.einsum("kii,ki->k", inverse, used))
    scale = np.sum(usual * squares, axis=1) + _PRIOR * _NOISE**2 / _RATE_HZ
    scale /= _PRIOR + free
    # The speed of the process at an image, given its places there.
    between = (2.0 * np.pi * cutoff_hz) ** 4 * around_s / np.sqrt(48.0)
    variances = [np.sum((one @ inverse) * one, axis=2) for one in (first, second)]
    deviations = [np.sqrt(scale[:, None] * of).T for of in (variances[0] + between, variances[1])]
    own = smooth[: len(_OWN)].T
    rates = np.array([first @ own, deviations[0][:, _OWN], second @ own, deviations[1][:, _OWN]])
    # The spline is straight at its ends, which shows for the time in which its memory fades.
    from_end_s = np.minimum(time_s - time_s[0], time_s[-1] - time_s)
    rates[:, from_end_s * (2.0 * np.pi * cutoff_hz) < 1.0] = np.nan
    return found._replace(rates=rates)


def _states(values: FloatArray) -> FloatArray:
    """Return postures with places (n, 14) of the first 18 values, (n, 18)."""
    state = np.empty((len(values), PLACE.stop))
    state[:, _PLACES], state[:, TURNS] = values[:, :3], values[:, 3:6]
    limbs = values[:, _LIMBS].reshape(-1, 2, 2, 3)
    limbs = limbs / np.linalg.norm(limbs, axis=3, keepdims=True)
    for i, (arm, side) in enumerate(_SIDES):
        state[:, arm] = angles_of_arms(limbs[:, i].reshape(-1, 6), side, ARM_LIMITS)
    return state


def _estimate(result: _Result, smooth: Spline, image: int) -> Estimate:
    """Return the estimate of an image of a spline."""
    estimate, body = result.estimate, result.body
    values, stddev = smooth.values[image], smooth.stddev[image, _OF]
    state = _states(values[None, _PLACED])[0]
    before = estimate.placed_posture
    state[YAW] += 2.0 * np.pi * np.round((before[YAW] - state[YAW]) / (2.0 * np.pi))
    deviations = np.hypot(np.exp(values[_STDDEVS]), stddev[_STDDEVS])
    posture, posture_stddev = state[:N_JOINTS], deviations[:N_JOINTS]
    pitch_rad = body.camera_pose.pitch_rad
    rises = clavicles(body, posture, posture_stddev)
    # Only in a gap are neck and legs less sure than they were read.
    more, legs, neck_stddev = stddev * (estimate.state == FILLED), estimate.legs, None
    if estimate.neck_stddev is not None:
        neck_stddev = np.hypot(estimate.neck_stddev, more[_NECK])
    if legs is not None:
        legs = legs._replace(
            angles=values[_LEGS],
            angles_stddev=np.hypot(legs.angles_stddev, more[_LEGS]),
            points_m=values[_LEG_POINTS].reshape(-1, 3),
            points_stddev_m=np.hypot(legs.points_stddev_m, more[_LEGS.start]),
        )
    return replace(
        estimate,
        posture=posture,
        posture_stddev=posture_stddev,
        offset_m=state[PLACE],
        offset_stddev_m=deviations[PLACE],
        keypoints_m=pose(body, state, pitch_rad).keypoints_m,
        clavicles_m=rises[0],
        clavicles_stddev_m=rises[1],
        neck=None if estimate.neck is None else values[_NECK],
        neck_stddev=neck_stddev,
        legs=legs,
        smoothed_hz=smooth.cutoff_hz,
    )


def _rates(results: Sequence[_Result], smooth: Spline, images: NDArray[np.intp]) -> FloatArray:
    """Return :attr:`.Estimate.rates` (m, 4, n) of images (m,) of a spline.

    An error of a direction that lasts turns the velocity by as much, so it adds to the deviation
    its share of velocity and acceleration; one of the distance scales those of the place.
    """
    assert smooth.rates is not None
    body, values, rates = results[0].body, smooth.values[images], smooth.rates[:, images].copy()
    lasting = np.exp(values[:, _STDDEVS])
    share = np.empty((len(images), len(_LASTING)))
    for group, columns in enumerate(_LASTING):
        share[:, group] = lasting[:, columns].min(axis=1)
    share[:, 0] /= body.placement.distance_m
    for begin, size, error in zip(_BEGINS, _COUNTS, share.T, strict=False):
        of = slice(begin, begin + size)
        for velocity, stddev in (rates[:2], rates[2:]):
            moved = error * np.linalg.norm(velocity[:, of], axis=1)
            stddev[:, of] = np.hypot(stddev[:, of], moved[:, None])

    def place(values: FloatArray) -> FloatArray:
        states = _states(values)
        posed = pose(body, states, body.camera_pose.pitch_rad)
        return np.hstack([states, posed.clavicles_m, posed.keypoints_m.reshape(len(states), -1)])

    moved = carried(place, values[:, _PLACED], rates[..., _PLACED], _ARE_ANGLES)
    found = np.full((4, len(images), len(STATE_NAMES) + 3 * len(KEYPOINT_NAMES)), np.nan)
    found[..., _MOVED], found[..., len(STATE_NAMES) :] = np.split(moved, [len(_MOVED)], axis=2)
    read = np.array([result.values[_FOLLOWED] for result in results])
    found[..., _FOLLOWING] = np.where(np.isnan(read), np.nan, rates[..., _FOLLOWED])
    found[:, np.isnan(rates[0, :, 0])] = np.nan
    return found.transpose(1, 0, 2)
