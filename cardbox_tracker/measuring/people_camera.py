"""Pitch, roll, height and focal length of a camera from people who stand and walk before it.

One robust least-squares problem over images of a whole film. Of a person who is upright, the middles
of ears, shoulders, hips, knees and ankles, and the nose, lie near a vertical line at known shares of
the stature. A camera that looks down sees the lower ones farther away, so their spacing shows the
pitch, as surely as people's proportions are alike. These are the same in all images, and so is the
floor under the feet: who walks towards the camera shows pitch, height and focal length together,
because the feet are on one plane. Who stays in one place shows little, and the deviations say so.

Unknowns, lengths in statures: pitch, roll, height of the camera, logarithm of the focal length's
factor; heights and forward distances of the levels, and the mean lean of the legs, the trunk and
aside; for each image the place, the leans, and how far the hips are lowered.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.image_points import LEG_POINT_NAMES, POINT_INDEX, ImagePoints
from cardbox_tracker.person.sizes import FloatArray

Sightings = Sequence[tuple[float, ImagePoints]]
"""Times, s, and points of one person."""

LEVELS = ("nose", "ear", "shoulder", "hip", "knee", "ankle")
# Height above the floor and distance before the ankles of each level, statures, where MediaPipe marks
# the joints of people who stand upright; their standard deviations among people.
_HEIGHTS = np.array([0.915, 0.932, 0.811, 0.507, 0.283, 0.063])
_FORWARD = np.array([0.09, 0.045, 0.0, 0.0, 0.01, 0.0])
_HEIGHT_STDDEVS = np.array([0.016, 0.012, 0.011, 0.013, 0.014, 0.010])
_FORWARD_STDDEVS = np.array([0.02, 0.02, 0.015, 0.015, 0.015, 0.01])
_NOSE, _EAR, _SHOULDER, _HIP, _KNEE, _ANKLE = range(6)

USUAL_PITCH, PITCH_PRIOR = np.radians(8.0), np.radians(11.0)
"""Mean and standard deviation of the pitch of cameras before anything is seen, rad."""
_ROLL_PRIOR = np.radians(12.0)
# Height of cameras, statures.
_HEIGHT_PRIOR = 0.85, 0.5
# Leans of legs, trunk and aside, rad: mean over a film with its deviation, and that of an image.
_LEANS = np.radians((0.5, 0.0, 0.0))
_LEAN_STDDEVS, _LEAN_CHANGES = np.radians((3.0, 3.0, 2.0)), np.radians((4.0, 4.0, 3.0))
# How far the hips of an image are lowered: legs that are seen straight, and others.
_STRAIGHT, _OTHER_LEGS = 0.008, 0.1
# Deviations of a level in an image, aside and along the body.
_SIDE, _ALONG = 0.02, 0.012
# A trunk or knee that is bent more in space is not upright, rad. The points of people who look down
# on are bent backwards.
_BOWED, _BENT = np.radians(35.0), np.radians(35.0)
_LEAST_SCORE, _LEAST_LEVELS = 0.5, 3
# Images of one person that count, and the time in which people keep posture and errors, s.
_MOST_IMAGES, _SAME_S = 24, 1.5
# Scale of the residuals from which on they count less, and most rounds of the fit.
_ROBUST, _MOST_ROUNDS = 2.0, 40
_STEP = 1e-5
_SHARED = 4
# Unknowns of a person and of an image.
_OF_PERSON, _OF_IMAGE = 2 * len(LEVELS) + 3, 6


class PeopleCamera(NamedTuple):
    """What people show of a camera.

    Attributes:
        values: pitch and roll, rad; height of the camera above the floor in metres, or in the mean
            stature if none is given; logarithm of the focal length's factor; (4,).
        covariance: of ``values``, (4, 4).
        residual: root mean square of the residuals, in deviations.
        shows_floor: whether feet are seen.
        distances_m: level distance of each person at the time of their first image, metres.
    """

    values: FloatArray
    covariance: FloatArray
    residual: float
    shows_floor: bool
    distances_m: tuple[float, ...]


class _Seen(NamedTuple):
    """Images of one person who is upright.

    Attributes:
        rays: of the levels, (n, 6, 2); 0 where a level is not seen.
        known: whether it is, (n, 6).
        facing: cosine of the angle between the camera and where the person faces, (n,).
        straight: whether the legs are seen straight, (n,).
        stature_m: of the person.
        weight: root of how many images the n ones count for, each.
    """

    rays: FloatArray
    known: FloatArray
    facing: FloatArray
    straight: FloatArray
    stature_m: float
    weight: float


def people_camera(
    people: Sequence[Sightings],
    statures_m: Sequence[float],
    camera: Camera,
    pitch: tuple[float, float] = (USUAL_PITCH, PITCH_PRIOR),
) -> PeopleCamera | None:
    """Return what people show; None if nobody is upright.

    Args:
        people: times and points of each person, at the resolution of ``camera``.
        statures_m: stature of each person.
        camera: intrinsics with ``focal_stddev``; its pitch is not used.
        pitch: mean and standard deviation of the pitch before anything is seen, rad.
    """
    pairs = zip(people, statures_m, strict=True)
    seen = [one for sights, m in pairs if (one := _upright(sights, m, camera)) is not None]
    if not seen:
        return None
    problem = _Problem(seen, camera.focal_stddev, pitch)
    found = least_squares(
        problem.residuals,
        problem.start(),
        problem.jacobian,
        loss="soft_l1",
        f_scale=_ROBUST,
        x_scale="jac",
        max_nfev=_MOST_ROUNDS,
    )
    information = found.jac.T @ found.jac
    covariance = np.linalg.pinv(information)[:_SHARED, :_SHARED]
    images = sum(len(one.rays) for one in seen)
    residual = float(np.sqrt(2.0 * found.cost / (12 * images)))
    shows_floor = any(bool(one.known[:, _ANKLE].any()) for one in seen)
    distances = tuple(problem.distances_m(found.x))
    return PeopleCamera(found.x[:_SHARED], covariance, residual, shows_floor, distances)


def _upright(sights: Sightings, stature_m: float, camera: Camera) -> _Seen | None:
    """Return some of the images in which a person is upright."""
    rows = []
    for time_s, points in sights:
        px, known = _levels(points)
        # Points outside of the image are guesses.
        known = known & ((px >= 0.0) & (px <= (camera.width - 1, camera.height - 1))).all(axis=1)
        if known.sum() < _LEAST_LEVELS or not known[[_SHOULDER, _HIP]].all():
            continue
        facing, is_bowed, is_straight = _posture(points)
        if not is_bowed:
            rows.append((time_s, px, known, facing, is_straight and known[_ANKLE]))
    if not rows:
        return None
    rows = [rows[i] for i in np.unique(np.linspace(0, len(rows) - 1, _MOST_IMAGES).astype(int))]
    times_s, px, known, facing, straight = (np.array(one) for one in zip(*rows, strict=True))
    independent = min(len(rows), 1.0 + float(np.ptp(times_s)) / _SAME_S)
    rays = np.where(known[..., None], camera.rays(px)[..., :2], 0.0)
    # Bent knees are nowhere near a line from the hips to the feet, and a foot may be lifted.
    known[~straight, _KNEE:] = False
    weight = float(np.sqrt(independent / len(rows)))
    return _Seen(rays, known.astype(float), facing, straight, stature_m, weight)


def _levels(points: ImagePoints) -> tuple[FloatArray, FloatArray]:
    """Return the middles (6, 2), px, of the levels, 0 where they are not known, and if they are."""
    px, known = np.zeros((len(LEVELS), 2)), np.zeros(len(LEVELS), bool)
    for number, level in enumerate(LEVELS):
        names = (level,) if level == "nose" else (f"left_{level}", f"right_{level}")
        if level in ("knee", "ankle"):
            if points.legs is None:
                continue
            at = [LEG_POINT_NAMES.index(name) for name in names]
            there, scores = points.legs.px[at], points.legs.scores[at]
        else:
            at = [POINT_INDEX[name] for name in names]
            there, scores = points.px[at], points.scores[at]
        if scores.min() >= _LEAST_SCORE and np.isfinite(there).all():
            px[number], known[number] = there.mean(axis=0), True
    return px, known


def _posture(points: ImagePoints) -> tuple[float, bool, bool]:
    """Return how much a person faces the camera, -1 to 1, who bows, and whose knees are straight."""
    if points.spatial_m is None:
        return 1.0, False, True
    there = points.spatial_m
    shoulders, hips = (
        [there[POINT_INDEX[f"{side}_{name}"]] for side in ("left", "right")]
        for name in ("shoulder", "hip")
    )
    across = shoulders[0] - shoulders[1]
    facing = float(across[0] / max(np.hypot(across[0], across[2]), 1e-6))
    trunk = np.add(*shoulders) - np.add(*hips)
    is_bowed = bool(np.hypot(trunk[0], trunk[2]) > np.tan(_BOWED) * -trunk[1])
    is_straight = points.legs is not None and points.legs.spatial_m is not None
    if points.legs is not None and points.legs.spatial_m is not None:
        knees, ankles = points.legs.spatial_m[0:2], points.legs.spatial_m[2:4]
        thighs, shanks = knees - np.array(hips), ankles - knees
        cosine = (thighs * shanks).sum(axis=1) / np.maximum(
            np.linalg.norm(thighs, axis=1) * np.linalg.norm(shanks, axis=1), 1e-6
        )
        is_straight = bool(cosine.min() > np.cos(_BENT))
    return facing, is_bowed, is_straight


class _Problem:
    """The residuals; unknowns are shared ones, those of each person, those of each image."""

    def __init__(
        self, seen: Sequence[_Seen], focal_stddev: float, pitch: tuple[float, float]
    ) -> None:
        self._seen = seen
        counts = [len(one.rays) for one in seen]
        self._person = np.repeat(np.arange(len(seen)), counts)
        self._rays = np.concatenate([one.rays for one in seen])
        self._known = np.concatenate([one.known for one in seen])
        self._facing = np.concatenate([one.facing for one in seen])
        straight = np.concatenate([one.straight for one in seen])
        self._weight = np.repeat([one.weight for one in seen], counts)
        self._stature_m = np.array([one.stature_m for one in seen])
        self._images, self._people = len(self._rays), len(seen)
        rows = np.where(self._known > 0, self._rays[..., 1], np.nan)
        heights = np.where(self._known > 0, _HEIGHTS, np.nan)
        spans = np.nanmax(heights, axis=1) - np.nanmin(heights, axis=1)
        looks = np.maximum(np.nanmax(rows, axis=1) - np.nanmin(rows, axis=1), 1e-3)
        self._distance = spans / looks
        mean_m = float(self._stature_m.mean())
        self._shared = np.array([*pitch, 0.0, _ROLL_PRIOR, *(mean_m * np.array(_HEIGHT_PRIOR))])
        self._shared = np.array([*self._shared, 0.0, focal_stddev]).reshape(_SHARED, 2)
        hips = np.where(straight, _STRAIGHT, _OTHER_LEGS)
        self._changes = np.column_stack([np.tile(_LEAN_CHANGES, (self._images, 1)), hips])

    def start(self) -> FloatArray:
        """Return the first unknowns."""
        images = np.zeros((self._images, _OF_IMAGE))
        images[:, 0] = self._rays[:, _SHOULDER, 0] * self._distance
        images[:, 1] = np.log(self._distance)
        people = np.zeros((self._people, _OF_PERSON))
        return np.concatenate([self._shared[:, 0], people.ravel(), images.ravel()])

    def distances_m(self, values: FloatArray) -> list[float]:
        """Return the level distance of each person in the first image with them, m."""
        distances = np.exp(values[-_OF_IMAGE * self._images :].reshape(-1, _OF_IMAGE)[:, 1])
        firsts = [int(np.argmax(self._person == number)) for number in range(self._people)]
        return [float(distances[i] * m) for i, m in zip(firsts, self._stature_m, strict=True)]

    def _split(self, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        end = _SHARED + self._people * _OF_PERSON
        people = values[_SHARED:end].reshape(self._people, _OF_PERSON)
        return values[:_SHARED], people, values[end:].reshape(self._images, _OF_IMAGE)

    def residuals(self, values: FloatArray) -> FloatArray:
        """Return all residuals in units of their deviations."""
        shared, people, images = self._split(values)
        return np.concatenate(
            [
                self._points(shared, people[self._person], images).ravel(),
                (shared - self._shared[:, 0]) / self._shared[:, 1],
                (
                    people / np.concatenate([_HEIGHT_STDDEVS, _FORWARD_STDDEVS, _LEAN_STDDEVS])
                ).ravel(),
                (self._weight[:, None] * images[:, 2:] / self._changes).ravel(),
            ]
        )

    def _points(self, shared: FloatArray, people: FloatArray, images: FloatArray) -> FloatArray:
        """Return the residuals of the levels (n, 6, 2); ``people`` are those of each image."""
        pitch, roll, height_m, log_focal = shared
        count = len(LEVELS)
        heights = _HEIGHTS + people[:, :count]
        forward = self._facing[:, None] * (_FORWARD + people[:, count : 2 * count])
        legs, trunk, aside = (people[:, 2 * count :] + _LEANS + images[:, 2:5]).T[..., None]
        hips = heights[:, _HIP : _HIP + 1]
        forward = forward + legs * (np.minimum(heights, hips) - heights[:, _ANKLE:])
        forward = forward + trunk * np.maximum(heights - hips, 0.0)
        lowered = images[:, 5:6] * (np.arange(count) <= _HIP)
        # Optical axes of a level camera: right, down, forward; in statures of the person.
        x = images[:, 0:1] + aside * heights
        y = height_m / self._stature_m[self._person][:, None] - heights + lowered
        z = np.exp(images[:, 1:2]) - forward
        c, s = np.cos(pitch), np.sin(pitch)
        down, ahead = c * y - s * z, np.maximum(s * y + c * z, 0.05)
        c, s = np.cos(roll), np.sin(roll)
        focal = np.exp(log_focal)
        seen = np.stack([c * x + s * down, c * down - s * x], axis=-1) / ahead[..., None]
        away = (focal * seen - self._rays) * self._distance[:, None, None]
        weights = self._weight[:, None, None] * self._known[..., None]
        residuals: FloatArray = np.clip(away / (_SIDE, _ALONG), -50.0, 50.0) * weights
        return residuals

    def jacobian(self, values: FloatArray) -> FloatArray:
        """Return the derivatives by differences; an unknown of images changes in all at once."""
        shared, people, images = self._split(values)
        of_images = people[self._person]
        before = self._points(shared, of_images, images)
        size = before[0].size
        rows = self._images * size
        found = np.zeros((len(self.residuals(values)), len(values)))

        def change(after: FloatArray) -> FloatArray:
            return ((after - before) / _STEP).reshape(self._images, size)

        for number in range(_SHARED):
            moved = shared.copy()
            moved[number] += _STEP
            found[:rows, number] = change(self._points(moved, of_images, images)).ravel()
        each, begin = np.arange(self._images), _SHARED
        by_image = found[:rows].reshape(self._images, size, -1)
        for kind, values_of, width in (("people", of_images, _OF_PERSON), ("", images, _OF_IMAGE)):
            owner = self._person if kind else each
            for number in range(width):
                moved = values_of.copy()
                moved[:, number] += _STEP
                pair = (moved, images) if kind else (of_images, moved)
                by_image[each, :, begin + owner * width + number] = change(
                    self._points(shared, *pair)
                )
            begin += width * (self._people if kind else self._images)
        at = rows
        found[at : at + _SHARED, :_SHARED] = np.diag(1.0 / self._shared[:, 1])
        at += _SHARED
        deviations = np.concatenate([_HEIGHT_STDDEVS, _FORWARD_STDDEVS, _LEAN_STDDEVS])
        count = self._people * _OF_PERSON
        diagonal = np.arange(count)
        found[at + diagonal, _SHARED + diagonal] = np.tile(1.0 / deviations, self._people)
        at, begin = at + count, _SHARED + count
        for number in range(_OF_IMAGE - 2):
            columns = begin + _OF_IMAGE * each + 2 + number
            found[at + (_OF_IMAGE - 2) * each + number, columns] = (
                self._weight / self._changes[:, number]
            )
        return found
