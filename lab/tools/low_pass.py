"""Errors and shaking of results by smoothing and low-pass (``docs/export.md``).

    python -m lab.tools.low_pass SESSION... [--seeds 3] [--output docs/export.md]

Each session is tracked as a film with field of view, stature and detector. Shape and place are
errors of the keypoints; the acceleration is that of the hands, by second differences, in images
that the reference and the results have. The reference after the same low-pass shows what is lost of
the motion. The table goes between the marks of the page.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.commands.request import TrackingOptions
from cardbox_tracker.commands.tracking import track
from cardbox_tracker.commands.tracking_request import tracking_request
from cardbox_tracker.common.files import write_file
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES
from cardbox_tracker.recordings.result_reader import KeptResults, Results
from cardbox_tracker.recordings.result_table import POINT_COLUMNS
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.recordings.smoothing import low_passed
from cardbox_tracker.search.doubt import FAR_M, HANDS
from cardbox_tracker.tracking.estimate import TRACKING, Estimate
from cardbox_tracker.tracking.smoother import Smoother
from cardbox_tracker.tracking.tracker import Tracker
from lab.evaluation.films import Film, make_film
from lab.pages import replaced, table
from lab.tools.ways import shape_and_place_cm

MARKS = "<!-- low-pass -->", "<!-- /low-pass -->"
CUTOFF_HZ = 4.0


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


def measure(folder: Path, seeds: Iterable[int]) -> tuple[FloatArray, FloatArray]:
    """Return means over seeds of one session, (4, 4), and of its reference likewise.

    Rows are as live, smoothed, and both after the low-pass; columns are :func:`figures`, and the
    share of the images with the state ``tracking``, %, with a joint beyond 30 cm, place included.
    """
    with TemporaryDirectory() as made:
        film = make_film(folder, "across", Path(made) / "film.mp4")
        runs = [_runs(film, seed) for seed in seeds]
    pairs = zip(film.session.stamps_ns.tolist(), film.session.keypoints_m, strict=True)
    by_stamp, unknown = dict(pairs), np.full((6, 3), np.nan)
    every_m = np.array([by_stamp.get(stamp_ns, unknown) for stamp_ns in film.stamps_ns])
    stamps_ns, found = np.array(film.stamps_ns), []
    # The low-pass needs more than two images of a period.
    cutoff_hz = min(CUTOFF_HZ, 0.4e9 / float(np.median(np.diff(stamps_ns))))
    for as_live, smoothed in runs:
        true_m = np.where(np.isfinite(_keypoints_m(as_live)), every_m, np.nan)
        columns = dict(zip(POINT_COLUMNS, true_m.reshape(len(true_m), -1).T, strict=True))
        reference = replace(as_live, numbers=columns)
        for pair in ((as_live, smoothed), (reference, reference)):
            every = [*pair, *(low_passed(one, cutoff_hz) for one in pair)]
            found.append([_figures(one, true_m, stamps_ns) for one in every])
    ours, of_reference = np.array(found).reshape(len(runs), 2, 4, 4).mean(axis=0)
    return ours, of_reference


def _runs(film: Film, seed: int) -> tuple[Results, Results]:
    """Return the results of a film as live tracking gives them, and smoothed."""
    kept = [KeptResults(film.path, has_points=True, is_smoothed=True) for _ in range(2)]
    smoother = Smoother[tuple[RecordedFrame, Tracker]]()

    def tell(seen: Iterable[tuple[tuple[RecordedFrame, Tracker], Sequence[Estimate]]]) -> None:
        for (frame, tracker), (estimate,) in seen:
            kept[1](frame, estimate, tracker)

    def observe(frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        kept[0](frame, estimate, tracker)
        tell(smoother.add((frame, tracker), frame.stamp_ns, [estimate], [tracker.body]))

    given: dict[str, Any] = {"detector": "mediapipe", "causal": True, "seed": seed}
    given |= {"fov_deg": round(film.fov_deg, 1), "stature_m": film.session.truth.stature_m}
    track(tracking_request(TrackingOptions(film.path, **given)), (observe,), lambda _: None)
    tell(smoother.finish())
    as_live, smoothed = (one.results()[1] for one in kept)
    return as_live, smoothed


def _figures(results: Results, true_m: FloatArray, stamps_ns: FloatArray) -> FloatArray:
    found_m = _keypoints_m(results)
    sure = np.array(results.state) == TRACKING
    off_m = np.linalg.norm(found_m - true_m, axis=2).max(axis=1)[sure]
    off_m = off_m[np.isfinite(off_m)]
    wrong = 100.0 * np.mean(off_m > FAR_M) if len(off_m) else 0.0
    return np.array([*figures(found_m, true_m, stamps_ns), wrong])


def _keypoints_m(results: Results) -> FloatArray:
    return results.of(POINT_COLUMNS).reshape(-1, len(KEYPOINT_NAMES), 3)


def report(found: Mapping[str, Iterable[FloatArray]]) -> str:
    """Return the table of :func:`measure` by the names of recordings."""
    rows = []
    for name, both in found.items():
        for what, values in zip((name, "its reference"), both, strict=True):
            cells = ["{:.2f} / {:.2f} / {:.1f}, {:.0f} %".format(*row) for row in values]
            if what != name:
                cells = [cells[0].split(",")[0], "", cells[2].split(",")[0], ""]
            rows.append((what, *cells))
    low = f"{CUTOFF_HZ:g} Hz"
    return table(
        ("recording", "`--causal`", "smoothed", f"`--causal`, {low}", f"smoothed, {low}"), rows
    )


def main() -> None:
    """Track the sessions, and print the table or write it to the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    parser.add_argument("--seeds", type=int, default=3, metavar="N")
    parser.add_argument("--output", type=Path, metavar="PAGE.md")
    given = parser.parse_args()
    found = {folder.name: measure(folder, range(given.seeds)) for folder in given.sessions}
    text = report(found)
    if given.output is None:
        print(text)
    else:
        write_file(given.output, replaced(given.output.read_text("utf-8"), text, *MARKS))


if __name__ == "__main__":
    main()
