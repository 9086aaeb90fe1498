"""Pitch and roll of a camera from the image of a person who stands upright before it.

The middles of ears, shoulders, hips, knees and ankles of a standing person lie near a vertical line
at known shares of the stature, and the nose before it. The direction of the line in the image gives
the roll. A camera that looks down sees the lower parts further away, so the spacing of the points
gives the pitch, as surely as people's proportions are alike: to about 6 degrees where the ankles
are seen, and hardly where only the trunk is. A Gauss-Newton fit finds pitch, roll and place
together, and how far legs and trunk lean, as far as people who stand upright do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.detectors.pose_network import LANDMARKS, Detection
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
    "nose": Level(0.915, 0.09, 0.016),
    "ear": Level(0.932, 0.045, 0.012),
    "shoulder": Level(0.811, 0.0, 0.011),
    "hip": Level(0.507, 0.0, 0.013),
    "knee": Level(0.283, 0.01, 0.014),
    "ankle": Level(0.063, 0.0, 0.010),
}
"""Where MediaPipe marks the joints of people who stand upright, beside the lines of legs and trunk;
means of rendered and real people."""

USUAL_PITCH, PITCH_PRIOR = np.radians(8.0), np.radians(11.0)
"""Mean and standard deviation of the pitch of cameras before anything is seen, rad."""
_ROLL_PRIOR = np.radians(6.0)
# Mean and standard deviation of the forward lean of legs and trunk, rad; deviation of a joint
# forwards and aside, statures.
_LEGS, _TRUNK = np.radians((0.5, 4.0)), np.radians((0.0, 2.5))
_FORWARD, _SIDE = 0.012, 0.02
FOUND_STDDEV = float(np.radians(8.5))
"""Standard deviation from which on a pitch is mostly that of most cameras, and not found, rad."""
# A line that is further from upright is that of a person who leans, rad. A roll below the second
# limit, or below so many standard deviations, can be the person's own.
_LEANS, _LEAST_ROLL, _SURE_ROLL = np.radians(10.0), np.radians(2.0), 2.0
# Three standard deviations: a fit with more explains a person who sits or bows, rad.
_MOST_PITCH = 3 * PITCH_PRIOR
# Root mean square of the residuals, in standard deviations, of a person who stands upright.
_MOST_RESIDUAL = 2.5
_LEAST_LEVELS, _LEAST_SCORE = 3, 0.5
_ROUNDS, _STEP, _LONGEST_STEP = 30, 1e-5, 0.3
# Logarithms of the nearest and the farthest distance, statures.
_NEAREST, _FARTHEST = np.log((0.3, 20.0))
# Parameters of the fit: pitch, roll, place aside, logarithm of the distance, height of the floor,
# lean of legs and trunk; lengths are in statures.
_PITCH, _ROLL, _ASIDE, _DISTANCE, _FLOOR, _LEG_LEAN, _TRUNK_LEAN = range(7)
_PRIORS = 4


class StandingCamera(NamedTuple):
    """Result of the fit.

    Attributes:
        pitch_rad: downward pitch.
        pitch_stddev_rad: its standard deviation.
        line_roll_rad: clockwise turn of the camera about its axis, seen from behind it, if the
            person does not lean aside.
        roll_stddev_rad: its standard deviation.
        distance: level distance of the person, in statures.
    """

    pitch_rad: float
    pitch_stddev_rad: float
    line_roll_rad: float
    roll_stddev_rad: float
    distance: float

    @property
    def is_pitch_found(self) -> bool:
        """Whether the points themselves show the pitch, as those of a whole person do."""
        return bool(self.pitch_stddev_rad < FOUND_STDDEV)

    @property
    def roll_rad(self) -> float:
        """The roll; 0 if it is so small that the person may have leaned."""
        is_sure = abs(self.line_roll_rad) > max(_LEAST_ROLL, _SURE_ROLL * self.roll_stddev_rad)
        return self.line_roll_rad if is_sure else 0.0


def middles(images: Sequence[Detection]) -> dict[str, FloatArray]:
    """Return the middle (2,), px, of each of ``LEVELS`` that is seen in half of the images."""
    found: dict[str, FloatArray] = {}
    for level in LEVELS:
        names = (level,) if level == "nose" else (f"left_{level}", f"right_{level}")
        pair = [LANDMARKS.index(name) for name in names]
        seen = [
            one.points_px[pair].mean(axis=0)
            for one in images
            if one.scores[pair].min() >= _LEAST_SCORE
        ]
        if 2 * len(seen) > len(images):
            found[level] = np.median(seen, axis=0)
    return found


def standing_camera(
    points: Mapping[str, FloatArray],
    camera: Camera,
    prior: tuple[float, float] = (USUAL_PITCH, PITCH_PRIOR),
) -> StandingCamera | None:
    """Return pitch and roll of the camera; None if the points are not those of a standing person.

    Args:
        points: middles (2,), px, of pairs of ``LEVELS``, at least three.
        camera: intrinsics of the image; its pitch is not used.
        prior: mean and standard deviation of the pitch before the points are seen, rad.
    """
    names = [name for name in LEVELS if name in points]
    if len(names) < _LEAST_LEVELS:
        return None
    levels = np.array([LEVELS[name] for name in names])
    seen = np.array([points[name] for name in names])
    rays = camera.rays(seen)[:, :2]
    below = rays[-1, 1] - rays[0, 1]
    if below <= 0.0:
        return None
    distance = (levels[0, 0] - levels[-1, 0]) / below
    floor = -np.mean(rays[:, 1] * distance + levels[:, 0])
    aside = rays[:, 0].mean() * distance
    fit = np.array([prior[0], 0.0, aside, np.log(distance), floor, _LEGS[0], _TRUNK[0]])
    for _ in range(_ROUNDS):
        residuals = _residuals(fit, levels, rays, prior)
        moved = [_residuals(fit + step, levels, rays, prior) for step in _STEP * _EYE]
        jacobian = (np.array(moved) - residuals).T / _STEP
        step = np.linalg.lstsq(jacobian, -residuals, rcond=None)[0]
        fit = fit + np.clip(step, -_LONGEST_STEP, _LONGEST_STEP)
        if np.abs(step).max() < _STEP**2:
            break
    wrong = float(np.sqrt(np.mean(_residuals(fit, levels, rays, prior)[:-_PRIORS] ** 2)))
    # Values that are not finite are refused, too.
    is_plausible = (
        abs(fit[_ROLL]) < _LEANS
        and abs(fit[_PITCH] - prior[0]) < _MOST_PITCH
        and _NEAREST < fit[_DISTANCE] < _FARTHEST
    )
    if not (wrong < _MOST_RESIDUAL and is_plausible):
        return None
    stddevs = np.sqrt(np.linalg.inv(jacobian.T @ jacobian).diagonal())
    return StandingCamera(
        float(fit[_PITCH]),
        float(stddevs[_PITCH]),
        float(fit[_ROLL]),
        float(stddevs[_ROLL]),
        float(np.exp(fit[_DISTANCE])),
    )


_EYE = np.eye(7)


def _residuals(
    fit: FloatArray, levels: FloatArray, rays: FloatArray, prior: tuple[float, float]
) -> FloatArray:
    """Differences from the points and from the priors, in standard deviations."""
    distance = np.exp(fit[_DISTANCE])
    heights, hip = levels[:, 0], LEVELS["hip"].height
    forward = (
        levels[:, 1]
        + fit[_LEG_LEAN] * (np.minimum(heights, hip) - LEVELS["ankle"].height)
        + fit[_TRUNK_LEAN] * np.maximum(heights - hip, 0.0)
    )
    # Optical axes of a level camera: right, down, forward.
    there = np.column_stack(
        [
            np.full(len(levels), fit[_ASIDE]),
            -(fit[_FLOOR] + heights),
            distance - forward,
        ]
    )
    steep = there[:, 1] / np.maximum(there[:, 2], 1e-3)
    c, s = np.cos(fit[_PITCH]), np.sin(fit[_PITCH])
    down, ahead = c * there[:, 1] - s * there[:, 2], s * there[:, 1] + c * there[:, 2]
    # A camera that is turned clockwise sees the world turned the other way.
    c, s = np.cos(fit[_ROLL]), np.sin(fit[_ROLL])
    across, down = c * there[:, 0] + s * down, -s * there[:, 0] + c * down
    seen = np.column_stack([across, down]) / np.maximum(ahead, 1e-3)[:, None]
    stddevs = np.column_stack(
        [np.full(len(levels), _SIDE), np.hypot(levels[:, 2], _FORWARD * steep)]
    )
    wrong = (seen - rays) * distance / stddevs
    priors = (
        (fit[_PITCH] - prior[0]) / prior[1],
        fit[_ROLL] / _ROLL_PRIOR,
        (fit[_LEG_LEAN] - _LEGS[0]) / _LEGS[1],
        (fit[_TRUNK_LEAN] - _TRUNK[0]) / _TRUNK[1],
    )
    return np.concatenate([wrong.ravel(), priors])
