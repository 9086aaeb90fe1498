"""Errors and shaking of results by smoothing, lag and low-pass (``docs/export.md``).

    python -m lab.tools.low_pass SESSION... [--rates SESSION...] [--seeds 3] [--output PAGE.md]

Each session is tracked as a film with field of view, stature and detector. Shape and place are
errors of the keypoints; the acceleration is that of the hands, by second differences, in images
that the reference and the results have. The reference after the same low-pass shows what is lost of
the motion. Velocities and accelerations of the hands of ``--rates``, whose reference has to be
exact, are compared with derivatives of the spline through it. The tables go between the marks of
the page.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from cardbox_tracker.commands.request import TrackingOptions
from cardbox_tracker.commands.tracking import track
from cardbox_tracker.commands.tracking_request import tracking_request
from cardbox_tracker.common.files import write_file
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES
from cardbox_tracker.recordings.result_reader import KeptResults, Results
from cardbox_tracker.recordings.result_table import POINT_COLUMNS, RATE_COLUMNS
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.recordings.smoothing import low_passed, rates_of
from cardbox_tracker.search.doubt import FAR_M, HANDS
from cardbox_tracker.tracking.estimate import TRACKING, Estimate
from cardbox_tracker.tracking.smoother import Smoother, Smoothing
from cardbox_tracker.tracking.tracker import Tracker
from lab.evaluation.films import Film, make_film
from lab.pages import replaced, table
from lab.tools.ways import shape_and_place_cm

MARKS = tuple((f"<!-- {name} -->", f"<!-- /{name} -->") for name in ("low-pass", "lags", "rates"))
CUTOFF_HZ = 4.0
LAGS_S = 0.0, 0.1, 0.2, 0.5
_EDGE = 3  # images at both ends of a spline, which do not count


def figures(found_m: FloatArray, true_m: FloatArray, stamps_ns: FloatArray) -> FloatArray:
    """Return shape and place, cm, and acceleration of the hands, m/s², (3,).

    Args:
        found_m: keypoints (n, 6, 3).
        true_m: the reference in the same images, (n, 6, 3), nan where they do not count.
        stamps_ns: of the images, (n,).
    """
    steps_s = np.diff(stamps_ns) / 1e9
    is_even: NDArray[np.bool_] = np.asarray(np.abs(steps_s / np.median(steps_s) - 1.0) < 0.2)
    counted_m = np.where(np.isfinite(true_m), found_m, np.nan)[:, HANDS]
    second = np.diff(counted_m, 2, axis=0) / np.median(steps_s) ** 2
    second[~(is_even[1:] & is_even[:-1])] = np.nan
    hands = np.sqrt(np.nanmean(np.sum(second**2, axis=2)))
    return np.array([*shape_and_place_cm(found_m - true_m), hands])


class Measured(NamedTuple):
    """Means over seeds of one session.

    Rows are as live, smoothed, and both after the low-pass; columns are :func:`figures`, and the
    share of the images with the state ``tracking``, %, with a joint beyond 30 cm, place included.
    """

    ours: FloatArray  #: (4, 4)
    of_reference: FloatArray  #: (4, 4)
    by_lag: FloatArray  #: :func:`figures` with each of ``LAGS_S``, (4, 3)


def measure(folder: Path, seeds: Iterable[int]) -> Measured:
    """Track one session with each seed, and return the figures."""
    with TemporaryDirectory() as made:
        film = make_film(folder, "across", Path(made) / "film.mp4")
        runs = [_runs(film, seed) for seed in seeds]
    stamps_ns, every_m = np.array(film.stamps_ns), _true_m(film)
    # The low-pass needs more than two images of a period.
    cutoff_hz = min(CUTOFF_HZ, 0.4e9 / float(np.median(np.diff(stamps_ns))))
    found, by_lag = [], []
    for smoothed, *lags in runs:
        true_m = np.where(np.isfinite(_keypoints_m(lags[0])), every_m, np.nan)
        columns = dict(zip(POINT_COLUMNS, true_m.reshape(len(true_m), -1).T, strict=True))
        reference = replace(lags[0], numbers=columns)
        for pair in ((lags[0], smoothed), (reference, reference)):
            every = [*pair, *(low_passed(one, cutoff_hz) for one in pair)]
            found.append([_figures(one, true_m, stamps_ns) for one in every])
        by_lag.append([figures(_keypoints_m(one), true_m, stamps_ns) for one in lags])
    ours, of_reference = np.array(found).reshape(len(runs), 2, 4, 4).mean(axis=0)
    return Measured(ours, of_reference, np.mean(by_lag, axis=0))


def rates_within(folder: Path, seeds: Iterable[int]) -> FloatArray:
    """Return how fast hands are and how well that is known, (2, 4), velocity, then acceleration.

    Root mean squares of the coordinates of the reference and of the errors, m and s, and the shares
    of the errors within one and two deviations, %; means over seeds.
    """
    with TemporaryDirectory() as made:
        film = make_film(folder, "across", Path(made) / "film.mp4")
        smoothed = [_runs(film, seed)[0] for seed in seeds]
    time_s, true_m = np.array(film.stamps_ns) / 1e9, _true_m(film)[:, HANDS].reshape(-1, 6)
    is_known: NDArray[np.bool_] = np.asarray(np.isfinite(true_m).all(axis=1))
    steps_s = np.diff(time_s)
    is_close: NDArray[np.bool_] = np.asarray(steps_s < 1.5 * np.median(steps_s))
    is_next = np.logical_and(is_close, np.logical_and(is_known[1:], is_known[:-1]))
    begins = 1 + np.flatnonzero(np.logical_not(is_next))
    true = np.full((2, *true_m.shape), np.nan)
    for run in np.split(np.arange(len(time_s)), begins):
        inside = run[_EDGE:-_EDGE]
        if len(inside):
            spline = CubicSpline(time_s[run], true_m[run])
            true[:, inside] = [spline(time_s[inside], order) for order in (1, 2)]
    hands = [POINT_COLUMNS[3 * hand + axis] for hand in HANDS for axis in range(3)]
    found = []
    for results in smoothed:
        columns = dict(zip(RATE_COLUMNS, rates_of(results).T, strict=True))
        for rate, of in zip(("velocity", "acceleration"), true, strict=True):
            unit = {"velocity": "m_s", "acceleration": "m_s2"}[rate]
            error = np.stack([columns[f"{name}_{rate}_{unit}"] for name in hands], axis=1) - of
            stddev = np.stack([columns[f"{name}_{rate}_stddev_{unit}"] for name in hands], axis=1)
            is_both = np.isfinite(error) & np.isfinite(stddev)
            off, sigma = np.abs(error[is_both]), stddev[is_both]
            shares = (100.0 * np.mean(off <= k * sigma) for k in (1, 2))
            found.append([np.std(of[is_both]), np.sqrt(np.mean(off**2)), *shares])
    return np.asarray(np.mean(np.reshape(found, (len(smoothed), 2, 4)), axis=0))


def _true_m(film: Film) -> FloatArray:
    """Return the keypoints of the reference, (n, 6, 3); nan in images that it lacks."""
    pairs = zip(film.session.stamps_ns.tolist(), film.session.keypoints_m, strict=True)
    by_stamp, unknown = dict(pairs), np.full((6, 3), np.nan)
    return np.array([by_stamp.get(stamp_ns, unknown) for stamp_ns in film.stamps_ns])


def _runs(film: Film, seed: int) -> list[Results]:
    """Return the results of a film, smoothed, and as live tracking gives them with ``LAGS_S``."""
    hows = [Smoothing(has_rates=True), *(Smoothing(lag_s, every_s=0.0) for lag_s in LAGS_S)]
    has = {"has_points": True, "is_smoothed": True, "has_rates": True}
    kept = [KeptResults(film.path, **has) for _ in hows]
    smoothers = [Smoother[tuple[RecordedFrame, Tracker]](how) for how in hows]

    def tell(
        keep: KeptResults,
        seen: Iterable[tuple[tuple[RecordedFrame, Tracker], Sequence[Estimate]]],
    ) -> None:
        for (frame, tracker), (estimate,) in seen:
            keep(frame, estimate, tracker)

    def observe(frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        given = (frame, tracker), frame.stamp_ns, [estimate], [tracker.body]
        for keep, smoother in zip(kept, smoothers, strict=True):
            tell(keep, smoother.add(*given))

    given: dict[str, Any] = {"detector": "mediapipe", "causal": True, "seed": seed}
    given |= {"fov_deg": round(film.fov_deg, 1), "stature_m": film.session.truth.stature_m}
    track(tracking_request(TrackingOptions(film.path, **given)), (observe,), lambda _: None)
    for keep, smoother in zip(kept, smoothers, strict=True):
        tell(keep, smoother.finish())
    return [keep.results()[1] for keep in kept]


def _figures(results: Results, true_m: FloatArray, stamps_ns: FloatArray) -> FloatArray:
    found_m = _keypoints_m(results)
    sure = np.array(results.state) == TRACKING
    off_m = np.linalg.norm(found_m - true_m, axis=2).max(axis=1)[sure]
    off_m = off_m[np.isfinite(off_m)]
    wrong = 100.0 * np.mean(off_m > FAR_M) if len(off_m) else 0.0
    return np.array([*figures(found_m, true_m, stamps_ns), wrong])


def _keypoints_m(results: Results) -> FloatArray:
    return results.of(POINT_COLUMNS).reshape(-1, len(KEYPOINT_NAMES), 3)


def report(found: Mapping[str, Measured]) -> str:
    """Return the table of :func:`measure` by the names of recordings."""
    rows = []
    for name, both in found.items():
        for what, values in zip((name, "its reference"), both[:2], strict=True):
            cells = ["{:.2f} / {:.2f} / {:.1f}, {:.0f} %".format(*row) for row in values]
            if what != name:
                cells = [cells[0].split(",")[0], "", cells[2].split(",")[0], ""]
            rows.append((what, *cells))
    low = f"{CUTOFF_HZ:g} Hz"
    return table(
        ("recording", "`--causal`", "smoothed", f"`--causal`, {low}", f"smoothed, {low}"), rows
    )


def report_lags(found: Mapping[str, Measured]) -> str:
    """Return the table of the figures by lag."""
    rows = [
        (name, *("{:.2f} / {:.2f} / {:.1f}".format(*row) for row in one.by_lag))
        for name, one in found.items()
    ]
    return table(("recording", *(f"`lag` {lag_s:g} s" for lag_s in LAGS_S)), rows)


def report_rates(found: Mapping[str, FloatArray]) -> str:
    """Return the table of :func:`rates_within` by the names of recordings."""
    rows = [
        (name, *("{:.2f}, {:.2f}, {:.0f} and {:.0f} %".format(*row) for row in one))
        for name, one in found.items()
    ]
    return table(("recording", "velocity, m/s", "acceleration, m/s²"), rows)


def main() -> None:
    """Track the sessions, and print the tables or write them to the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    parser.add_argument("--rates", nargs="+", type=Path, default=[], metavar="SESSION")
    parser.add_argument("--seeds", type=int, default=3, metavar="N")
    parser.add_argument("--output", type=Path, metavar="PAGE.md")
    given = parser.parse_args()
    seeds = range(given.seeds)
    found = {folder.name: measure(folder, seeds) for folder in given.sessions}
    rates = {folder.name: rates_within(folder, seeds) for folder in given.rates}
    tables = [report(found), report_lags(found), *([report_rates(rates)] if rates else [])]
    if given.output is None:
        print(*tables, sep="\n\n")
        return
    page = given.output.read_text("utf-8")
    for text, marks in zip(tables, MARKS, strict=False):
        page = replaced(page, text, *marks)
    write_file(given.output, page)


if __name__ == "__main__":
    main()
