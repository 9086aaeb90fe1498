"""The camera of a scene from all that shows it in a film, with standard deviations.

People who stand and walk show pitch, roll, height and focal length, and so do upright edges of the
room for pitch and roll. Both are combined by Bayes' rule on a grid. Edges can be wrong as a whole,
such as those of leaning things, so with some probability they mean nothing; then people, and what
is usual, decide.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import WORKING_SIZE, Camera
from cardbox_tracker.camera.encodings import brightness_of
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.measuring.camera_turns import blurred
from cardbox_tracker.measuring.people_camera import (
    DISTANCE_STDDEV,
    PITCH_PRIOR,
    ROLL_PRIOR,
    USUAL_PITCH,
    Distances,
    Sightings,
    people_camera,
)
from cardbox_tracker.measuring.room_edges import PITCHES_RAD, ROLLS_RAD, edge_likelihoods
from cardbox_tracker.measuring.scene import FOUND, GIVEN, USUAL, SceneCamera, Value
from cardbox_tracker.person.model import FOUND_STDDEV, PLACEMENT, BodyModel
from cardbox_tracker.person.proportions import USUAL_STATURE_M
from cardbox_tracker.person.sizes import FloatArray

GIVEN_STDDEV = float(np.radians(0.5))
"""Standard deviation of a pitch or roll that is given, rad."""
# Deviations of the roll of cameras that stand level, and of others; share of the others.
_LEVEL, _ROLLED, _ROLLED_SHARE = np.radians(1.0), ROLL_PRIOR, 0.15
# Chance that edges mean nothing, and systematic error of those that do, steps of the grid.
_MISLEADING, _SYSTEMATIC = 0.2, 1.5
# Systematic error of a pitch that people show, rad.
_PEOPLE = np.radians(0.7)
# Half of the width of a peak, steps of the grid; chance of one standard deviation.
_PEAK, _WITHIN = 6, 0.68
# What differs by less than so many standard deviations can be a chance.
_SURE = 2.0
GUESSED = 0.1
"""Relative deviation from which on a focal length is only a usual one."""
# Share of it from which on one that is found takes its place.
_BETTER = 0.5
# The same of any camera's focal length, from telephoto to action camera, where a distance tells it.
_ANY_LENS = 0.5
# Least difference of two sources that is told, rad.
_TOLD = np.radians(4.0)
# A shift of most of the background between two images that shows that the camera moves, as a share
# of the longer side; pairs of images with such a shift, and points that show it.
_SHIFT, _SHIFTED_PAIRS, _LEAST_POINTS = 0.01, 0.25, 12
# Deviation of the blur that leaves no texture, px; standard deviations above which the peak of the
# textures' correlation is none of noise.
_TEXTURE_PX, _CLEARER = 6.0, 7.0
# Deviation of the pitch of a camera that moves, rad, with which nothing is sure; margin around
# people, share of their height.
_MOVING, _AROUND = np.radians(12.0), 0.15
Picture = tuple[float, NDArray[np.uint8]]
"""Time, s, and an image (H, W) or (H, W, 3) at any resolution, undistorted."""


class FoundCamera(NamedTuple):
    """The camera, and what shows it.

    Attributes:
        camera: its values. Lengths are in metres; the height is None without people.
        sources: what the pitch is found from, in words.
        remarks: sources that contradict each other, and a camera that moves, in words.
        distances: of each person; None where they are not known.
        moves: whether the camera moves.
    """

    camera: SceneCamera
    sources: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    distances: tuple[Distances | None, ...] = ()
    moves: bool = False


class Background(NamedTuple):
    """What is known of the background of a film; None for what is not."""

    moves: bool | None = None  #: the result of :func:`camera_moves`
    edges: FloatArray | None = None  #: that of :func:`.edge_likelihoods`


def scene_camera(
    people: Sequence[Sightings],
    pictures: Sequence[Picture],
    camera: Camera,
    statures_m: Sequence[float | None],
    given: tuple[float, float] | None = None,
    roll_rad: float | None = None,
    distance_m: float | None = None,
    background: Background | None = None,
) -> FoundCamera:
    """Return the camera of a film.

    Args:
        people: times and points of each person in the whole film, at the resolution of ``camera``.
        pictures: some of its images.
        camera: intrinsics with ``focal_stddev``; its pitch is not used.
        statures_m: stature of each person; None if it is not known.
        given: mean and standard deviation of a downward pitch that is given, rad; None for none.
        roll_rad: clockwise roll that is given; None for none.
        distance_m: level distance that is given of the first person when first seen; None for none.
            Beside the stature it shows the focal length, if that is only a usual one.
        background: what is known of the background already.
    """
    usual_roll = (0.0, _ROLLED) if roll_rad is None else (roll_rad, GIVEN_STDDEV)
    usual_tilt = (USUAL_PITCH, PITCH_PRIOR), usual_roll
    remarks, sources = list[str](), list[str]()
    given_m = distance_m
    if lens_of(camera).origin != USUAL:
        distance_m = None
    if distance_m is not None:
        # Where edges of the room meet depends on the focal length.
        free = replace(camera, focal_stddev=_ANY_LENS)
        by_distance = people_camera(people, statures_m, free, *usual_tilt, distance_m)
        if by_distance is not None:
            factor = float(np.exp(by_distance.values[3]))
            camera = replace(free, fx=factor * free.fx, fy=factor * free.fy)
    told = background or Background()
    seen = pictures if told.edges is None else ()
    with ThreadPoolExecutor(1) as beside:
        edges = beside.submit(edge_likelihoods, [picture for _, picture in seen], camera)
        shown = people_camera(people, statures_m, camera, *usual_tilt, distance_m)
        moves = camera_moves(people, pictures, camera) if told.moves is None else told.moves
        likelihoods = edges.result() if told.edges is None else told.edges
    pitches, rolls = np.meshgrid(PITCHES_RAD, ROLLS_RAD, indexing="ij")
    if roll_rad is None:
        of_roll = (1 - _ROLLED_SHARE) * _normal(rolls, 0.0, _LEVEL)
        of_roll += _ROLLED_SHARE * _normal(rolls, 0.0, _ROLLED)
    else:
        of_roll = _normal(rolls, float(np.clip(roll_rad, *ROLLS_RAD[[0, -1]])), _LEVEL)
    chances = of_roll * _normal(pitches, USUAL_PITCH, PITCH_PRIOR)
    if shown is not None:
        spread = shown.covariance[:2, :2] + np.diag([_PEOPLE**2, 0.0])
        pitch, roll = shown.values[:2]
        stddev = np.sqrt(np.diag(spread))
        share = spread[0, 1] / spread[1, 1]
        within = np.sqrt(spread[0, 0] - share * spread[0, 1])
        chances = of_roll * _normal(rolls, roll, stddev[1])
        chances *= _normal(pitches, pitch + share * (rolls - roll), within)
    # How much likelier the lines are than if they meant nothing.
    lines = np.exp(likelihoods - likelihoods.max())
    lines /= (lines * of_roll).sum() / of_roll.sum()
    steps = np.arange(-5, 6)
    blur = np.exp(-((steps / _SYSTEMATIC) ** 2) / 2)
    lines = np.apply_along_axis(np.convolve, 0, lines, blur / blur.sum(), "same")
    by_edges = _peak(PITCHES_RAD, (of_roll * lines).sum(axis=1))
    by_people = _peak(PITCHES_RAD, chances.sum(axis=1))
    both = chances * ((1 - _MISLEADING) * lines + _MISLEADING)
    pitch, pitch_stddev = _peak(PITCHES_RAD, both.sum(axis=1))
    near = np.abs(PITCHES_RAD - pitch) <= _PEAK * (PITCHES_RAD[1] - PITCHES_RAD[0])
    roll, roll_stddev = _peak(ROLLS_RAD, both[near].sum(axis=0))
    if abs(roll) < _SURE * max(_LEVEL, roll_stddev):
        roll, roll_stddev = 0.0, float(np.hypot(roll, roll_stddev))
    # Lines that agree on several pitches show none.
    has_edges = by_edges[1] < FOUND_STDDEV
    uses_edges = has_edges and abs(by_edges[0] - pitch) < max(_TOLD, by_edges[1])
    if uses_edges:
        sources.append("the upright edges of the room")
    if shown is not None and by_people[1] < FOUND_STDDEV:
        sources.append("people who stand or walk" if shown.shows_feet else "people's bodies")
    apart = abs(by_edges[0] - by_people[0])
    is_asked = given is None and has_edges and shown is not None
    if is_asked and apart > max(_TOLD, _SURE * by_people[1]):
        remarks.append(
            f"the upright edges of the room show a camera pitch of {degrees_of(by_edges)}, and "
            f"people show {degrees_of(by_people)}; {degrees_of((pitch, pitch_stddev))} is used, so "
            "give --camera-pitch-deg if it is known"
        )
    if moves:
        pitch_stddev = float(np.hypot(pitch_stddev, _MOVING))
        remarks.append(
            "the background moves, so the camera does not stand still; leans and places are those "
            "of one mean camera, and unsure: use a tripod"
        )
    found = Value(pitch, pitch_stddev, FOUND if sources else USUAL, " and ".join(sources))
    if given is not None:
        if sources and abs(given[0] - pitch) > max(_TOLD, _SURE * np.hypot(pitch_stddev, given[1])):
            remarks.append(
                f"a camera pitch of {degrees_of(given)} is given and used, but "
                f"{' and '.join(sources)} show {degrees_of(found[:2])}; leave it out to use that"
            )
        found = Value(*given, GIVEN)
    turned = Value(roll, roll_stddev, FOUND if roll else USUAL)
    if roll_rad is not None:
        turned = Value(roll_rad, GIVEN_STDDEV, GIVEN)
    lens = lens_of(camera)
    height: Value | None = None
    distances: tuple[Distances | None, ...] = tuple(None for _ in people)
    if shown is not None:
        # What follows from the pitch and the roll that are known now.
        gain = shown.covariance[2:, :2] @ np.linalg.inv(shown.covariance[:2, :2])
        variances = np.array([found.stddev, turned.stddev]) ** 2
        tilt = (found.mean, 1e-3), (turned.mean, 1e-3)
        known = people_camera(people, statures_m, camera, *tilt, distance_m) or shown
        rest = known.covariance[2:, 2:] + (gain * variances) @ gain.T
        stddevs = np.sqrt(np.diag(rest))
        height = Value(float(known.values[2]), float(stddevs[0]), FOUND)
        if lens.origin == USUAL and stddevs[1] < _BETTER * camera.focal_stddev:
            by = "people who walk"
            if distance_m is not None:
                by = f"the given distance and {'the given' if statures_m[0] else 'a usual'} stature"
            lens = lens_of(
                camera, Value(float(np.exp(known.values[3])), float(stddevs[1]), FOUND, by)
            )
        share = found.stddev**2 / shown.covariance[0, 0]
        pairs = zip(known.distances, shown.distances, strict=True)
        distances = tuple(_by_pitch(one, other, share) for one, other in pairs)
        if given_m is not None and distance_m is None and distances[0] is not None:
            stature_m = statures_m[0] or USUAL_STATURE_M
            remarks += _contradiction(camera, distances[0], stature_m, given_m)
    camera_found = SceneCamera(lens, found, turned, height)
    return FoundCamera(camera_found, tuple(sources), tuple(remarks), distances, bool(moves))


def other_lens(
    people: Sequence[Sightings],
    statures_m: Sequence[float | None],
    camera: Camera,
    given: SceneCamera,
    away: float,
) -> float:
    """Return how much better another lens explains the floor than people who stand elsewhere do.

    They are seen farther ``away`` than in a given scene, as a logarithm, and with that lens would
    be where it has them. The height of the camera above the floor, which follows from the place,
    decides. Positive for another lens, in standard deviations; 0 without a floor. The other
    arguments are those of :func:`scene_camera`.
    """
    tilt, off_m, stddev_m = ((given.pitch_rad.mean, 1e-3), (0.0, 1e-3)), list[float](), math.inf
    for factor in (1.0, math.exp(-away)):
        lens = replace(camera, fx=factor * camera.fx, fy=factor * camera.fy)
        shown = people_camera(people, statures_m, lens, *tilt)
        if shown is None or given.height_m is None:
            return 0.0
        off_m.append(abs(float(shown.values[2]) - given.height_m.mean))
        stddev_m = min(stddev_m, math.sqrt(shown.covariance[2, 2]))
    return (off_m[0] - off_m[1]) / stddev_m


def in_scene(
    body: BodyModel,
    camera: SceneCamera,
    far: Distances | None = None,
    stature_m: float = USUAL_STATURE_M,
    moves: bool = False,
) -> BodyModel:
    """Return a body before the camera that was found, and that ``moves`` or not.

    If its own distance is not known, it is the first one of ``far``.
    """
    pitch, height = camera.pitch_rad, camera.height_m
    tilt = {"camera_pitch_rad": pitch.mean, "pitch_stddev_rad": pitch.stddev}
    body = body.with_values(**tilt, camera_moves=moves)
    if height is not None:
        body = body.with_values(camera_height_m=height.mean, height_stddev_m=height.stddev)
    if far is not None and "distance_m" in body.unknown:
        lowest_m, highest_m, *_ = PLACEMENT["distance_m"]
        distance_m = min(max(float(far.distances[0]) * stature_m, lowest_m), highest_m)
        body = body.with_values(distance_m=distance_m)
    return body


def camera_moves(people: Sequence[Sightings], pictures: Sequence[Picture], camera: Camera) -> bool:
    """Return whether points of the background move from image to image.

    Args:
        people: times and points of each person, whose surroundings are left out.
        pictures: images of the film.
        camera: intrinsics of the points.
    """
    if not people:
        # Without points, nothing tells the people from the background.
        return False
    shifted = pairs = 0
    sights = [sight for person in people for sight in person]
    for (time_s, before), (_, after) in pairwise(pictures):
        free = np.full(before.shape[:2], 255, np.uint8)
        for seen_s, points in sights:
            if abs(seen_s - time_s) < 0.5:
                _cover(free, points, camera)
        shift = background_shift(before, after, free)
        if shift is None:
            shift = _texture_shift(before, after, free)
        if shift is not None:
            pairs += 1
            shifted += shift > _SHIFT
    return pairs > 0 and shifted > _SHIFTED_PAIRS * pairs


def background_shift(
    before: NDArray[np.uint8], after: NDArray[np.uint8], free: NDArray[np.uint8]
) -> float | None:
    """Return how far most of the background has moved in an image, as a share of the longer side.

    A turn about the optical axis moves it by the root mean square over the image. ``free`` (H, W)
    is not 0 where no people are in the image ``before``. None if too few points are found again, or
    points of noise, which would hide a shift.
    """
    # The type of its third point argument lacks None.
    flow: Any = cv2.calcOpticalFlowPyrLK
    greys = brightness_of(before), brightness_of(after)
    height, width = greys[0].shape
    corners: Any = cv2.goodFeaturesToTrack(greys[0], 200, 0.02, 0.01 * width, mask=free)
    if corners is None:
        return None
    there, is_found, _ = flow(*greys, corners, None)
    back, is_back, _ = flow(greys[1], greys[0], there, None)
    same = np.linalg.norm(back - corners, axis=-1).ravel() < 1.0
    same &= (is_found.ravel() > 0) & (is_back.ravel() > 0)
    if same.sum() < _LEAST_POINTS:
        return None
    shifts = (there - corners)[same].reshape(-1, 2)
    # Where a turn of 1 rad about the middle moves each point.
    turns = (corners[same].reshape(-1, 2) - (width / 2, height / 2)) @ [(0.0, 1.0), (-1.0, 0.0)]
    moved, across = (each - np.median(each, axis=0) for each in (shifts, turns))
    roll = np.median(np.sum(moved * across, axis=1) / np.maximum(np.sum(across**2, axis=1), 1.0))
    still, rolled = (np.median(np.linalg.norm(moved - k * across, axis=1)) for k in (0.0, roll))
    if rolled > 0.5 * still:
        roll = 0.0
    shifts = shifts - roll * turns
    shift = np.median(shifts, axis=0)
    # Points of noise move, too, but not together.
    spread = float(np.median(np.linalg.norm(shifts - shift, axis=1)))
    roll_px = roll * math.hypot(width, height) / math.sqrt(12.0)
    length, side = float(np.linalg.norm([*shift, roll_px])), max(width, height)
    if length > 2 * spread:
        return float(length / side)
    return 0.0 if 2 * spread <= _SHIFT * side else None


def _texture_shift(
    before: NDArray[np.uint8], after: NDArray[np.uint8], free: NDArray[np.uint8]
) -> float | None:
    """Return :func:`background_shift` by all pixels, for walls without points that are found again.

    It is where the textures of both images correlate most; None if they do so by chance.
    """
    scale, rough = WORKING_SIZE[0] / max(free.shape), cv2.INTER_NEAREST
    mask = np.asarray(cv2.resize(free, None, fx=scale, fy=scale, interpolation=rough)) > 0

    def spectrum(image: NDArray[np.uint8]) -> NDArray[np.complex128]:
        small = cv2.resize(brightness_of(image), mask.shape[::-1], interpolation=cv2.INTER_AREA)
        # Edges of a person who moves count no more than a rough wall.
        texture = np.sign(small - blurred(np.asarray(small), mask, _TEXTURE_PX))
        return np.fft.rfft2(np.where(mask, texture, 0.0))

    alike = np.fft.irfft2(spectrum(after) * np.conj(spectrum(before)), mask.shape)
    if alike.max() <= _CLEARER * alike.std():
        return None
    peak = np.array(np.unravel_index(np.argmax(alike), mask.shape))
    return float(np.linalg.norm(np.minimum(peak, mask.shape - peak))) / WORKING_SIZE[0]


def _cover(free: NDArray[np.uint8], points: ImagePoints, camera: Camera) -> None:
    """Set the surroundings of a person to 0."""
    px = points.px
    if points.legs is not None:
        px = np.concatenate([px, points.legs.px])
    px = px[np.isfinite(px[:, 0])]
    if not len(px):
        return
    around = _AROUND * float(np.ptp(px[:, 1]))
    scale = np.array([free.shape[1] / camera.width, free.shape[0] / camera.height])
    left, top = np.maximum((px.min(axis=0) - around) * scale, 0.0).astype(int)
    right, bottom = np.maximum((px.max(axis=0) + around) * scale, 0.0).astype(int)
    free[top:bottom, left:right] = 0


def _peak(values: FloatArray, chances: FloatArray) -> tuple[float, float]:
    """Return where the chances of values have their peak, and the standard deviation there."""
    middle = int(np.argmax(chances))
    peak = slice(max(0, middle - _PEAK), middle + _PEAK + 1)
    mean = float(np.average(values[peak], weights=chances[peak]))
    away = np.abs(values - mean)
    order = np.argsort(away)
    within = np.cumsum(chances[order]) / chances.sum()
    return mean, float(np.interp(_WITHIN, within, away[order]))


def lens_of(camera: Camera, factor: Value | None = None) -> Value:
    """Return the field of view across the image, rad, for a factor of the focal length if found."""
    if factor is None:
        is_guessed = camera.focal_stddev > GUESSED
        factor = Value(1.0, camera.focal_stddev, USUAL if is_guessed else GIVEN)
    tangent = camera.width / 2 / (camera.fx * factor.mean)
    slope = 2 * tangent / (1 + tangent**2)
    return factor._replace(mean=2 * float(np.arctan(tangent)), stddev=slope * factor.stddev)


def _by_pitch(known: Distances | None, free: Distances | None, share: float) -> Distances | None:
    """Return distances with a ``known`` pitch as unsure as this pitch makes them.

    Those with a ``free`` pitch are unsure by one whose variance times ``share`` is the pitch's.
    """
    if known is None or free is None:
        return known
    by_pitch = share * max(free.stddev**2 - known.stddev**2, 0.0)
    return known._replace(stddev=math.sqrt(known.stddev**2 + by_pitch))


def _contradiction(
    camera: Camera, far: Distances, stature_m: float, distance_m: float
) -> Iterator[str]:
    """Yield what is said if a known lens shows the person elsewhere than a given distance."""
    shown_m = float(far.distances[0]) * stature_m
    stddev = np.hypot(far.stddev, DISTANCE_STDDEV)
    if abs(np.log(shown_m / distance_m)) > _SURE * stddev:
        fitting = lens_of(camera, Value(distance_m / shown_m, 0.0))
        yield (
            f"by field of view and stature the person is {shown_m:.1f} m away, and a distance of "
            f"{distance_m:.1f} m is given, so one of the three is wrong: a field of view of "
            f"{np.degrees(fitting.mean):.0f} degrees would agree; without --fov it is found"
        )


def degrees_of(value: tuple[Any, ...]) -> str:
    """Return mean and standard deviation of a pitch, rad, in words."""
    pitch, stddev = np.degrees(value[0]), np.degrees(value[1])
    word = "down" if pitch >= 0 else "up"
    return f"{abs(pitch):.0f} degrees {word} (standard deviation {stddev:.0f})"


def _normal(values: FloatArray, mean: float | FloatArray, stddev: float) -> FloatArray:
    density: FloatArray = np.exp(-(((values - mean) / stddev) ** 2) / 2) / stddev
    return density
