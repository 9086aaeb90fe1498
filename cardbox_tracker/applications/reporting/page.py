"""A page of a tracked recording: the film with the body over it, pictures, and what is doubtful."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from urllib.parse import quote

import numpy as np

from cardbox_tracker.applications.drawing.page import render_page
from cardbox_tracker.applications.exporting.motion import Motion
from cardbox_tracker.applications.reporting.plots import angles_plot, doubtful_spans, space_view
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.tracking.estimate import TRACKING

_MOST_SPANS = 20


def write_page(
    path: Path, film: Path, title: str, people: Mapping[str, Results], lines: Sequence[str]
) -> None:
    """Write the page, which needs no other file than the film.

    Args:
        path: file to write, .html.
        film: overlay video, which the page names by its place relative to the page.
        title: heading.
        people: results of each person by a heading.
        lines: what the results rest on, and warnings.

    Raises:
        CardboxError: the file cannot be written.
    """
    render_page(
        path,
        Path(__file__).with_name("page.html"),
        title=title,
        film=quote(os.path.relpath(film, path.parent)),
        film_name=film.name,
        start_s=min(float(results.time_s[0]) for results in people.values()),
        people=[_person(name, results) for name, results in people.items()],
        lines=lines,
    )


def _person(name: str, results: Results) -> dict[str, object]:
    images, sure = len(results.state), results.state.count(TRACKING)
    seen = Motion.of(results) if np.isfinite(results.of(["torso_y"])).any() else None
    spans = sorted(doubtful_spans(results), key=lambda span: span[0] - span[1])
    pictures = {"angles over time, with a standard deviation": angles_plot(results)}
    if seen is not None:
        pictures = {"skeleton from aside": space_view(seen, results.body)} | pictures
    return {
        "name": name,
        "words": f"{images} images, {sure} of them sure ({sure / images:.0%})",
        "moments": [
            (begin_s, end_s, what or "no posture")
            for begin_s, end_s, what in sorted(spans[:_MOST_SPANS])
        ],
        "more": max(0, len(spans) - _MOST_SPANS),
        "pictures": pictures,
    }
