"""``cardbox track``: the posture in each image of a recording, or of a folder of recordings."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

from cardbox_tracker.applications.exporting.formats import Format, export, formats
from cardbox_tracker.applications.reporting.page import angles_plot, write_page
from cardbox_tracker.commands.arguments import add_force, at_least, check_outputs
from cardbox_tracker.commands.request import FORMATS, TrackFiles, add_tracking, tracking_request
from cardbox_tracker.commands.tracking import track
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import (
    body_beside,
    is_written_in_place,
    of_person,
    scene_beside,
    write_file,
)
from cardbox_tracker.recordings.open_images import is_one_recording, recordings_in
from cardbox_tracker.recordings.result_reader import read_results
from cardbox_tracker.recordings.result_table import check_table
from cardbox_tracker.recordings.track import TrackSummary
from cardbox_tracker.tracking.precompile import compile_for_films

_OF_ONE = ("csv", "bag", "video", "json", "export", "plot", "report")
_OF_MANY = ("output", "formats", "jobs", "scheduler")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox track``."""
    add_tracking(parser)
    parser.add_argument(
        "--csv",
        type=Path,
        metavar="OUT.csv|OUT.parquet",
        help="table to write, one row per image (docs/results.md); by default it has the name of "
        "the recording and is in the current folder. OUT.body.yaml beside it is the body that "
        "was used",
    )
    parser.add_argument(
        "--bag", type=Path, metavar="OUT", help="also write the topics of the tracker"
    )
    parser.add_argument(
        "--hands",
        action="store_true",
        help="with --detector mediapipe: also tell open from closed hands, and measure palms and "
        "wrists, in further columns and in the video (docs/results.md)",
    )
    parser.add_argument("--video", type=Path, metavar="OUT.mp4", help="also write an overlay video")
    parser.add_argument(
        "--json",
        type=Path,
        metavar="OUT.json",
        help="also write what is printed at the end: what was tracked, used, left out and assumed",
    )
    parser.add_argument(
        "--export",
        type=_formats,
        metavar="FORMAT[,...]",
        help="also write the table in formats of 'cardbox export' beside it, such as trc,bvh",
    )
    parser.add_argument(
        "--plot",
        type=Path,
        metavar="OUT.png",
        help="also plot the angles, with bands of one standard deviation",
    )
    parser.add_argument(
        "--report",
        type=Path,
        metavar="OUT.html",
        help="also write a page with the overlay video (OUT.overlay.mp4 without --video), the "
        "skeleton from aside, the angles and the times to look at",
    )
    many = parser.add_argument_group("a folder of recordings (docs/many-recordings.md)")
    many.add_argument(
        "--output",
        type=Path,
        metavar="DIR",
        help="folder of the results; by default FOLDER_tracked in the current folder. A recording "
        "that is finished there with the same inputs and settings is not tracked again",
    )
    many.add_argument(
        "--formats", nargs="+", choices=FORMATS, help="results of each recording; csv by default"
    )
    many.add_argument(
        "--jobs",
        type=at_least(1),
        metavar="N",
        help="recordings that are tracked at a time, each on one core; one per core by default",
    )
    many.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="in place of --jobs: track on the workers of this Dask cluster, such as tcp://HOST:8786",
    )
    add_force(parser)


def run(options: argparse.Namespace) -> None:
    """Track the person and write the requested files."""
    path = options.recording
    if not is_one_recording(path) and recordings_in(path, options.output):
        from cardbox_tracker.commands.track_folder import track_folder

        for fault in _without_effect(options, _OF_ONE, "a folder of recordings: give --formats"):
            raise CardboxError(fault)
        if None not in (options.jobs, options.scheduler):
            raise CardboxError("--jobs has no effect with --scheduler: its workers are as many")
        track_folder(options)
    else:
        track_one(options)


def _formats(text: str) -> dict[str, Format]:
    known, names = formats(), dict.fromkeys(text.split(","))
    if not known.keys() >= names.keys():
        raise argparse.ArgumentTypeError(
            f"expected formats of {', '.join(known)}, such as trc,bvh: {text!r}"
        )
    return {name: known[name] for name in names}


def _without_effect(options: argparse.Namespace, names: tuple[str, ...], what: str) -> list[str]:
    """Return a fault for each given option that has no effect, since the recording is ``what``."""
    given = [name for name in names if getattr(options, name) is not None]
    return [f"--{name} has no effect on {options.recording}, {what}" for name in given]


def track_one(options: argparse.Namespace, show: Callable[[float], None] | None = None) -> None:
    """Track one recording and write the requested files; see :func:`~.tracking.track`."""
    faults = _without_effect(options, _OF_MANY, "which is one recording: give --csv")
    request = tracking_request(options, faults)
    recording = options.recording.resolve()
    name = Path(recording.name if recording.is_dir() else recording.stem)
    table = options.csv or Path(f"{name}.csv")
    check_table(table)
    # There is no place for a further file beside a pipe.
    is_piped = is_written_in_place(table)
    beside = name if is_piped else table
    has_body = not is_piped or request.person.model is None
    body = body_beside(beside) if has_body else None
    scene = scene_beside(beside)
    video = options.video
    if options.report is not None and video is None:
        video = options.report.with_suffix(".overlay.mp4")
    exports = {
        form: beside.with_name(beside.stem + form.suffix)
        for form in (options.export or {}).values()
    }
    derived = (*exports.values(), options.plot, options.report)
    _check_derived(options, is_piped)
    files = TrackFiles(table, video, options.bag, body, scene)
    written = (table, body, scene, video, options.json)
    every = (*written, *derived)
    check_outputs(every, options.force, request.inputs, results=(options.bag,))
    if request.preset == "default":
        compile_for_films()
    summary = track(replace(request, files=files, force=options.force), show=show)
    if options.json is not None:
        write_file(options.json, json.dumps(_account(summary), indent=1) + "\n")
    lines = [f"wrote {path}" for path in (*written, options.bag) if path is not None]
    more = _derived(options, summary, table, video, exports) if any(derived) else ()
    # If an export fails, what was written before it is told.
    for line in chain(lines, summary.accounts, more):
        if show is None:
            print(line)


def _check_derived(options: argparse.Namespace, is_piped: bool) -> None:
    """Check what is made of the finished table, before it is."""
    for form in (options.export or {}).values():
        form.check()
    for flag, suffix in (("plot", ".png"), ("report", ".html"), ("video", ".mp4")):
        path = getattr(options, flag)
        if path is not None and path.suffix != suffix:
            raise CardboxError(f"--{flag} {path}: its name must end in {suffix}")
    given = [flag for flag in _OF_ONE[-3:] if getattr(options, flag) is not None]
    if given and is_piped:
        raise CardboxError(f"--{given[0]} reads the table, so --csv must name a file")


def _derived(
    options: argparse.Namespace,
    summary: TrackSummary,
    table: Path,
    video: Path | None,
    exports: Mapping[Format, Path],
) -> Iterator[str]:
    """Write what is made of the finished table, of several people files of each, and say it."""
    tracked = (number for number, one in summary.people.items() if one.frames_tracked)
    people = {number: read_results(table, number) for number in tracked} or {1: read_results(table)}
    if options.plot is not None:
        for number, results in people.items():
            path = of_person(options.plot, number, options.plot.suffix)
            write_file(path, angles_plot(results))
            yield f"wrote {path}"
    if options.report is not None and video is not None:
        named = {f"Person {k}" if summary.people else "Person": one for k, one in people.items()}
        lines = (*summary.assumptions, *summary.remarks, *summary.accounts)
        write_page(options.report, video, f"Posture in {options.recording.name}", named, lines)
        yield f"wrote {options.report}"
    for form, path in exports.items():
        for number, results in people.items():
            output = of_person(path, number, form.suffix)
            yield from (*export(results, output, form), f"wrote {output}")


def _account(summary: TrackSummary) -> dict[str, Any]:
    found: dict[str, Any] = {
        "images": summary.frames,
        "tracked": summary.frames_tracked,
        "uncertain": summary.frames_uncertain,
        "used": dict(summary.used),
        "assumed": summary.assumptions,
        "scene": summary.scene,
        "remarks": summary.remarks,
        "cameras": summary.accounts,
    }
    if summary.people:
        found["people"] = {number: _account(one) for number, one in summary.people.items()}
    return found
