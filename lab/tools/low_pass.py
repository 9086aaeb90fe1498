"""Errors and shaking of the low-pass of results by its cut-off (``docs/export.md``).

    python -m lab.tools.low_pass SESSION... [--output docs/export.md]

Each session is tracked as a film with field of view, stature and detector. Shape and place are
errors of the keypoints; the acceleration is that of the hands, by second differences, in images
that the reference and the unfiltered results have. The reference after the same low-pass shows what
is lost of the motion. The table goes between the marks of the page.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker import track
from cardbox_tracker.common.files import write_file
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.recordings.result_table import POINT_COLUMNS
from cardbox_tracker.recordings.smoothing import low_passed
from cardbox_tracker.search.doubt import HANDS
from lab.evaluation.films import make_film
from lab.pages import replaced, table
from lab.tools.ways import shape_and_place_cm

MARKS = "<!-- low-pass -->", "<!-- /low-pass -->"
CUTOFFS_HZ = 3.0, 4.0, 6.0


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


def measure(folder: Path) -> tuple[FloatArray, FloatArray]:
    """Return :func:`figures` of one session, (cut-offs, 3), and of its reference likewise."""
    with TemporaryDirectory() as made:
        film = make_film(folder, "across", Path(made) / "film.mp4")
        given = {"fov_deg": round(film.fov_deg, 1), "stature_m": film.session.truth.stature_m}
        result = track(film.path, detector="mediapipe", seed=0, **given)
    pairs = zip(film.session.stamps_ns.tolist(), film.session.keypoints_m, strict=True)
    by_stamp, unknown = dict(pairs), np.full((6, 3), np.nan)
    true_m = np.array([by_stamp.get(stamp_ns, unknown) for stamp_ns in film.stamps_ns])
    true_m = np.where(np.isfinite(_keypoints_m(result)), true_m, np.nan)
    columns = dict(zip(POINT_COLUMNS, true_m.reshape(len(true_m), -1).T, strict=True))
    found = []
    for kind in (result, replace(result, numbers=columns)):
        every = [kind, *(low_passed(kind, hz) for hz in CUTOFFS_HZ)]
        stamps_ns = np.array(film.stamps_ns)
        found.append(np.array([figures(_keypoints_m(one), true_m, stamps_ns) for one in every]))
    return found[0], found[1]


def _keypoints_m(results: Results) -> FloatArray:
    return results.of(POINT_COLUMNS).reshape(-1, len(KEYPOINT_NAMES), 3)


def report(found: Mapping[str, Iterable[FloatArray]]) -> str:
    """Return the table of :func:`measure` by the names of recordings."""
    rows = []
    for name, both in found.items():
        for what, values in zip((name, "its reference"), both, strict=True):
            cells = (f"{shape:.2f} / {place:.2f} / {hands:.1f}" for shape, place, hands in values)
            rows.append((what, *cells))
    return table(("recording", "unfiltered", *(f"{hz:g} Hz" for hz in CUTOFFS_HZ)), rows)


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
