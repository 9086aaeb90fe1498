"""Pitch and roll of a camera from all that shows them, with their standard deviations.

Vertical edges of the room show them best, and a person who stands upright shows them everywhere.
Both are combined by Bayes' rule on a grid. Lines can mislead, such as those of leaning things, so
with some probability they mean nothing; then the person and what is usual decide.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cardbox_tracker.measuring.room_edges import PITCHES_RAD, ROLLS_RAD
from cardbox_tracker.measuring.standing_camera import (
    PITCH_PRIOR,
    USUAL_PITCH,
    StandingCamera,
)
from cardbox_tracker.person.sizes import FloatArray

# Standard deviations of the roll of cameras that stand level, and of others; share of the others.
_LEVEL, _ROLLED, _ROLLED_SHARE = np.radians(1.0), np.radians(6.0), 0.1
# Standard deviation of how far people who stand lean aside, rad.
_PERSON = np.radians(3.0)
# Probability that lines mean nothing, and if they are parallel to the columns of the image, since
# screens, pictures and bars are so, too.
_MISLEADING, _PARALLEL_MISLEADING = 0.15, 0.5
# Systematic error of a pitch from edges, in steps of the grid; half of the width of its peak.
_SYSTEMATIC, _PEAK = 1.5, 6
# Chance that a pitch is within one standard deviation.
_WITHIN = 0.68
# Gain of the likelihood from which edges are named as a source.
_SHOWN = 3.0
# A roll below the first limit, or below so many standard deviations, can be a chance.
_LEAST_ROLL, _SURE_ROLL = np.radians(1.0), 2.0


class Tilt(NamedTuple):
    """Pitch and roll of a camera.

    Attributes:
        pitch_rad: downward pitch.
        pitch_stddev_rad: its standard deviation; it is within this with a chance of 68 %.
        roll_rad: clockwise turn about the axis, seen from behind the camera; 0 if it is not sure.
        has_edges: whether edges of the room show it.
    """

    pitch_rad: float
    pitch_stddev_rad: float
    roll_rad: float
    has_edges: bool


def camera_tilt(likelihoods: FloatArray, standing: StandingCamera | None) -> Tilt:
    """Return pitch and roll.

    Args:
        likelihoods: of the lines, see :func:`~.room_edges.edge_likelihoods`.
        standing: what a person who stands upright shows; None without one.
    """
    pitches, rolls = np.meshgrid(PITCHES_RAD, ROLLS_RAD, indexing="ij")
    roll_prior = (1 - _ROLLED_SHARE) * _normal(rolls, 0.0, _LEVEL)
    roll_prior += _ROLLED_SHARE * _normal(rolls, 0.0, _ROLLED)
    if standing is None:
        person = _normal(pitches, USUAL_PITCH, PITCH_PRIOR)
    else:
        # Who leans aside leans forwards or backwards, too.
        lean = standing.line_roll_rad
        person = _normal(pitches, standing.pitch_rad, np.hypot(standing.pitch_stddev_rad, lean))
        person *= _normal(rolls, lean, np.hypot(standing.roll_stddev_rad, _PERSON))
    # How much likelier the lines are than if they meant nothing.
    lines = np.exp(likelihoods - likelihoods.max())
    best = np.unravel_index(np.argmax(np.log(roll_prior) + likelihoods), lines.shape)
    lines /= (lines * roll_prior).sum() / roll_prior.sum()
    steps = np.arange(-5, 6)
    blur = np.exp(-((steps / _SYSTEMATIC) ** 2) / 2)
    lines = np.apply_along_axis(np.convolve, 0, lines, blur / blur.sum(), "same")
    one_deg = np.radians(1.0)
    is_parallel = abs(pitches[best]) < one_deg and abs(rolls[best]) < one_deg
    misleading = _PARALLEL_MISLEADING if is_parallel else _MISLEADING
    chances = person * roll_prior * ((1 - misleading) * lines + misleading)
    of_pitch = chances.sum(axis=1) / chances.sum()
    middle = int(np.argmax(of_pitch))
    peak = slice(max(0, middle - _PEAK), middle + _PEAK + 1)
    pitch = float(np.average(PITCHES_RAD[peak], weights=of_pitch[peak]))
    away = np.abs(PITCHES_RAD - pitch)
    order = np.argsort(away)
    pitch_stddev = float(np.interp(_WITHIN, np.cumsum(of_pitch[order]), away[order]))
    near = chances[peak].sum(axis=0) / chances[peak].sum()
    roll = float(near @ ROLLS_RAD)
    roll_stddev = float(np.sqrt(near @ (ROLLS_RAD - roll) ** 2))
    has_edges = bool(likelihoods.max() - np.median(likelihoods) > _SHOWN)
    if not has_edges and standing is not None:
        roll = standing.roll_rad
    elif abs(roll) < max(_LEAST_ROLL, _SURE_ROLL * roll_stddev):
        roll = 0.0
    return Tilt(pitch, pitch_stddev, roll, has_edges)


def _normal(values: FloatArray, mean: float, stddev: float) -> FloatArray:
    density: FloatArray = np.exp(-(((values - mean) / stddev) ** 2) / 2) / stddev
    return density
