"""Pitch and roll of a camera from the image of a person who stands upright before it.

The middles of ears, shoulders, hips, knees and ankles of a standing person lie on a vertical line
at known shares of the stature. The direction of the line in the image gives the roll. A camera that
looks down sees the lower parts further away, so the spacing of the points gives the pitch, as
surely as people's proportions are alike: to about 5 degrees where the ankles are seen, and not at
all where only the trunk is. A Gauss-Newton fit finds pitch, roll and place together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.person.sizes import FloatArray


class Level(NamedTuple):
    """One pair of joints, as shares of the stature.

    Attributes:
        height: height above the floor.
        forward: distance of the pair's middle before the ankles, of a person facing the camera.
        stddev: standard deviation among people who stand upright.
    """

    height: float
    forward: float
    stddev: float


LEVELS: dict[str, Level] = {
    "ear": Level(0.935, 0.03, 0.02),
    "shoulder": Level(0.81, 0.0, 0.015),
    "hip": Level(0.515, 0.01, 0.015),
    "knee": Level(0.28, 0.015, 0.015),
    "ankle": Level(0.045, 0.0, 0.01),
}
"""Heights are those of Drillis & Contini, 1966, moved to the points that detectors mark."""

# Standard deviations of pitch and roll before anything is seen, rad.
_PITCH_PRIOR, _ROLL_PRIOR = np.radians(12.0), np.radians(6.0)
# A pitch that is found less surely than this is no better than none, rad.
_SURE = np.radians(7.0)
# A line that is further from upright is that of a person who leans, rad. A roll below the second
# limit, or below so many standard deviations, can be the person's own.
_LEANS, _LEAST_ROLL, _SURE_ROLL = np.radians(10.0), np.radians(2.0), 2.0
# Three standard deviations: a fit with more explains a person who sits or bows, rad.
_MOST_PITCH = 3 * _PITCH_PRIOR
# Root mean square of the residuals, in standard deviations, of a person who stands upright.
_MOST_RESIDUAL = 2.5
_LEAST_LEVELS, _LEAST_SCORE = 3, 0.5
_ROUNDS, _STEP, _LONGEST_STEP = 30, 1e-5, 0.3
# Parameters of the fit: pitch, roll, place aside, logarithm of the distance, height of the floor;
# lengths are in statures.
_PITCH, _ROLL, _ASIDE, _DISTANCE, _FLOOR = range(5)


class StandingCamera(NamedTuple):
    """Result of the fit.

    Attributes:
        pitch_rad: downward pitch; 0 if the points do not show it.
        pitch_stddev_rad: its standard deviation, whether it was used or not.
        roll_rad: clockwise turn of the camera about its axis, seen from behind it; 0 if it is so
            small that the person may have leaned.
        distance: level distance of the person, in statures.
        is_pitch_found: whether the points show the pitch.
    """

    pitch_rad: float
    pitch_stddev_rad: float
    roll_rad: float
    distance: float
    is_pitch_found: bool


def middles(
    images: Sequence[tuple[Mapping[str, FloatArray], Mapping[str, float]]],
) -> dict[str, FloatArray]:
    """Return the middle (2,), px, of each pair of joints that is seen in half of the images.

    Args:
        images: points (2,), px, and their scores, 0 to 1, by name, such as ``left_ear``.
    """
    found: dict[str, FloatArray] = {}
    for level in LEVELS:
        pair = f"left_{level}", f"right_{level}"
        seen = [
            (points[pair[0]] + points[pair[1]]) / 2
            for points, scores in images
            if min(scores[name] for name in pair) >= _LEAST_SCORE
        ]
        if 2 * len(seen) > len(images):
            found[level] = np.median(seen, axis=0)
    return found


def standing_camera(points: Mapping[str, FloatArray], camera: Camera) -> StandingCamera | None:
    """Return pitch and roll of the camera; None if the points are not those of a standing person.

    Args:
        points: middles (2,), px, of pairs of ``LEVELS``, at least three.
        camera: intrinsics of the image; its pitch is not used.
    """
    names = [name for name in LEVELS if name in points]
    if len(names) < _LEAST_LEVELS:
        return None
    levels = np.array([LEVELS[name] for name in names])
    seen = np.array([points[name] for name in names])
    rays: FloatArray = (seen - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    below = rays[-1, 1] - rays[0, 1]
    if below <= 0.0:
        return None
    distance = (levels[0, 0] - levels[-1, 0]) / below
    floor = -np.mean(rays[:, 1] * distance + levels[:, 0])
    fit = np.array([0.0, 0.0, rays[:, 0].mean() * distance, np.log(distance), floor])
    for _ in range(_ROUNDS):
        residuals = _residuals(fit, levels, rays)
        jacobian = np.column_stack(
            [(_residuals(fit + step, levels, rays) - residuals) / _STEP for step in _STEP * _EYE]
        )
        step = np.linalg.lstsq(jacobian, -residuals, rcond=None)[0]
        fit = fit + np.clip(step, -_LONGEST_STEP, _LONGEST_STEP)
        if np.abs(step).max() < _STEP**2:
            break
    wrong = float(np.sqrt(np.mean(_residuals(fit, levels, rays) ** 2)))
    # Values that are not finite are refused, too.
    is_plausible = abs(fit[_ROLL]) < _LEANS and abs(fit[_PITCH]) < _MOST_PITCH
    if not (wrong < _MOST_RESIDUAL and is_plausible):
        return None
    stddevs = np.sqrt(np.linalg.inv(jacobian.T @ jacobian).diagonal())
    is_found = bool(stddevs[_PITCH] < _SURE)
    is_rolled = abs(fit[_ROLL]) > max(_LEAST_ROLL, _SURE_ROLL * stddevs[_ROLL])
    return StandingCamera(
        float(fit[_PITCH]) if is_found else 0.0,
        float(stddevs[_PITCH]),
        float(fit[_ROLL]) if is_rolled else 0.0,
        float(np.exp(fit[_DISTANCE])),
        is_found,
    )


_EYE = np.eye(5)


def _residuals(fit: FloatArray, levels: FloatArray, rays: FloatArray) -> FloatArray:
    """Differences from the points and from the priors, in standard deviations."""
    distance = np.exp(fit[_DISTANCE])
    # Optical axes of a level camera: right, down, forward.
    there = np.column_stack(
        [
            np.full(len(levels), fit[_ASIDE]),
            -(fit[_FLOOR] + levels[:, 0]),
            distance - levels[:, 1],
        ]
    )
    c, s = np.cos(fit[_PITCH]), np.sin(fit[_PITCH])
    down, ahead = c * there[:, 1] - s * there[:, 2], s * there[:, 1] + c * there[:, 2]
    # A camera that is turned clockwise sees the world turned the other way.
    c, s = np.cos(fit[_ROLL]), np.sin(fit[_ROLL])
    across, down = c * there[:, 0] + s * down, -s * there[:, 0] + c * down
    seen = np.column_stack([across, down]) / np.maximum(ahead, 1e-3)[:, None]
    wrong = (seen - rays) * distance / levels[:, 2:3]
    priors = fit[_PITCH] / _PITCH_PRIOR, fit[_ROLL] / _ROLL_PRIOR
    return np.concatenate([wrong.ravel(), priors])
