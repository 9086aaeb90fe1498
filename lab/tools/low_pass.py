"""Errors and shaking of the low-pass of results by its cut-off (``docs/export.md``).

    python -m lab.tools.low_pass SESSION... [--output docs/export.md]

Each session is tracked as a film with field of view, stature and detector. Shape and place are
errors of the keypoints; the acceleration is that of the hands, by second differences, in images
that the reference and the unfiltered results have. The table goes between the marks of the page.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker import track
from cardbox_tracker.common.files import write_file
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.recordings.result_table import POINT_COLUMNS
from cardbox_tracker.search.doubt import HANDS
from lab.evaluation.films import make_film
from lab.pages import replaced, table
from lab.tools.ways import shape_and_place_cm

MARKS = "<!-- low-pass -->", "<!-- /low-pass -->"
CUTOFFS_HZ = 3.0, 4.0, 6.0


def figures(
    results: Mapping[str, Results], stamps_ns: FloatArray, true_m: FloatArray
) -> FloatArray:
    """Return shape and place, cm, and acceleration, m/s², of each results, then the reference's.

    Args:
        results: unfiltered ones first, of the same images.
        stamps_ns: of these images, (n,), by the session's clock.
        true_m: reference (n, 6, 3) in them, nan where there is none.
    """
    found_m = [one.of(POINT_COLUMNS).reshape(-1, 6, 3) for one in results.values()]
    true_m = np.where(np.isfinite(found_m[0]), true_m, np.nan)
    steps_s = np.diff(stamps_ns) / 1e9
    is_even: NDArray[np.bool_] = np.asarray(np.abs(steps_s / np.median(steps_s) - 1.0) < 0.2)

    def shaking(points_m: FloatArray) -> float:
        second = np.diff(points_m[:, HANDS], 2, axis=0) / np.median(steps_s) ** 2
        second[~(is_even[1:] & is_even[:-1])] = np.nan
        return float(np.sqrt(np.nanmean(np.sum(second**2, axis=2))))

    rows = [(*shape_and_place_cm(m - true_m), shaking(m + 0 * true_m)) for m in found_m]
    return np.array([*rows, (0.0, 0.0, shaking(true_m))])


def measure(folder: Path) -> FloatArray:
    """Return :func:`figures` of one session as a film."""
    with TemporaryDirectory() as made:
        film = make_film(folder, "across", Path(made) / "film.mp4")
        given = {"fov_deg": round(film.fov_deg, 1), "stature_m": film.session.truth.stature_m}
        result = track(film.path, detector="mediapipe", seed=0, **given)
    stamps_ns, true_m = film.session.stamps_ns, film.session.keypoints_m
    by_stamp = dict(zip(stamps_ns.tolist(), true_m, strict=True))
    nothing = np.full((6, 3), np.nan)
    truth_m = np.array([by_stamp.get(stamp_ns, nothing) for stamp_ns in film.stamps_ns])
    every = {"no": result} | {f"{hz:g} Hz": result.filtered(hz) for hz in CUTOFFS_HZ}
    return figures(every, np.array(film.stamps_ns), truth_m)


def report(found: Mapping[str, FloatArray]) -> str:
    """Return the table of :func:`measure` by the names of recordings."""
    head = "recording", "unfiltered", *(f"{hz:g} Hz" for hz in CUTOFFS_HZ), "reference"
    rows = []
    for name, values in found.items():
        cells = [f"{shape:.2f} / {place:.2f} / {hands:.1f}" for shape, place, hands in values[:-1]]
        rows.append((name, *cells, f"{values[-1, 2]:.1f}"))
    return table(head, rows)


def main() -> None:
    """Track the sessions, and print the table or write it to the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    parser.add_argument("--output", type=Path, metavar="PAGE.md")
    given = parser.parse_args()
    text = report({folder.name: measure(folder) for folder in given.sessions})
    if given.output is None:
        print(text)
    else:
        write_file(given.output, replaced(given.output.read_text("utf-8"), text, *MARKS))


if __name__ == "__main__":
    main()
