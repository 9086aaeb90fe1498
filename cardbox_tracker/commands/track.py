"""``cardbox track``: the posture in each image of a recording."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from cardbox_tracker.commands.arguments import (
    add_cameras,
    add_depth,
    add_detector,
    add_preset,
    add_recording,
    add_retired,
    add_seed,
    points_of,
    print_remarks,
    silhouettes_of,
)
from cardbox_tracker.commands.camera_arguments import (
    add_camera,
    camera_of,
    detector_among,
    pitch_of,
)
from cardbox_tracker.commands.output_paths import add_force, check_outputs
from cardbox_tracker.commands.person_arguments import (
    STANDING_S,
    add_person,
    measured_person,
    person_of_stature,
    start_of,
)
from cardbox_tracker.commands.settings_arguments import (
    add_tracker_settings,
    with_tracker_settings,
)
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.files import is_written_in_place

if TYPE_CHECKING:
    from cardbox_tracker.estimation.config import TrackerConfig
    from cardbox_tracker.recordings.track import Observer, TrackFiles, TrackSummary

NAME = "track"
HELP = "follow the posture through a recording"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox track``."""
    add_inputs(parser)
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
    add_force(parser)


def add_inputs(parser: argparse.ArgumentParser, required: bool = True) -> None:
    """Add the arguments for the recording, the person and the settings.

    Without ``required``, the recording may be missing, or be a bag of results without further
    arguments.
    """
    add_recording(parser, required, only_bags=False)
    add_cameras(parser)
    add_depth(parser)
    add_detector(parser)
    add_camera(parser)
    add_person(parser, required)
    add_preset(parser, "default")
    add_tracker_settings(parser)
    add_retired(parser, "--refine-sizes", "breadths stay as they were measured")
    add_seed(parser, "the filters")


def run(options: argparse.Namespace) -> None:
    """Track the person and write the requested files.

    Raises:
        CardboxError: the recording or the body model cannot be read, a setting is out of range, or
            a result cannot be written.
    """
    from cardbox_tracker.body.model_file import save_body_model
    from cardbox_tracker.recordings.result_table import check_table
    from cardbox_tracker.recordings.track import TrackFiles

    table = options.csv or Path(f"{_name(options.recording)}.csv")
    check_table(table)
    model = None
    if options.stature is not None:
        # There is no place for a further file beside a pipe.
        beside = Path(_name(options.recording)) if is_written_in_place(table) else table
        model = beside.with_name(f"{beside.stem}.body.yaml")
    check_outputs(
        (table, model, options.video),
        options.force,
        inputs=inputs_of(options),
        results=() if options.bag is None else (options.bag,),
    )
    files = TrackFiles(table, options.video)
    summary = track_inputs(options, files, options.bag, options.force)
    if model is not None and summary.body is not None:
        save_body_model(summary.body, model)
    for path in (table, model, options.video, options.bag):
        if path is not None:
            print(f"wrote {path}")


def _name(recording: Path) -> str:
    path = recording.resolve()
    return path.name if path.is_dir() else path.stem


def inputs_of(options: argparse.Namespace) -> tuple[Path | None, ...]:
    """Return the files that the arguments of :func:`add_inputs` name."""
    # These two may also be words, which name no file.
    words = options.detector, options.corrector
    files = options.recording, options.model, options.extrinsics, options.settings
    return *files, options.calibration, *(Path(word) for word in words if word)


def track_inputs(
    options: argparse.Namespace,
    files: TrackFiles | None = None,
    bag: Path | None = None,
    force: bool = False,
    observers: tuple[Observer, ...] = (),
) -> TrackSummary:
    """Track the recording of :func:`add_inputs`, print a summary and return it.

    ``observers`` are called after each image. With ``force``, an existing ``bag`` is replaced.

    Raises:
        CardboxError: see :func:`run`.
    """
    from cardbox_tracker.progress import progress_bar
    from cardbox_tracker.recordings.recording import open_recording
    from cardbox_tracker.recordings.result_bag import result_bag
    from cardbox_tracker.recordings.silhouettes import TimeSpan
    from cardbox_tracker.recordings.track import TrackFiles, track_recording

    start_s = start_of(options)
    # Mistakes in the numbers are reported before the recording is read.
    is_measured = options.stature is None
    body = measured_person(options) if is_measured else person_of_stature(options)
    config = _config(options)
    is_more = len(options.cameras) > 1 or options.depth is not None
    if is_more and not config.has_several_views:
        raise CardboxError(
            "--preset paper uses the silhouette of one camera; give --preset default with several "
            "cameras or with --depth"
        )
    silhouettes, points = silhouettes_of(options), points_of(options)
    camera = camera_of(options)
    if not is_measured:
        standing = TimeSpan(start_s, start_s + STANDING_S)
        pitch_rad, camera = pitch_of(options, detector_among(silhouettes, points), standing)
        body = person_of_stature(options, pitch_rad)
    with open_recording(
        options.recording,
        silhouettes,
        options.cameras,
        options.extrinsics,
        options.depth,
        points,
        camera,
    ) as source:
        total_s = max(1e-9, source.first.duration_s - start_s)
        with (
            result_bag(bag, source.first.frame_id, force) as record,
            progress_bar("track") as show,
        ):
            summary = track_recording(
                source,
                body,
                config,
                options.seed,
                start_s,
                files or TrackFiles(),
                observers=(
                    record,
                    *observers,
                    lambda frame, *_: show((frame.time_s - start_s) / total_s),
                ),
            )
        remarks = source.first.remarks
    doubt = f" ({summary.frames_uncertain} of them uncertain)" if summary.frames_uncertain else ""
    print(
        f"tracked {summary.frames_tracked} of {summary.frames} images{doubt}, "
        f"mean cost {summary.mean_cost_px:.0f} px, mean IoU {summary.mean_iou:.3f}"
    )
    print_remarks(remarks, summary.remarks)
    return summary


def _config(options: argparse.Namespace) -> TrackerConfig:
    """Return the preset changed by the options."""
    from cardbox_tracker.estimation.config import PRESETS

    config = PRESETS[options.preset]()
    if options.depth is not None:
        config = config.with_depth()
    return with_tracker_settings(config, options)
