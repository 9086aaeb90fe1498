"""Low-pass and short gaps of results, and their velocities and accelerations.

The low-pass is a Butterworth filter of second order, forwards and backwards, so of fourth order and
without delay. As Winter corrects it for two passes ("Biomechanics and Motor Control of Human
Movement", 2009), a motion of the cut-off frequency keeps 1 / sqrt(2) of its amplitude. Values at
uneven stamps are first interpolated at even ones, the median step apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.isb_angles import ANATOMICAL_NAMES, anatomical_angles
from cardbox_tracker.person.legs import LEG_KEYPOINT_NAMES
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import JOINT_NAMES, STATE_NAMES, UNITS, KeypointState
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.recordings.result_table import (
    LEG_POINT_COLUMNS,
    PALM_COLUMNS,
    POINT_COLUMNS,
    RATE_COLUMNS,
    SMOOTHED,
    WRIST_COLUMNS,
    deviation_columns,
)
from cardbox_tracker.tracking.estimate import FILLED

LONGEST_GAP_S = 0.2
"""Time between two images up to which the gap between them is filled."""

AnyResults = TypeVar("AnyResults", bound=Results)

_ANGLES = {*(name for name in STATE_NAMES if UNITS[name] == "rad"), *WRIST_COLUMNS}
_POINTS = (*POINT_COLUMNS, *LEG_POINT_COLUMNS)
_FILTERED = {*STATE_NAMES, *_POINTS, *PALM_COLUMNS, *WRIST_COLUMNS}
# The values to which each deviation belongs.
_BY_DEVIATION: dict[str, tuple[str, ...]] = {
    name: (joint,) for name, joint in zip(deviation_columns(STATE_NAMES), STATE_NAMES, strict=True)
}
_DEVIATIONS = {of[0]: name for name, of in _BY_DEVIATION.items()}
_BY_DEVIATION |= {f"{name}_stddev_rad": (name,) for name in WRIST_COLUMNS}
_BY_DEVIATION |= {
    f"{name}_stddev_m": tuple(f"{name}_{axis}" for axis in "xyz") for name in LEG_KEYPOINT_NAMES
}
# The response of the low-pass decays to 1e-7 in three periods of the cut-off, or, since it rings at
# half the rate, of its distance from that.
_PERIODS = 3.0
_LEAST_HZ, _MOST = 0.01, 0.45


def amplitude(frequency_hz: FloatArray, cutoff_hz: float, rate_hz: float) -> FloatArray:
    """Return the share (n,) of the amplitude that the low-pass keeps at frequencies (n,), Hz."""
    share = np.tan(np.pi * frequency_hz / rate_hz) / np.tan(np.pi * cutoff_hz / rate_hz)
    return np.asarray(1.0 / (1.0 + (np.sqrt(2.0) - 1.0) * share**4))


def butterworth(values: FloatArray, cutoff_hz: float, rate_hz: float) -> FloatArray:
    """Return values (n,) at even times after the low-pass; both ends go on point-symmetrically."""
    around = int(np.ceil(_PERIODS * rate_hz / min(cutoff_hz, rate_hz / 2.0 - cutoff_hz)))
    longer = np.pad(values, around, "reflect", reflect_type="odd")
    frequency_hz = np.fft.rfftfreq(len(longer), 1.0 / rate_hz).astype(float)
    kept = amplitude(frequency_hz, cutoff_hz, rate_hz)
    found = np.fft.irfft(np.fft.rfft(longer) * kept, len(longer))
    return np.asarray(found[around : around + len(values)])


def low_passed(
    results: AnyResults, cutoff_hz: float, longest_gap_s: float = LONGEST_GAP_S
) -> AnyResults:
    """Return results whose short gaps are filled with straight lines, after the low-pass.

    Joints, points and palms are filtered each for itself; angles go on beyond half a turn.
    Deviations and states stay, and rates of the smoothing go. In a gap, the deviations grow by the
    error a t (T - t) / 2 of a line over the time T, with the root mean square of the acceleration
    as a.

    Args:
        results: of one person.
        cutoff_hz: from 0.01 Hz to 0.45 of the rate of the images.
        longest_gap_s: longest time between two images whose gap is filled. What is on the two sides
            of a longer one is filtered by itself.

    Raises:
        CardboxError: an argument is out of its range.
    """
    time_s, step_s = _times(results)
    if not _LEAST_HZ <= cutoff_hz <= _MOST / step_s:
        raise CardboxError(
            f"the cut-off is {cutoff_hz:g} Hz, expected {_LEAST_HZ} to {_MOST / step_s:.3g} Hz, "
            f"{_MOST} of the rate of the images; give one of this range"
        )
    if not longest_gap_s >= 0.0:
        raise CardboxError(f"the longest gap is {longest_gap_s:g} s; give 0 s or more")
    # Stamps of a gap of exactly this length may be rounded.
    longest_s = max(longest_gap_s + 1e-6, 1.5 * step_s)
    numbers = {name: of for name, of in results.numbers.items() if name not in RATE_COLUMNS}
    for name in _FILTERED & numbers.keys():
        values = numbers[name] = _continuous(name, numbers[name])
        known = np.flatnonzero(np.isfinite(values))
        for run in np.split(known, 1 + np.flatnonzero(np.diff(time_s[known]) > longest_s)):
            if len(run) > 1:
                inside = slice(run[0], run[-1] + 1)
                begin_s, end_s = time_s[run[[0, -1]]]
                even_s = np.linspace(begin_s, end_s, round((end_s - begin_s) / step_s) + 1)
                even = np.interp(even_s, time_s[run], values[run])
                smooth = butterworth(even, cutoff_hz, 1.0 / step_s)
                values[inside] = np.interp(time_s[inside], even_s, smooth)
    for palm in (PALM_COLUMNS[:3], PALM_COLUMNS[3:]):
        if numbers.keys() >= set(palm):
            length = np.linalg.norm([numbers[name] for name in palm], axis=0)
            numbers |= {name: numbers[name] / length for name in palm}
    for name in _BY_DEVIATION.keys() & numbers.keys():
        moved = np.stack([numbers[of] for of in _BY_DEVIATION[name]])
        numbers[name] = _grown(time_s, numbers[name], moved, longest_s)
    found = replace(results, numbers=numbers, cutoff_hz=cutoff_hz)
    postures = found.of(JOINT_NAMES)
    if numbers.keys() >= set(ANATOMICAL_NAMES):
        numbers |= zip(ANATOMICAL_NAMES, anatomical_angles(postures).T, strict=True)
    was_known = np.isfinite(results.of(JOINT_NAMES)).all(axis=1)
    is_filled = np.asarray(np.isfinite(postures).all(axis=1) & ~was_known)
    texts = {name: _filled(name, of, is_filled) for name, of in results.texts.items()}
    state = tuple(np.where(is_filled, FILLED, results.state).tolist())
    return replace(found, state=state, texts=texts)


def rates_of(results: Results) -> FloatArray:
    """Return the values (n, k) of ``RATE_COLUMNS``: those of the smoothing, if they are there.

    Otherwise they are differences of second order at the stamps, nan at both ends and beside gaps.
    Their deviations are those of independent errors in the images, of which smoothing and low-pass
    have left their share; those of keypoints are unknown.
    """
    if results.numbers.keys() & set(RATE_COLUMNS):
        return results.of(RATE_COLUMNS)
    time_s, step_s = _times(results)
    found = np.full((len(time_s), len(RATE_COLUMNS)), np.nan)
    if len(time_s) < 3:
        return found
    before, after = np.diff(time_s)[:-1], np.diff(time_s)[1:]
    both = before + after
    is_gap = np.maximum(before, after) > max(LONGEST_GAP_S, 1.5 * step_s)
    turn = np.linspace(0.0, np.pi, 500, endpoint=False)
    frequency_hz, rate_hz = turn / (2.0 * np.pi * step_s), 1.0 / step_s
    kept = amplitude(frequency_hz, results.cutoff_hz, rate_hz) if results.cutoff_hz else 1.0
    smoothed_hz = results.of([SMOOTHED])[:, 0]
    if np.isfinite(smoothed_hz).any():
        kept = kept / (1.0 + (frequency_hz / np.nanmedian(smoothed_hz)) ** 4)
    weights = {
        "velocity": (-after / before / both, 1 / before - 1 / after, before / after / both),
        "acceleration": (2 / before / both, -2 / before / after, 2 / after / both),
    }
    gains = {"velocity": np.sin(turn), "acceleration": 1.0 - np.cos(turn)}
    columns = iter(found[1:-1].T)
    for name in (*STATE_NAMES, *POINT_COLUMNS):
        values = _continuous(name, results.of([name])[:, 0])
        for rate, weight in weights.items():
            next(columns)[:] = np.where(is_gap, np.nan, _weighted(weight, values))
            stddev = next(columns)
            if name in _DEVIATIONS:
                variance = results.deviations_of([name])[:, 0] ** 2
                share = np.linalg.norm(kept * gains[rate]) / np.linalg.norm(gains[rate])
                variance = _weighted([one**2 for one in weight], variance)
                stddev[:] = np.where(is_gap, np.nan, share * np.sqrt(variance))
    return found


def _weighted(weights: Sequence[FloatArray], values: FloatArray) -> FloatArray:
    """Return sums (n - 2,) of each value (n,) with the one before and after it."""
    return np.asarray(
        weights[0] * values[:-2] + weights[1] * values[1:-1] + weights[2] * values[2:]
    )


def _times(results: Results) -> tuple[FloatArray, float]:
    """Return seconds since the first image, (n,), by the stamps, and their median step."""
    time_s = (results.stamp_ns - results.stamp_ns[:1]) / 1e9
    return time_s, float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0


def _continuous(name: str, values: FloatArray) -> FloatArray:
    """Return a copy of the values (n,) of a column, without jumps if it is an angle."""
    found, is_known = np.array(values), np.isfinite(values)
    if name in _ANGLES:
        found[is_known] = np.unwrap(found[is_known])
    return found


def _grown(
    time_s: FloatArray, deviations: FloatArray, moved: FloatArray, longest_s: float
) -> FloatArray:
    """Return deviations (n,) of values (k, n), also in the gaps that were filled."""
    found, known = np.array(deviations), np.flatnonzero(np.isfinite(deviations))
    speed = np.diff(moved, axis=1) / np.diff(time_s)
    steps_s = (time_s[2:] - time_s[:-2]) / 2.0
    acceleration = np.linalg.norm(np.diff(speed, axis=1) / steps_s, axis=0)
    acceleration = acceleration[np.isfinite(acceleration)]
    a = np.sqrt(np.mean(acceleration**2)) if len(acceleration) else 0.0
    before = np.flatnonzero(np.diff(known) > 1)
    for first, last in zip(known[before], known[before + 1], strict=True):
        if time_s[last] - time_s[first] <= longest_s:
            t = time_s[first + 1 : last]
            line = np.interp(t, time_s[[first, last]], deviations[[first, last]])
            error = a * (t - time_s[first]) * (time_s[last] - t) / 2.0
            found[first + 1 : last] = np.hypot(line, error)
    return found


def _filled(name: str, texts: Sequence[str], is_filled: NDArray[np.bool_]) -> tuple[str, ...]:
    """Return the texts of a column; keypoints are uncertain in filled images, or still hidden."""
    found = list(texts)
    for image in np.flatnonzero(is_filled) if name != "state" and name.endswith("_state") else ():
        if before := found[image - 1]:
            is_hidden = before == KeypointState.HIDDEN
            found[image] = before if is_hidden else str(KeypointState.UNCERTAIN)
    return tuple(found)
