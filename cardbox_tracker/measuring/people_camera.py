"""Pitch, roll, height and focal length of a camera from people who stand and walk before it.

Of a person who is upright, the middles of ears, shoulders, hips, knees and ankles lie near a
vertical line at known shares of the stature. A camera that looks down sees the lower ones farther
away, so their spacing shows the pitch, as surely as people's proportions are alike. These are the
same in all images, and so is the floor under the feet: who walks towards the camera shows pitch,
height and focal length together. Who stays in one place shows little, and the deviations say so.

All images are one robust least-squares problem. Its unknowns are those of the camera; those of
each person: logarithm of the stature, heights and forward distances of the levels, leans of legs
and trunk forwards, and aside; and those of each image: the place, the leans, how far bent legs
lower the hips, and how high what the person stands on is. Of each person, only the images count in
which hips and knees are as straight as they get. Lengths are in statures.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.least_squares import (
    DIFFERENCE,
    ENDS,
    Residuals,
    Rules,
    Solution,
    minimize,
    pseudo_huber,
    rules_of,
)
from cardbox_tracker.detectors.image_points import (
    CERTAIN,
    LEG_POINT_NAMES,
    POINT_INDEX,
    ImagePoints,
)
from cardbox_tracker.person.proportions import MARKED_HEIGHTS, USUAL_STATURE_M, USUAL_STDDEV_M
from cardbox_tracker.person.sizes import FloatArray

Sightings = Sequence[tuple[float, ImagePoints]]
"""Times, s, and points of one person."""

USUAL_PITCH, PITCH_PRIOR = np.radians(10.0), np.radians(13.0)
"""Mean and standard deviation of the pitch of cameras before anything is seen, rad."""
ROLL_PRIOR = np.radians(15.0)
"""Standard deviation of the roll of cameras that do not stand level, rad."""
DISTANCE_STDDEV = 0.05
"""Relative standard deviation of a given distance, which people measure or estimate."""
LEVELS = ("nose", "ear", "shoulder", "hip", "knee", "ankle")
# Distance before the ankles of each level where MediaPipe marks the joints of people who stand
# upright, and the standard deviations among people of heights and distances.
FORWARD = np.array([0.09, 0.045, 0.0, 0.0, 0.01, 0.0])
_HEIGHT_STDDEVS = np.array([0.025, 0.016, 0.013, 0.016, 0.014, 0.010])
_FORWARD_STDDEVS = np.array([0.03, 0.02, 0.015, 0.015, 0.015, 0.01])
_SHOULDER, _HIP, _KNEE, _ANKLE = range(2, 6)
_TRUNK = [
    POINT_INDEX[f"{side}_{name}"] for name in ("shoulder", "hip") for side in ("left", "right")
]
# How much higher MediaPipe marks the hips where no feet are in the image.
_HIP_ALONE = 0.022
# Leans of legs, trunk and aside of a person, rad: deviations among people and images.
_LEAN_STDDEVS = np.radians((3.0, 4.0, 2.0))
# How far the hips of an image are lowered: legs that are seen straight, and others.
_STRAIGHT, _OTHER_LEGS = 0.008, 0.08
# Deviations of the height of what a person stands on, such as a box, and of a floor; images whose
# height differs less than the last value from that of most images show the floor.
_STEP_UP, _FLOOR, _ON_FLOOR = 0.1, 0.01, 0.045
# An image counts if hips and knees bend at most this much more, rad, than in this share of all.
_BENT_MORE, _STRAIGHTEST = np.radians(20.0), 0.1
# Deviations of a level in an image, aside and along the body.
_SIDE, _ALONG = 0.02, 0.012
# A trunk that leans more in space is not upright. Knees that bend more are not straight, rad.
# Somebody who is seen from above seems to lean, but not against the own legs: there, the trunk of
# who stands leans less than the last value.
_BOWED, _BENT, _LEANS_FORWARD = np.radians((50.0, 35.0, 20.0))
_BORDER = 0.02
# How far people go in a second before they are first seen upright, m.
_GOES_M = 0.1
# Images of one person that count, and the time in which people keep posture and errors, s.
_MOST_IMAGES, _SAME_S = 24, 4.0
_SHARED, _OF_PERSON, _OF_IMAGE = 4, 2 * len(LEVELS) + 4, 7


class Distances(NamedTuple):
    """Where a person is seen upright.

    Attributes:
        times_s: times of the images, (n,).
        distances: level distance from the camera in each, statures, (n,).
        stddev: standard deviation of the mean of the logarithms of all distances.
    """

    times_s: FloatArray
    distances: FloatArray
    stddev: float


class PeopleCamera(NamedTuple):
    """What people show of a camera.

    Attributes:
        values: pitch and roll, rad; height above the floor, m; logarithm of the focal length's
            factor; (4,).
        covariance: of ``values``, (4, 4).
        shows_feet: whether feet are seen.
        distances: of each person; None for who is never upright.
    """

    values: FloatArray
    covariance: FloatArray
    shows_feet: bool
    distances: tuple[Distances | None, ...]


class _Seen(NamedTuple):
    """Images of people who are upright; arrays of n images.

    Attributes:
        rays: of the levels, (n, 6, 2); 0 where a level is not seen.
        stddevs: of the rays' ends, statures, (n, 6, 2); infinite where it is not seen.
        facing: where the person faces, to the right and to the camera, (n, 2).
        lowered: deviation of how far the hips are lowered, (n,).
        weight: how many images one counts for, (n,).
        person: number of the person, (n,).
        times_s: times of the images, (n,).
    """

    rays: FloatArray
    stddevs: FloatArray
    facing: FloatArray
    lowered: FloatArray
    weight: FloatArray
    person: FloatArray
    times_s: FloatArray


def people_camera(
    people: Sequence[Sightings],
    statures_m: Sequence[float | None],
    camera: Camera,
    pitch: tuple[float, float] = (USUAL_PITCH, PITCH_PRIOR),
    roll: tuple[float, float] = (0.0, ROLL_PRIOR),
    distance_m: float | None = None,
) -> PeopleCamera | None:
    """Return what people show; None if nobody is upright.

    Args:
        people: times and points of each person, at the resolution of ``camera``.
        statures_m: stature of each person; None if it is not known.
        camera: intrinsics with ``focal_stddev``; its pitch is not used.
        pitch: mean and standard deviation of the pitch before anything is seen, rad.
        roll: the same of the roll.
        distance_m: level distance of the first person where they are first seen; None if it is not
            known.
    """
    every = [_upright(sights, number, camera) for number, sights in enumerate(people)]
    shown = [one for one in every if one is not None]
    if not shown:
        return None
    seen = _Seen(*(np.concatenate(one) for one in zip(*shown, strict=True)))
    images = len(seen.rays)
    known = np.isfinite(seen.stddevs[..., 0])
    heights = np.where(known, MARKED_HEIGHTS, np.nan)
    rows = np.where(known, seen.rays[..., 1], np.nan)
    columns = np.where(known, seen.rays[..., 0], np.nan)
    looks = np.hypot(np.ptp(_ends(rows), axis=1), np.ptp(_ends(columns), axis=1))
    distance = np.ptp(_ends(heights), axis=1) / np.maximum(looks, 1e-3)
    statures = np.log([one or USUAL_STATURE_M for one in statures_m])
    unsure = [0.005 if one else USUAL_STDDEV_M / USUAL_STATURE_M for one in statures_m]
    # Means and variances of the unknowns before anything is seen.
    usual_m = float(np.exp(statures.mean()))
    camera_mean = np.array([pitch[0], roll[0], 0.85 * usual_m, 0.0])
    camera_stddev = np.array([pitch[1], roll[1], 0.6 * usual_m, camera.focal_stddev])
    of_people = np.zeros((len(statures), _OF_PERSON))
    of_people[:, 0] = statures
    spread = (*_HEIGHT_STDDEVS, *_FORWARD_STDDEVS, *_LEAN_STDDEVS)
    of_people_stddev = np.array([[one, *spread] for one in unsure])
    for number in range(len(statures)):
        if not known[seen.person == number, _ANKLE].any():
            of_people[number, 1 + _HIP] = _HIP_ALONE
    place = np.column_stack([seen.rays[:, _SHOULDER, 0] * distance, np.log(distance)])
    of_images = np.column_stack([place, np.zeros((images, 5))])
    free = np.full((images, 2), 3.0)
    leans = np.tile(_LEAN_STDDEVS, (images, 1))
    steps = np.full(images, _STEP_UP)
    of_images_stddev = np.column_stack([free, leans, seen.lowered, steps])
    of_images_stddev /= np.sqrt(seen.weight)[:, None]
    mean = np.concatenate([camera_mean, of_people.ravel(), of_images.ravel()])
    precision = np.concatenate([camera_stddev, of_people_stddev.ravel(), of_images_stddev.ravel()])
    precision **= -2.0
    person = seen.person.astype(int)
    first = _SHARED + _OF_PERSON * person
    last = _SHARED + _OF_PERSON * len(statures) + _OF_IMAGE * np.arange(images)
    own = np.column_stack(
        [
            np.tile(np.arange(_SHARED), (images, 1)),
            first[:, None] + np.arange(_OF_PERSON),
            last[:, None] + np.arange(_OF_IMAGE),
        ]
    )
    start = mean.copy()
    if distance_m is not None and (at := np.flatnonzero(person == 0)).size:
        known_log = math.log(distance_m) - statures[0]
        late_s = float(seen.times_s[at[0]]) - people[0][0][0]
        unsure_log = math.hypot(DISTANCE_STDDEV, unsure[0], _GOES_M * late_s / distance_m)
        start[3] = known_log - math.log(distance[at[0]])
        start[last + 1] += start[3]
        mean[last[at[0]] + 1], precision[last[at[0]] + 1] = known_log, unsure_log**-2.0
    rules = rules_of(len(mean), mean=mean, inverse=precision)
    found = _fitted(seen, distance, own, rules, start).values[0]
    # Most images show the floor, so in the second fit only the others may show something higher.
    high = found[last + _OF_IMAGE - 1]
    on_floor = np.abs(high - np.median(high)) < _ON_FLOOR
    precision[last[on_floor] + _OF_IMAGE - 1] *= (_STEP_UP / _FLOOR) ** 2
    rules = rules_of(len(mean), mean=mean, inverse=precision)
    fit = _fitted(seen, distance, own, rules, found)
    found = fit.values[0]
    if not np.isfinite(found).all():
        return None
    covariance: FloatArray = np.linalg.inv(fit.information[0]).astype(np.float64)
    far = last + 1
    # The errors of single images count for what the mean of all has of them.
    distances = [
        Distances(
            seen.times_s[its],
            np.exp(found[far[its]]),
            math.sqrt(covariance[np.ix_(far[its], far[its])].mean()),
        )
        if (its := person == number).any()
        else None
        for number in range(len(statures))
    ]
    covariance = covariance[:_SHARED, :_SHARED]
    return PeopleCamera(found[:_SHARED], covariance, bool(known[:, _ANKLE].any()), tuple(distances))


def _ends(values: FloatArray) -> FloatArray:
    return np.column_stack([np.nanmin(values, axis=1), np.nanmax(values, axis=1)])


def _fitted(
    seen: _Seen, distance: FloatArray, own: NDArray[np.int64], rules: Rules, start: FloatArray
) -> Solution:
    """Return the unknowns that fit best.

    Args:
        seen: the images.
        distance: of each image to begin with, statures, (n,).
        own: numbers of the unknowns that each image depends on, (n, k).
        rules: what is known of the unknowns before anything is seen.
        start: values to begin with.
    """
    scale = distance[:, None, None] / seen.stddevs
    images, weight = np.arange(len(own))[:, None, None], np.repeat(seen.weight, 2 * len(LEVELS))
    steps = DIFFERENCE * np.eye(own.shape[1] + 1, own.shape[1], -1)[:, None]

    def levels(unknowns: FloatArray) -> Residuals:
        moved = (_rays(seen, unknowns[0, own] + steps) - seen.rays) * scale
        away = moved.reshape(*moved.shape[:2], -1)
        jacobian = np.zeros((*away.shape[1:], unknowns.size))
        rows = np.arange(away.shape[2])[:, None]
        jacobian[images, rows, own[:, None]] = np.moveaxis(away[1:] - away[0], 0, 2) / DIFFERENCE
        jacobian = jacobian.reshape(1, -1, unknowns.size)
        return pseudo_huber(away[0].reshape(1, -1), jacobian, weight=weight)

    return minimize({"levels": levels}, start[None], rules, *ENDS)


def _rays(seen: _Seen, unknowns: FloatArray) -> FloatArray:
    """Return the rays (..., n, 6, 2) of the levels for the unknowns (..., n, k) of each image."""
    count = len(LEVELS)
    pitch, roll, height_m, log_focal, log_stature = np.moveaxis(unknowns[..., :5, None], -2, 0)
    heights = MARKED_HEIGHTS + unknowns[..., 5 : 5 + count]
    forward = FORWARD + unknowns[..., 5 + count : 5 + 2 * count]
    leans, changes = unknowns[..., 5 + 2 * count : 8 + 2 * count], unknowns[..., -5:-2]
    aside, far = unknowns[..., -7:-6], np.exp(unknowns[..., -6:-5])
    legs = np.minimum(heights, heights[..., _HIP : _HIP + 1]) - heights[..., _ANKLE:]
    trunk = np.maximum(heights - heights[..., _HIP : _HIP + 1], 0.0)
    forward = forward + leans[..., :1] * legs + leans[..., 1:2] * trunk
    lowered = unknowns[..., -2:-1] * (np.arange(count) <= _HIP) - unknowns[..., -1:]
    # Optical axes of a level camera: right, down, forward.
    x = aside + seen.facing[:, :1] * forward + (leans[..., 2:] + changes[..., 2:]) * heights
    y = height_m / np.exp(log_stature) - heights + lowered
    z = far - seen.facing[:, 1:] * forward - changes[..., :1] * legs - changes[..., 1:2] * trunk
    c, s = np.cos(pitch), np.sin(pitch)
    down, ahead = c * y - s * z, np.maximum(s * y + c * z, 0.05)
    # A camera that is turned clockwise sees the world turned the other way.
    c, s = np.cos(roll), np.sin(roll)
    seen_at = np.stack([c * x + s * down, c * down - s * x], axis=-1) / ahead[..., None]
    rays: FloatArray = np.exp(log_focal)[..., None] * seen_at
    return rays


def _upright(sights: Sightings, number: int, camera: Camera) -> _Seen | None:
    """Return some of the images in which a person is upright; None without any."""
    rows = []
    for time_s, points in sights:
        px, known = _levels(points)
        # The network guesses what is outside of the image, and puts some of it at the border.
        known &= is_inside(px, camera)
        if points.legs is not None:
            # Ankles are doubtful where heels or toes are cut off.
            feet = is_inside(points.legs.px[4:], camera) | (points.legs.scores[4:] <= 0.0)
            known[_ANKLE] &= bool(feet.all())
        facing, is_bowed, leans, bend, is_straight = _posture(points)
        # The network guesses legs that are not in the image.
        is_bowed |= leans and bool(known[[_KNEE, _ANKLE]].all())
        is_straight = is_straight and bool(known[_KNEE])
        known[_KNEE] &= is_straight
        if not is_bowed and known[[_SHOULDER, _HIP]].all():
            rows.append((time_s, px, known, facing, is_straight, bend))
    if not rows:
        return None
    bends = [bend for *_, bend in rows if math.isfinite(bend)]
    if bends:
        most = np.quantile(bends, _STRAIGHTEST) + _BENT_MORE
        rows = [row for row in rows if not row[-1] > most]
    rows = [rows[i] for i in np.unique(np.linspace(0, len(rows) - 1, _MOST_IMAGES).astype(int))]
    times_s, px, known, faces, straight, _ = (np.array(one) for one in zip(*rows, strict=True))
    stddevs = np.where(known, _ALONG, np.inf)[..., None] * np.array([_SIDE / _ALONG, 1.0])
    # Without straight legs, the trunk may lean in all images alike.
    independent = min(len(rows), 1.0 + float(np.ptp(times_s) * straight.mean()) / _SAME_S)
    return _Seen(
        np.where(known[..., None], camera.rays(px)[..., :2], 0.0),
        stddevs,
        faces,
        np.where(straight, _STRAIGHT, _OTHER_LEGS),
        np.full(len(rows), independent / len(rows)),
        np.full(len(rows), float(number)),
        times_s,
    )


def is_inside(px: FloatArray, camera: Camera, share: float = _BORDER) -> NDArray[np.bool_]:
    """Return which points (..., 2) are inside of the image and not at its border, (...).

    Args:
        px: column and row of each.
        camera: of the image.
        share: width of the border as a share of the longer side.
    """
    border = share * max(camera.width, camera.height)
    low, high = border - 0.5, np.array([camera.width, camera.height]) - 0.5 - border
    return np.asarray(((px > low) & (px < high)).all(axis=-1))


def _levels(points: ImagePoints) -> tuple[FloatArray, NDArray[np.bool_]]:
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
        if scores.min() >= CERTAIN and np.isfinite(there).all():
            px[number], known[number] = there.mean(axis=0), True
    return px, known


def _posture(points: ImagePoints) -> tuple[tuple[float, float], bool, bool, float, bool]:
    """Return where a person faces, and how legs and trunk are.

    That is: if they bow; if the trunk leans against the legs; the bend; and if legs are straight.
    The bend is that of the hips plus the mean one of the knees, rad; nan if legs are unknown.
    """
    there = points.spatial_m
    if there is None or not np.isfinite(there[_TRUNK]).all():
        return (0.0, 1.0), False, False, math.nan, True
    shoulders, hips = there[_TRUNK].reshape(2, 2, 3)
    across = shoulders[0] - shoulders[1]
    length = max(float(np.hypot(across[0], across[2])), 1e-6)
    facing = float(across[2] / length), float(across[0] / length)
    trunk = shoulders.sum(axis=0) - hips.sum(axis=0)
    elbows = there[[POINT_INDEX["left_elbow"], POINT_INDEX["right_elbow"]]]
    # Who raises an arm raises the shoulder, too.
    is_bowed = bool((elbows[:, 1] < shoulders[:, 1]).any())
    is_bowed |= math.hypot(trunk[0], trunk[2]) > math.tan(_BOWED) * -float(trunk[1])
    if points.legs is None or points.legs.spatial_m is None:
        return facing, is_bowed, False, math.nan, False
    knees, ankles = points.legs.spatial_m[0:2], points.legs.spatial_m[2:4]
    thighs, shanks = knees - hips, ankles - knees
    of_knees = [_angle(*pair) for pair in zip(thighs, shanks, strict=True)]
    bend = _angle(thighs.sum(axis=0), -trunk) + sum(of_knees) / 2
    leans = _angle(trunk, hips.sum(axis=0) - ankles.sum(axis=0)) > _LEANS_FORWARD
    return facing, is_bowed, leans, bend, max(of_knees) < _BENT


def _angle(a: FloatArray, b: FloatArray) -> float:
    """Return the angle between two directions, rad."""
    lengths = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.arccos(np.clip(a @ b / max(lengths, 1e-9), -1.0, 1.0)))
