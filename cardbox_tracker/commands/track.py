"""``cardbox track``: the posture in each image of a recording, or of a folder of recordings."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cardbox_tracker.commands.arguments import add_force, at_least, check_outputs
from cardbox_tracker.commands.request import FORMATS, TrackFiles, add_tracking, tracking_request
from cardbox_tracker.commands.tracking import track
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import atomic_path, body_beside, is_written_in_place, scene_beside

if TYPE_CHECKING:
    from cardbox_tracker.recordings.track import TrackSummary

NAME = "track"
HELP = "follow the posture through a recording, or through all recordings of a folder"

_OF_ONE = ("csv", "bag", "video", "json")
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
    parser.add_argument(
        "--legs",
        action="store_true",
        help="has no effect: with --detector, hips, knees and ankles are always measured "
        "(docs/results.md)",
    )
    parser.add_argument("--video", type=Path, metavar="OUT.mp4", help="also write an overlay video")
    parser.add_argument(
        "--json",
        type=Path,
        metavar="OUT.json",
        help="also write what is printed at the end: what was tracked, used, left out and assumed",
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
        "--formats",
        nargs="+",
        choices=FORMATS,
        help="results of each recording; csv by default",
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
    from cardbox_tracker.recordings.folder import is_one_recording, recordings_in

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


def _without_effect(options: argparse.Namespace, names: tuple[str, ...], what: str) -> list[str]:
    """Return a fault for each given option that has no effect, since the recording is ``what``."""
    given = [name for name in names if getattr(options, name) is not None]
    return [f"--{name} has no effect on {options.recording}, {what}" for name in given]


def track_one(options: argparse.Namespace, show: Callable[[float], None] | None = None) -> None:
    """Track one recording and write the requested files; see :func:`~.tracking.track`.

    Raises:
        CardboxError: options are wrong, or a file cannot be read or written.
    """
    from cardbox_tracker.recordings.result_table import check_table

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
    files = TrackFiles(table, options.video, options.bag, body, scene)
    written = (table, body, scene, options.video, options.json)
    check_outputs(written, options.force, request.inputs, results=(options.bag,))
    summary = track(replace(request, files=files, force=options.force), show=show)
    if options.json is not None:
        with atomic_path(options.json) as temporary:
            temporary.write_text(json.dumps(_account(summary), indent=1) + "\n", encoding="utf-8")
    if show is not None:
        return
    for path in (*written, options.bag):
        if path is not None:
            print(f"wrote {path}")
    print(*summary.accounts, sep="\n")


def _account(summary: TrackSummary) -> dict[str, Any]:
    """Return what ``--json`` writes of a run, or of one of its people."""
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
