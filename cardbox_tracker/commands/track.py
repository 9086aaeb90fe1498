"""``cardbox track``: the posture in each image of a recording, or of a folder of recordings."""

from __future__ import annotations

import argparse
from pathlib import Path

from cardbox_tracker.commands.arguments import at_least
from cardbox_tracker.commands.camera_arguments import check_alone
from cardbox_tracker.commands.output_paths import add_force, body_beside, check_outputs
from cardbox_tracker.commands.tracking import (
    ResultFiles,
    add_inputs,
    check_person,
    inputs_of,
    track_inputs,
)
from cardbox_tracker.files import is_written_in_place

NAME = "track"
HELP = "follow the posture through a recording, or through all recordings of a folder"

_OF_ONE = ("--csv", "--bag", "--video")
_OF_MANY = ("--output", "--formats", "--jobs")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox track``."""
    from cardbox_tracker.commands.track_folder import FORMATS

    # The recordings of a folder can have files that name the person.
    add_inputs(parser, needs_person=False)
    parser.add_argument(
        "--csv",
        type=Path,
        default=None,
        metavar="OUT.csv|OUT.parquet",
        help="table to write, one row per image (docs/results.md); by default it has the name of "
        "the recording and is in the current folder. With --stature, OUT.body.yaml beside it is "
        "the body that was used",
    )
    parser.add_argument(
        "--bag", type=Path, default=None, metavar="OUT", help="also write the topics of the tracker"
    )
    parser.add_argument(
        "--video", type=Path, default=None, metavar="OUT.mp4", help="also write an overlay video"
    )
    many = parser.add_argument_group("a folder of recordings (docs/many-recordings.md)")
    many.add_argument(
        "--output",
        type=Path,
        default=None,
        metavar="DIR",
        help="folder of the results; by default FOLDER_tracked in the current folder. A recording "
        "that is finished there with the same inputs and settings is not tracked again",
    )
    many.add_argument(
        "--formats",
        nargs="+",
        choices=FORMATS,
        default=None,
        help="results of each recording; csv by default",
    )
    many.add_argument(
        "--jobs",
        type=at_least(1),
        default=None,
        metavar="N",
        help="recordings that are tracked at a time, each on one core; one per core by default",
    )
    add_force(parser)


def run(options: argparse.Namespace) -> None:
    """Track the person and write the requested files.

    Raises:
        CardboxError: a recording or a body model cannot be read, a setting is out of range, or a
            result cannot be written.
    """
    from cardbox_tracker.recordings.folder import is_one_recording, recordings_in

    path = options.recording
    if not is_one_recording(path) and recordings_in(path, options.output):
        from cardbox_tracker.commands.track_folder import track_folder

        check_alone(options, _OF_ONE, f"on {path}, a folder of recordings: give --formats")
        track_folder(options)
    else:
        check_alone(options, _OF_MANY, f"on {path}, which is one recording: give --csv")
        _track_one(options)


def _track_one(options: argparse.Namespace) -> None:
    from cardbox_tracker.recordings.result_table import check_table

    check_person(options)
    table = options.csv or Path(f"{_name(options.recording)}.csv")
    check_table(table)
    model = None
    if options.stature is not None:
        # There is no place for a further file beside a pipe.
        beside = Path(_name(options.recording)) if is_written_in_place(table) else table
        model = body_beside(beside)
    files = ResultFiles(table, options.video, options.bag, model)
    check_outputs(
        (table, model, options.video),
        options.force,
        inputs=inputs_of(options),
        results=() if options.bag is None else (options.bag,),
    )
    track_inputs(options, files, options.force)
    for path in (table, model, options.video, options.bag):
        if path is not None:
            print(f"wrote {path}")


def _name(recording: Path) -> str:
    path = recording.resolve()
    return path.name if path.is_dir() else path.stem
