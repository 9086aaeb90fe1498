"""Results of recordings, each by the images before and after it.

An error of a joint has a part that lasts and a part that changes from image to image. The
fixed-interval smoother for a motion whose acceleration is white noise, whose backward pass gives
the same as the equation below, takes the second part away. It is the cubic smoothing spline (Kohn &
Ansley, "A new algorithm for spline smoothing based on smoothing a stochastic process", 1987): the x
with the least

    sum of w_k (z_k - x(t_k))^2 + (2 pi f)^-4 integral of x''^2,

which is a low-pass of fourth order without delay: a motion of the frequency f keeps half of its
amplitude. The weight w of an image is the time around it, times (v + n) / (v + e^2) of an error e,
in deviations, of its n values: the errors have Student's distribution with v degrees of freedom,
whose estimate are repeated least squares (Lange, Little & Taylor, "Robust statistical modeling
using the t distribution", 1989). So an arm that a few images show at another depth stays. What is
smoothed are directions of limbs, since angles of a straight arm jump.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Generic, NamedTuple, TypeVar

import numpy as np

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
from cardbox_tracker.person.skeleton import arm_directions
from cardbox_tracker.search.arm_search import ARM_LIMITS
from cardbox_tracker.tracking.estimate import Estimate

T = TypeVar("T")

LAG_S = 0.5
"""Seconds on either side of an image that count; others change it by less than 1 mm."""

# Lower ones take from the fast motion of arms (docs/research.md).
_CUTOFF_HZ = 4.0
# Deviation of the part that changes, m or rad, in images of this rate.
_NOISE, _RATE_HZ = 0.05, 30.0
_FREEDOM, _ROUNDS = 4.0, 8
# Nobody turns as far between two images: the tracker has found that it was wrong.
_TURN_RAD = 0.5 * np.pi
_PLACES = [TORSO_Y, TORSO_X, TORSO_Z]
_SIDES = (LEFT_ARM, 1.0), (RIGHT_ARM, -1.0)
# Values that are smoothed with one weight: place, turns of the trunk, four limbs, neck, legs. The
# logarithms of deviations and the points of the legs go with them.
_OWN = np.repeat(np.arange(8), (3, 3, 3, 3, 3, 3, 2, 8))
_WITH = np.concatenate([[0, 1, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 0, 0], [7] * 18])
_OF = np.concatenate([_OWN, _WITH])
_LIMBS, _NECK, _LEGS = slice(6, 18), slice(18, 20), slice(20, 28)
_STDDEVS, _LEG_POINTS = slice(28, 42), slice(42, 60)


class _Result(NamedTuple):
    """The result of one person in one image."""

    estimate: Estimate
    body: BodyModel
    values: FloatArray  #: (60,), nan where they are not known


class _Image(NamedTuple, Generic[T]):
    image: T
    stamp_ns: int
    results: list[_Result]  #: by person


class Smoother(Generic[T]):
    """Smooths the estimates of images, in order of time, of one person or several.

    Estimates without a place, as those of the preset ``paper``, stay as they are, and so do states
    and chances.
    """

    def __init__(self, lag_s: float = LAG_S, every_s: float = LAG_S) -> None:
        """Wait ``lag_s`` for the images after one, and smooth those of ``every_s`` at once.

        Without a lag, each estimate is returned as it is.
        """
        self._lag_s, self._every_s = lag_s, every_s
        self._images: list[_Image[T]] = []
        self._done = 0

    def add(
        self, image: T, stamp_ns: int, estimates: Sequence[Estimate], bodies: Iterable[BodyModel]
    ) -> list[tuple[T, list[Estimate]]]:
        """Take an image and its estimates by person; return images that are finished likewise."""
        if not self._lag_s:
            return [(image, list(estimates))]
        pairs = zip(estimates, bodies, strict=True)
        results = [_Result(estimate, body, _values(estimate)) for estimate, body in pairs]
        self._images.append(_Image(image, stamp_ns, results))
        waiting_s = (stamp_ns - self._images[self._done].stamp_ns) / 1e9
        if waiting_s < self._lag_s + self._every_s:
            return []
        return self._finished(stamp_ns - round(1e9 * self._lag_s))

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
            smooth = _smoothed(time_s, [one.results[person] for one in of], wanted)
            for i, estimate in zip(wanted, smooth, strict=True):
                found[first + i - begin][1].append(estimate)
        oldest_ns = images[end - 1].stamp_ns - round(1e9 * LAG_S)
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
    if estimate.neck is not None:
        found[_NECK] = estimate.neck
    if estimate.legs is not None:
        found[_LEGS] = estimate.legs.angles
        found[_LEG_POINTS] = estimate.legs.points_m.ravel()
    return found


def _smoothed(time_s: FloatArray, results: Sequence[_Result], wanted: range) -> Iterator[Estimate]:
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
        smooth, stddev = spline(time_s[part], values[part]) if end - begin > 2 else (None, None)
        for i in range(max(begin, wanted.start), min(end, wanted.stop)):
            if smooth is None or stddev is None or not is_seen[i]:
                yield results[i].estimate
            else:
                yield _estimate(results[i], smooth[i - begin], stddev[i - begin])


def spline(time_s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return smooth values (n, 60) at n > 2 rising times, and the deviations (n, 8) of groups.

    The bending is that of Green & Silverman, "Nonparametric Regression and Generalized Linear
    Models", 1994, equation (2.3).
    """
    steps_s, i = np.diff(time_s), np.arange(len(time_s) - 2)
    q, r = np.zeros((len(time_s), len(i))), np.diag((steps_s[:-1] + steps_s[1:]) / 3.0)
    q[i, i], q[i + 2, i] = 1.0 / steps_s[:-1], 1.0 / steps_s[1:]
    q[i + 1, i] = -q[i, i] - q[i + 2, i]
    r[i[1:], i[:-1]] = r[i[:-1], i[1:]] = steps_s[1:-1] / 6.0
    bending = (2.0 * np.pi * _CUTOFF_HZ) ** -4 * (q @ np.linalg.solve(r, q.T))
    eye = np.eye(len(time_s))
    bending += 1e-9 * eye
    # An image beside a gap does not count for all of it.
    around_s = np.minimum(np.gradient(time_s), 2.0 * np.median(steps_s))
    begins, counts = np.unique(_OWN, return_index=True, return_counts=True)[1:]
    usual = (np.isfinite(values[:, begins]) * around_s[:, None]).T
    known, weights = np.nan_to_num(values).T, usual
    for _ in range(_ROUNDS):
        inverse = np.linalg.inv(bending + weights[:, None] * eye)
        smooth = np.einsum("kij,kj,kj->ki", inverse[_OF], weights[_OF], known)
        squares = np.add.reduceat((known - smooth)[: len(_OWN)] ** 2, begins)
        errors = squares * (_RATE_HZ * around_s) / _NOISE**2
        weights = usual * (_FREEDOM + counts[:, None]) / (_FREEDOM + errors)
    variance = _NOISE**2 / _RATE_HZ * np.diagonal(inverse, axis1=1, axis2=2)
    return smooth.T, np.sqrt(variance).T


def _estimate(result: _Result, values: FloatArray, stddev: FloatArray) -> Estimate:
    """Return the estimate of smoothed values (60,) with deviations (8,) of their groups."""
    estimate, body = result.estimate, result.body
    state = np.empty(PLACE.stop)
    state[_PLACES], state[TURNS] = values[:3], values[3:6]
    before = estimate.placed_posture
    state[YAW] += 2.0 * np.pi * np.round((before[YAW] - state[YAW]) / (2.0 * np.pi))
    limbs = values[_LIMBS].reshape(2, 2, 3)
    limbs = limbs / np.linalg.norm(limbs, axis=2, keepdims=True)
    for (arm, side), limb in zip(_SIDES, limbs, strict=True):
        state[arm] = angles_of_arms(limb.reshape(1, 6), side, ARM_LIMITS)[0]
    deviations = np.hypot(np.exp(values[_STDDEVS]), stddev[_WITH[: PLACE.stop]])
    posture, posture_stddev = state[:N_JOINTS], deviations[:N_JOINTS]
    pitch_rad = body.camera_pose.pitch_rad
    rises = clavicles(body, posture, posture_stddev)
    legs = estimate.legs
    if legs is not None:
        points_m = values[_LEG_POINTS].reshape(-1, 3)
        legs = legs._replace(angles=values[_LEGS], points_m=points_m)
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
        legs=legs,
        smoothed_hz=_CUTOFF_HZ,
    )
