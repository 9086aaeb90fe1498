"""Times and poses of several films of the same people, from the points of these people.

Joints move up and down alike before all cameras that stand about level. So the correlation of
vertical speeds in the images, summed over joints, shows how much later a film begins, and who of
one film is who in another.

Times and poses then follow from one robust least-squares problem, a bundle adjustment (Triggs et
al., "Bundle adjustment - a modern synthesis", 2000). Its unknowns are rotation, translation and
offset of each further film, the logarithms of the lengths of each person's bones, and the points in
each image, which are eliminated. The priors of the lengths are the proportions of people of the
stature, which give the scale. Residuals are distances between rays and points, and differences of
bones in each image from their lengths. If points were only triangulated, noise of their depth would
draw cameras apart, where it is less.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import NEAREST_M, Camera
from cardbox_tracker.camera.extrinsics import Extrinsics, angle_of
from cardbox_tracker.common.errors import CameraError
from cardbox_tracker.common.least_squares import (
    DIFFERENCE,
    Residuals,
    Solution,
    geman_mcclure,
    minimize,
    rules_of,
)
from cardbox_tracker.detectors.identity import OTHER, cheapest
from cardbox_tracker.detectors.image_points import (
    CERTAIN,
    LEG_POINT_NAMES,
    POINT_NAMES,
    ImagePoints,
    LegPoints,
)
from cardbox_tracker.measuring.people_camera import Sightings, is_inside
from cardbox_tracker.person.proportions import (
    HIP_SHARE,
    LENGTH_SHARES,
    MARKED_HEIGHTS,
    USUAL_STATURE_M,
    WRIST_SHARE,
)
from cardbox_tracker.person.sizes import FloatArray

BoolArray = NDArray[np.bool_]
Who = tuple[int | None, ...]
"""For each person of the first film, the number of the same one in another film."""

LEAST_IMAGES = 20
"""Number of images of a person from which on two films overlap."""

_NAMES = (*POINT_NAMES, *LEG_POINT_NAMES)
_OTHER_SIDE = [
    _NAMES.index(one.replace("left", "right") if "left" in one else one.replace("right", "left"))
    for one in _NAMES
]
_SHOULDER, _HIP, _KNEE, _ANKLE = MARKED_HEIGHTS[2:].tolist()
# Lengths between points as shares of the stature, with relative deviations among people: limbs of
# either side, then breadths.
_LIMBS = {
    ("shoulder", "elbow"): (LENGTH_SHARES["upper_arm_length"], 0.06),
    ("elbow", "wrist"): (WRIST_SHARE * LENGTH_SHARES["forearm_length"], 0.06),
    ("shoulder", "hip"): (_SHOULDER - _HIP, 0.06),
    ("hip", "knee"): (_HIP - _KNEE, 0.06),
    ("knee", "ankle"): (_KNEE - _ANKLE, 0.06),
}
_BREADTHS = {
    "shoulder": (LENGTH_SHARES["shoulder_breadth"], 0.10),
    "hip": (2.0 * HIP_SHARE, 0.15),
}
_PRIORS = np.array([*_LIMBS.values(), *_BREADTHS.values()])
# Speeds are of points smoothed over this time, s, and count to this many deviations.
_SMOOTH_S, _MOST_SPEED = 0.07, 3.0
# Movements of arms, legs and trunk that are independent.
_MOVING = 4.0
# How far the offset may be from that of the speeds, s; how surely speeds agree there, in what
# chance gives, and from where on nobody needs to look.
_WITHIN_S, _SURE, _CLEAR = 0.1, 1.2, 1.6
# Images of each person that count, and the time in which people keep posture and errors, s.
_MOST_IMAGES, _COARSE_IMAGES, _SAME_S = 60, 15, 0.5
# Deviations of points, and of bones in an image, statures. Joints on the far side of the body,
# which it hides, are this many times less sure.
_POINT, _BONE, _HIDDEN = 0.008, 0.01, 10.0
_FACE, _EARS = slice(0, 3), slice(3, 5)
# How much further than its partner of the other side a joint is if the body hides it, m.
_FAR_SIDE_M = 0.25
# Yaws beside that of the points in space from which fits start, rad.
_STARTS = np.radians((0.0, -25.0, 25.0))
_FIT_ENDS = 25, 1e-5
# Steps to the points of an image, and the inverse variance, 1/m^2, that keeps those not seen.
_INNER, _LOOSE = 4, 1e-6
_TURN, _MOVE, _OFFSET = slice(0, 3), slice(3, 6), 6
_OF_CAMERA = _OFFSET + 1
# Deviation of what is given.
_GIVEN = 1e-4


class Seen:
    """One person in a film.

    Attributes:
        times_s: times of the n images, at least 2, (n,).
        rays: of the points, (n, 25, 2), at the depth 1; 0 if unknown.
        sure: how sure each point is, (n, 25), 0 to 1; 0 if unknown.
        spatial_m: the points in space as the detector estimates them, (n, 25, 3), or nan.
        period_s: usual time between images.
    """

    def __init__(self, sightings: Sightings, camera: Camera) -> None:
        """Take times, s, and points at the resolution of ``camera``."""
        rows = [_all_points(points) for _, points in sightings]
        px, scores, self.spatial_m = (np.array(one) for one in zip(*rows, strict=True))
        self.times_s = np.array([time_s for time_s, _ in sightings])
        known = (scores >= CERTAIN) & is_inside(px, camera)
        self.rays = np.where(known[..., None], camera.rays(px)[..., :2], 0.0)
        is_exchanged = _are_exchanged(self.rays, known)
        for values in (self.rays, known, self.spatial_m):
            values[is_exchanged] = values[is_exchanged][:, _OTHER_SIDE]
        behind_m = self.spatial_m[..., 2] - self.spatial_m[:, _OTHER_SIDE, 2]
        # The head hides the face of who looks away.
        away_m = self.spatial_m[:, _FACE, 2] - self.spatial_m[:, _EARS, 2].mean(axis=1)[:, None]
        behind_m[:, _FACE] = np.fmax(behind_m[:, _FACE], away_m)
        hidden = np.clip(np.nan_to_num(behind_m) / _FAR_SIDE_M, 0.0, 1.0)
        self.sure = known / (1.0 + (_HIDDEN - 1.0) * hidden)
        self.period_s = float(np.median(np.diff(self.times_s)))

    def at(self, times_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return rays (m, 25, 2) at m times, between images, and how sure they are, (m, 25)."""
        after = np.clip(np.searchsorted(self.times_s, times_s), 1, len(self.times_s) - 1)
        step_s = self.times_s[after] - self.times_s[after - 1]
        share = (times_s - self.times_s[after - 1]) / step_s
        is_between = (share >= 0.0) & (share <= 1.0) & (step_s <= 2.5 * self.period_s)
        sure = np.minimum(self.sure[after - 1], self.sure[after]) * is_between[:, None]
        part = share[:, None, None]
        return (1.0 - part) * self.rays[after - 1] + part * self.rays[after], sure

    def speeds(self, step_s: float) -> tuple[FloatArray, FloatArray]:
        """Return vertical speeds (m, 25), in deviations, every ``step_s``, and 1 where known."""
        rays, sure = self.at(np.arange(self.times_s[0], self.times_s[-1], step_s))
        known, width = sure > 0.0, max(_SMOOTH_S / step_s, 0.5)
        down = (1, 2 * round(4.0 * width) + 1), 1.0
        smooth, weight = (
            cv2.GaussianBlur(values, *down, sigmaY=width, borderType=cv2.BORDER_CONSTANT)
            for values in (np.where(known, rays[..., 1], 0.0), known.astype(np.float64))
        )
        speeds = np.diff(smooth / np.maximum(weight, 1e-6), axis=0)
        known = known[1:] & known[:-1]
        count = np.maximum(known.sum(axis=0), 1)
        speeds = np.where(known, speeds - np.where(known, speeds, 0.0).sum(axis=0) / count, 0.0)
        deviation = np.sqrt((speeds**2).sum(axis=0) / count)
        speeds = np.clip(speeds / np.maximum(deviation, 1e-9), -_MOST_SPEED, _MOST_SPEED)
        return speeds, known.astype(np.float64)


def _are_exchanged(rays: FloatArray, known: BoolArray) -> BoolArray:
    """Return in which of n images a detector takes left for right, unlike in most of them, (n,)."""
    is_exchanged, last, ever = np.zeros(len(rays), np.bool_), rays[0].copy(), known[0].copy()
    for number, (now, seen) in enumerate(zip(rays, known, strict=True)):
        both = seen & seen[_OTHER_SIDE] & ever
        moved = [np.linalg.norm(one - last, axis=1)[both].sum() for one in (now, now[_OTHER_SIDE])]
        is_exchanged[number] = moved[1] < moved[0]
        if is_exchanged[number]:
            now, seen = now[_OTHER_SIDE], seen[_OTHER_SIDE]
        last, ever = np.where(seen[:, None], now, last), ever | seen
    return is_exchanged ^ bool(is_exchanged.mean() > 0.5)


def _all_points(points: ImagePoints) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return pixels (25, 2), scores (25,) and places (25, 3) of body and legs."""
    count = len(LEG_POINT_NAMES)
    legs = points.legs or LegPoints(np.full((count, 2), np.nan), np.zeros(count))
    places = [
        np.full((len(one.px), 3), np.nan) if one.spatial_m is None else one.spatial_m
        for one in (points, legs)
    ]
    scores = np.append(points.scores, legs.scores)
    return np.vstack([points.px, legs.px]), scores, np.vstack(places)


class Film(NamedTuple):
    """A film, and what is given of it."""

    name: str  #: for texts
    people: Sequence[Seen]  #: each person in it
    offset_s: float | None = None  #: time of the first film at which it begins, s, if it is given
    extrinsics: Extrinsics | None = None  #: its pose relative to the first film, if it is given


@dataclass(frozen=True)
class FilmCamera:
    """Time and pose of a further film against the first one.

    Attributes:
        extrinsics: its pose.
        offset_s: time of the first film at which it begins, s.
        offset_stddev_s: standard deviation of the offset.
        turn_stddev_rad: standard deviation of the rotation about any axis.
        place_stddev_m: standard deviation of the place, along the axis where it is largest.
        halves: angle, rad, and distance, m, between the poses by the two halves of the time.
        is_clear: whether the offset is given, or surely none of chance.
    """

    extrinsics: Extrinsics
    offset_s: float
    offset_stddev_s: float
    turn_stddev_rad: float
    place_stddev_m: float
    halves: tuple[float, float]
    is_clear: bool

    @property
    def is_doubtful(self) -> bool:
        """Whether the two halves differ by more than the deviations tell."""
        # Each half has twice the variance, and so has a difference.
        angle_rad, away_m = self.halves
        return angle_rad > 6.0 * self.turn_stddev_rad or away_m > 6.0 * self.place_stddev_m

    def __str__(self) -> str:
        turn_deg, place_m = math.degrees(self.turn_stddev_rad), self.place_stddev_m
        angle_rad, away_m = self.halves
        distance_m = float(np.linalg.norm(self.extrinsics.centre_m))
        turned_deg = math.degrees(angle_of(self.extrinsics.rotation))
        return (
            f"begins at {self.offset_s:.3f} +- {self.offset_stddev_s:.3f} s, stands "
            f"{distance_m:.2f} +- {place_m:.2f} m away and is turned by "
            f"{turned_deg:.1f} +- {turn_deg:.1f} degrees; by two halves of the time "
            f"{math.degrees(angle_rad):.1f} degrees and {away_m:.2f} m apart"
        )


def film_cameras(films: Sequence[Film], statures_m: Sequence[float]) -> list[FilmCamera]:
    """Return times and poses of all films but the first.

    Args:
        films: the films, the first one first.
        statures_m: statures of the people of the first film, or one for all.

    Raises:
        CameraError: a film does not overlap with the first one, or shows other people.
    """
    first = films[0]
    tall_m = [statures_m[min(k, len(statures_m) - 1)] for k in range(len(first.people))]
    alone = [_alone(first, film, tall_m) for film in films[1:]]
    fixed = np.array([_is_given(film) for film in films[1:]])
    rows = np.array([one.unknowns for one in alone])
    moments = _moments(
        films, [one.who for one in alone], rows[:, _OFFSET].tolist(), tall_m, _MOST_IMAGES
    )
    fit = _Fit(moments, fixed, np.array([one.offsets_s for one in alone]).T)
    whole, solution = fit.run(rows.ravel())
    covariance = np.linalg.inv(solution.information[0])
    halves = [fit.half(k).run(whole)[0] for k in range(2)]
    return [
        _camera(
            film.name,
            [values[_of(k)] for values in (whole, *halves)],
            covariance[_of(k), _of(k)],
            one.is_clear,
        )
        for k, (film, one) in enumerate(zip(films[1:], alone, strict=True))
    ]


def _of(number: int) -> slice:
    return slice(_OF_CAMERA * number, _OF_CAMERA * (number + 1))


def _is_given(film: Film) -> BoolArray:
    given = np.repeat(film.extrinsics is not None, _OF_CAMERA)
    given[_OFFSET] = film.offset_s is not None
    return given


def _camera(
    name: str, rows: Sequence[FloatArray], covariance: FloatArray, is_clear: bool
) -> FilmCamera:
    """Return a film's camera by its unknowns (7,) of the whole time and of both halves."""
    poses = [Extrinsics.of_vectors(row[_TURN], row[_MOVE], name) for row in rows]
    turn, place = (
        math.sqrt(float(np.linalg.eigvalsh(covariance[at, at])[-1])) for at in (_TURN, _MOVE)
    )
    return FilmCamera(
        poses[0],
        float(rows[0][_OFFSET]),
        math.sqrt(float(covariance[_OFFSET, _OFFSET])),
        turn,
        place,
        poses[1].difference(poses[2]),
        is_clear,
    )


class _Alone(NamedTuple):
    """One film beside the first one.

    Attributes:
        unknowns: (7,).
        offsets_s: limits of its offset, s.
        who: who is who.
        is_clear: whether the offset is surely none of chance.
    """

    unknowns: FloatArray
    offsets_s: tuple[float, float]
    who: Who
    is_clear: bool


def _alone(first: Film, film: Film, tall_m: Sequence[float]) -> _Alone:
    found = _offset(first, film)
    starts = [] if found is None else [*_starts(first, film, found.who, found.offset_s, tall_m)]
    if found is None or not starts:
        given = "give --offset if it is known" if film.offset_s is None else "check --offset"
        raise CameraError(
            f"{film.name} and {first.name} do not show the same people at one time, or not for "
            f"long enough: expected films of one scene that overlap by {LEAST_IMAGES} images with "
            f"a person in both; {given}, or track each film alone"
        )
    moments = _moments((first, film), (found.who,), (found.offset_s,), tall_m, _COARSE_IMAGES)
    limits = found.offset_s - found.within_s, found.offset_s + found.within_s
    fit = _Fit(moments, _is_given(film)[None], np.array(limits)[:, None])
    values, _ = min(map(fit.run, starts), key=lambda one: float(one[1].total[0]))
    return _Alone(values[:_OF_CAMERA], limits, found.who, found.is_clear)


def _lags(one: Seen, other: Seen, step_s: float) -> tuple[FloatArray, FloatArray]:
    """Return offsets of the other film, s, and how surely speeds agree there, in what chance gives.

    The largest of n independent correlations of chance is sqrt(2 ln n) deviations. What is
    independent follows from the autocorrelations of both (Bartlett, "On the theoretical
    specification and sampling properties of autocorrelated time-series", 1946).
    """
    (ours, ours_known), (theirs, theirs_known) = one.speeds(step_s), other.speeds(step_s)

    def summed(a: FloatArray, b: FloatArray) -> FloatArray:
        """Return the sum of the correlations of the columns, from the lag 1 - len(b) on."""
        size = len(a) + len(b) - 1
        spectra = [np.fft.rfft(one, size, axis=0) for one in (a, b)]
        found = np.fft.irfft((spectra[0] * spectra[1].conj()).sum(axis=1), size)
        return np.roll(found, len(b) - 1)

    count = summed(ours_known, theirs_known)
    norm = summed(ours**2, theirs_known) * summed(ours_known, theirs**2)
    alike = summed(ours, theirs) / np.sqrt(np.maximum(norm, 1e-9))
    joints = max(1.0, float((ours_known.mean(axis=0) * theirs_known.mean(axis=0)).sum()))
    shared_s = np.maximum(count, 0.0) / joints * step_s
    is_long = shared_s >= LEAST_IMAGES * max(one.period_s, other.period_s)
    both = [summed(x, x) for x in (ours, theirs)]
    reach = min(len(ours), len(theirs)) - 1
    own = [one[len(one) // 2 :][: reach + 1] / max(one.max(), 1e-9) for one in both]
    same_s = step_s * max(1.0, 2.0 * float((own[0] * own[1]).sum()) - 1.0)
    chance = math.sqrt(2.0 * math.log(max(2.0, is_long.sum() * step_s / same_s)))
    sure = np.where(is_long, alike * np.sqrt(_MOVING * shared_s / same_s) / chance, 0.0)
    lags = (np.arange(len(count)) - (len(theirs) - 1)) * step_s
    return lags + one.times_s[0] - other.times_s[0], sure


class _Offset(NamedTuple):
    """The likeliest offset of a film."""

    offset_s: float
    within_s: float  #: how far off it may be
    who: Who
    is_clear: bool  #: whether it is given, or surely none of chance


def _offset(first: Film, film: Film) -> _Offset | None:
    """Return the likeliest offset of a film; None if speeds agree nowhere.

    Speeds of people whom one camera sees from behind and above agree best up to 0.1 s beside the
    true one.
    """
    periods_s = [one.period_s for one in (*first.people, *film.people)]
    step_s = max(periods_s, default=1.0) / 2.0
    curves = {
        (a, b): _lags(one, other, step_s)
        for a, one in enumerate(first.people)
        for b, other in enumerate(film.people)
    }
    is_given = film.offset_s is not None
    tried = [] if film.offset_s is None else [film.offset_s]
    for lags, sure in () if is_given else curves.values():
        peaks = 1 + np.flatnonzero((sure[1:-1] > sure[:-2]) & (sure[1:-1] >= sure[2:]))
        tried += lags[peaks[sure[peaks] > 0.0]].tolist()
    found, best = None, 0.0 if is_given else _SURE
    for offset_s in tried:
        gains = np.zeros((len(first.people), len(film.people)))
        for pair, (lags, sure) in curves.items():
            gains[pair] = max(0.0, np.interp(offset_s, lags, sure, 0.0, 0.0))
        pairs = sorted(cheapest(OTHER - gains).items(), key=lambda at: -gains[at])
        # Chance gives each of them its own.
        together = np.cumsum([gains[at] for at in pairs]) / np.sqrt(np.arange(1, len(pairs) + 1))
        if together.max(initial=0.0) > best:
            most = int(np.argmax(together))
            best = float(together[most])
            same = dict(pairs[: most + 1])
            who = tuple(same.get(a) for a in range(len(first.people)))
            within_s = 0.0 if is_given else max(step_s, _WITHIN_S)
            found = _Offset(offset_s, within_s, who, is_given or best > _CLEAR)
    return found


def _starts(
    first: Film, film: Film, who: Who, offset_s: float, tall_m: Sequence[float]
) -> Iterator[FloatArray]:
    """Yield unknowns (7,) to begin with, from the points in space, at several yaws."""
    if film.extrinsics is not None:
        turn = cv2.Rodrigues(film.extrinsics.rotation)[0][:, 0]
        yield np.array([*turn, *film.extrinsics.translation_m, offset_s])
        return
    centred, places = list[list[FloatArray]](), list[list[FloatArray]]()
    for number, other in enumerate(who):
        if other is None:
            continue
        one, two = first.people[number], film.people[other]
        for at, time_s in enumerate(one.times_s - offset_s):
            near = int(np.argmin(np.abs(two.times_s - time_s)))
            both = np.isfinite(one.spatial_m[at] + two.spatial_m[near]).all(axis=1)
            both &= (one.sure[at] > 0.0) & (two.sure[near] > 0.0)
            is_near = abs(two.times_s[near] - time_s) <= max(one.period_s, two.period_s)
            if is_near and both.sum() > 4:
                pair = [
                    (seen.spatial_m[k][both], seen.rays[k][both])
                    for seen, k in ((one, at), (two, near))
                ]
                centred.append([spatial_m - spatial_m.mean(axis=0) for spatial_m, _ in pair])
                places.append([_place(*each) * tall_m[number] / USUAL_STATURE_M for each in pair])
    if not centred:
        return
    a, b = np.concatenate(centred, axis=1)
    weights, turn = np.ones(len(a)), np.eye(3)
    for _ in range(10):
        u, _, v = np.linalg.svd((b * weights[:, None]).T @ a)
        turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
        weights = 1.0 / np.maximum(np.linalg.norm(b - a @ turn.T, axis=1), 0.02)
    here_m, there_m = np.median(np.array(places), axis=0)
    for yaw_rad in _STARTS:
        turned = cv2.Rodrigues(np.array([0.0, yaw_rad, 0.0]))[0] @ turn
        yield np.array([*cv2.Rodrigues(turned)[0][:, 0], *(there_m - turned @ here_m), offset_s])


def _place(spatial_m: FloatArray, rays: FloatArray) -> FloatArray:
    """Return where points are whose extent in space and in the image is known, (3,), metres."""
    middle = rays.mean(axis=0)
    extent = np.linalg.norm(spatial_m[:, :2] - spatial_m[:, :2].mean(axis=0))
    place: FloatArray = extent / np.linalg.norm(rays - middle) * np.append(middle, 1.0)
    return place


class _Moments(NamedTuple):
    """Images of one person of the first film.

    Attributes:
        times_s: times in the first film, (m,).
        seen: the same person in each film; None where nobody is.
        weight: how many images one counts for.
        stature_m: of the person.
    """

    times_s: FloatArray
    seen: Sequence[Seen | None]
    weight: float
    stature_m: float


def _moments(
    films: Sequence[Film],
    who: Sequence[Who],
    offsets_s: Sequence[float],
    tall_m: Sequence[float],
    most: int,
) -> list[_Moments]:
    """Return images of the people who are in at least two films.

    ``who`` and ``offsets_s`` are of all films but the first.
    """
    found = []
    for number, one in enumerate(films[0].people):
        seen: list[Seen | None] = [one]
        is_shared = np.zeros(len(one.times_s), np.bool_)
        for film, same, offset_s in zip(films[1:], who, offsets_s, strict=True):
            other = same[number]
            each = None if other is None else film.people[other]
            seen.append(each)
            if each is not None:
                begin_s, end_s = each.times_s[[0, -1]] + offset_s
                is_shared |= (one.times_s >= begin_s) & (one.times_s <= end_s)
        times_s = one.times_s[is_shared]
        if len(times_s) > 1:
            chosen = np.unique(np.linspace(0, len(times_s) - 1, most).astype(int))
            independent = 1.0 + float(np.ptp(times_s)) / _SAME_S
            weight = min(1.0, independent / len(chosen))
            found.append(_Moments(times_s[chosen], seen, weight, tall_m[number]))
    return found


def _bones() -> Iterator[tuple[int, int, int]]:
    """Yield the points at both ends of each bone, and the number of its length."""
    for number, (one, other) in enumerate(_LIMBS):
        for side in ("left", "right"):
            yield _NAMES.index(f"{side}_{one}"), _NAMES.index(f"{side}_{other}"), number
    for number, name in enumerate(_BREADTHS, len(_LIMBS)):
        yield _NAMES.index(f"left_{name}"), _NAMES.index(f"right_{name}"), number


_BONES = np.array(list(_bones()))
_ENDS, _LENGTHS = _BONES[:, :2], _BONES[:, 2]


class _Fit:
    """The bundle adjustment of all films.

    Its unknowns are 7 of each further film: rotation vector, translation, offset; and of each
    person the logarithms of the lengths ``_PRIORS``. The points follow from them.
    """

    def __init__(
        self, moments: Sequence[_Moments], fixed: BoolArray, offsets_s: FloatArray
    ) -> None:
        """Take which unknowns of the c films are given, (c, 7), and limits of offsets, (2, c)."""
        self._moments, self._fixed, self._offsets_s = moments, fixed, offsets_s
        self._people = [
            _Person(one, fixed.size, fixed.size + number * len(_PRIORS))
            for number, one in enumerate(moments)
        ]

    def half(self, number: int) -> _Fit:
        """Return the fit of the first or second half of the images."""
        parts = []
        for one in self._moments:
            middle = len(one.times_s) // 2
            half = one.times_s[:middle] if number == 0 else one.times_s[middle:]
            parts.append(one._replace(times_s=half))
        return _Fit(parts, self._fixed, self._offsets_s)

    def run(self, start: FloatArray) -> tuple[FloatArray, Solution]:
        """Return the unknowns with the least cost near those of the films, or near all, (n,)."""
        lengths = [np.log(one.stature_m * _PRIORS[:, 0]) for one in self._moments]
        mean = np.concatenate([start[: self._fixed.size], *lengths])
        values = np.append(start, mean[len(start) :])
        given = np.where(self._fixed, _GIVEN**-2.0, 0.0).ravel()
        inverse = np.append(given, np.tile(_PRIORS[:, 1] ** -2.0, len(self._moments)))
        for person in self._people:
            person.scale(values)
        low, high = np.full(len(mean), -np.inf), np.full(len(mean), np.inf)
        at = slice(_OFFSET, self._fixed.size, _OF_CAMERA)
        low[at], high[at] = self._offsets_s
        rules = rules_of(len(mean), mean=mean, inverse=inverse, low=low, high=high)
        found = minimize({"points": self._residuals}, values[None], rules, *_FIT_ENDS)
        return found.values[0], found

    def _residuals(self, values: FloatArray) -> Residuals:
        every = [person.residuals(values[0]) for person in self._people]
        errors, jacobian, costs = zip(*every, strict=True)
        return Residuals(
            np.concatenate(errors, axis=1), np.concatenate(jacobian, axis=1), np.sum(costs, axis=0)
        )


class _Person:
    """One person in the bundle adjustment, in m images before c films."""

    def __init__(self, moments: _Moments, films: int, first: int) -> None:
        """Take the numbers of the unknowns of all films, and of the person's first length."""
        self._moments, self._films = moments, films
        self._lengths = first + _LENGTHS
        self._own = [*range(films), *range(first, first + len(_PRIORS))]
        self._scale: FloatArray = np.ones(1)

    def scale(self, unknowns: FloatArray) -> None:
        """Take the inverse deviations of rays from distances at unknowns.

        They stay while the unknowns change: otherwise a smaller scene would fit better.
        """
        at = self._at(unknowns)
        sure, depth_m = at.sure, _before(at, _triangulated(at))[..., 2]
        is_seen = (sure > 0.0) & (depth_m > NEAREST_M)
        count = is_seen.sum(axis=2)
        far_m = np.where(is_seen, depth_m, 0.0).sum(axis=2) / np.maximum(count, 1)
        far_m = np.where(count > 0, far_m, 1.0)
        self._scale = far_m[..., None, None] / (_POINT * self._moments.stature_m)

    def residuals(self, unknowns: FloatArray) -> Residuals:
        """Return residuals at the points (m, 25, 3) with the least cost for the unknowns (n,).

        The loss is bounded (Geman & McClure, 1985): a detector that takes one arm for the other is
        wrong by any distance. The Jacobian has what the points cannot make up for (Golub & Pereyra,
        "The differentiation of pseudo-inverses and nonlinear least squares problems whose variables
        separate", 1973, as Kaufman shortens it).
        """
        at = self._at(unknowns)

        def linearized(values: FloatArray) -> tuple[FloatArray, FloatArray]:
            places = values.reshape(-1, len(_NAMES), 3)
            return self._errors(at, places), self._slopes(at, places)

        begun = _triangulated(at).reshape(len(self._moments.times_s), -1)
        rules = rules_of(begun.shape[1], mean=begun, inverse=_LOOSE)
        of_points = {"points": lambda values: geman_mcclure(*linearized(values))}
        found = minimize(of_points, begun, rules, _INNER)
        errors, slopes = linearized(found.values)
        places = found.values.reshape(-1, len(_NAMES), 3)
        changes = np.zeros((*errors.shape, len(unknowns)))
        for number in self._own:
            moved = unknowns.copy()
            moved[number] += DIFFERENCE
            is_late = number < self._films and number % _OF_CAMERA == _OFFSET
            there = self._at(moved, None if is_late else at)
            changes[..., number] = (self._errors(there, places) - errors) / DIFFERENCE
        values, slopes, costs = geman_mcclure(errors, slopes)
        changes = geman_mcclure(errors, changes).jacobian
        made_up = np.linalg.solve(found.information, slopes.swapaxes(1, 2) @ changes)
        jacobian = (changes - slopes @ made_up).reshape(1, -1, len(unknowns))
        root = math.sqrt(self._moments.weight)
        assert costs is not None
        total = self._moments.weight * costs.sum(keepdims=True)
        return Residuals(root * values.reshape(1, -1), root * jacobian, total)

    def _at(self, unknowns: FloatArray, same: _At | None = None) -> _At:
        """Return what the unknowns say; a point that fewer than two films show is not sure.

        ``same`` has the same offsets.
        """
        one, shape = self._moments, (len(self._moments.times_s), len(_NAMES))
        films = np.vstack([np.zeros(_OF_CAMERA), unknowns[: self._films].reshape(-1, _OF_CAMERA)])
        turns = np.array([cv2.Rodrigues(film[_TURN].copy())[0] for film in films])
        poses = turns, films[:, _MOVE], np.exp(unknowns[self._lengths])
        if same is not None:
            return _At(*poses, *same[3:])
        seen = [
            (np.zeros((*shape, 2)), np.zeros(shape))
            if each is None
            else each.at(one.times_s - late_s)
            for each, late_s in zip(one.seen, films[:, _OFFSET], strict=True)
        ]
        rays, sure = (np.array(each) for each in zip(*seen, strict=True))
        sure *= (sure > 0.0).sum(axis=0) > 1
        bones = (sure.max(axis=0)[:, _ENDS] > 0.0).all(axis=-1) / (_BONE * one.stature_m)
        return _At(*poses, rays, sure, bones)

    def _errors(self, at: _At, places: FloatArray) -> FloatArray:
        """Return the errors of rays, then of bones, in deviations, (m, r)."""
        there = _before(at, places)
        away = there[..., :2] / np.maximum(there[..., 2:], NEAREST_M) - at.rays
        away *= self._scale * at.sure[..., None]
        bones = places[:, _ENDS[:, 0]] - places[:, _ENDS[:, 1]]
        off = at.bones * (np.linalg.norm(bones, axis=-1) - at.lengths_m)
        return np.hstack([away.swapaxes(0, 1).reshape(len(places), -1), off])

    def _slopes(self, at: _At, places: FloatArray) -> FloatArray:
        """Return the derivatives of the errors by the places, (m, r, 75)."""
        there = _before(at, places)
        ahead = np.maximum(there[..., 2:], NEAREST_M)
        by_there = np.zeros((*there.shape[:-1], 2, 3))
        by_there[..., :2] = np.eye(2)
        by_there[..., 2] = -there[..., :2] / ahead
        by_there *= (self._scale * at.sure[..., None] / ahead)[..., None]
        films, points = len(at.turns), len(_NAMES)
        rows = 2 * films * points
        slopes = np.zeros((len(places), rows + len(_ENDS), 3 * points))
        of_rays = slopes[:, :rows].reshape(-1, films, points, 2, points, 3)
        of_bones = slopes[:, rows:].reshape(-1, len(_ENDS), points, 3)
        each, bone = np.arange(points), np.arange(len(_ENDS))
        of_rays[:, :, each, :, each] = np.einsum("cmpij,cjk->pmcik", by_there, at.turns)
        bones = places[:, _ENDS[:, 0]] - places[:, _ENDS[:, 1]]
        bones /= np.maximum(np.linalg.norm(bones, axis=-1, keepdims=True), 1e-9)
        bones *= at.bones[..., None]
        of_bones[:, bone, _ENDS[:, 0]], of_bones[:, bone, _ENDS[:, 1]] = bones, -bones
        return slopes


class _At(NamedTuple):
    """What unknowns say of m images of one person before c films."""

    turns: FloatArray  #: rotations of the films, (c, 3, 3)
    moves_m: FloatArray  #: their translations, (c, 3)
    lengths_m: FloatArray  #: of bones, (b,)
    rays: FloatArray  #: (c, m, 25, 2)
    sure: FloatArray  #: how sure these are, (c, m, 25)
    bones: FloatArray  #: inverse deviations of the lengths of bones, 0 if unseen, 1/m, (m, b)


def _triangulated(at: _At) -> FloatArray:
    """Return the places (m, 25, 3) with the least sums of squared distances from the rays."""
    ahead = np.concatenate([at.rays, np.ones((*at.rays.shape[:-1], 1))], axis=-1)
    ahead = np.einsum("cji,cmpj->cmpi", at.turns, ahead)
    ahead /= np.linalg.norm(ahead, axis=-1, keepdims=True)
    across = np.eye(3) - ahead[..., :, None] * ahead[..., None, :]
    across *= (at.sure**2)[..., None, None]
    centres = -np.einsum("cji,cj->ci", at.turns, at.moves_m)
    right = np.einsum("cmpij,cj->mpi", across, centres)
    loose = across.sum(axis=0) + 1e-9 * np.eye(3)
    return np.linalg.solve(loose, right[..., None])[..., 0]


def _before(at: _At, places: FloatArray) -> FloatArray:
    """Return the places in the optical frame of each film, (c, m, 25, 3)."""
    there: FloatArray = np.einsum("cij,mpj->cmpi", at.turns, places) + at.moves_m[:, None, None]
    return there
