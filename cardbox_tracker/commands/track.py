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
    time,
)
from cardbox_tracker.commands.output_paths import add_force, check_outputs
from cardbox_tracker.commands.settings_arguments import (
    add_tracker_settings,
    with_tracker_settings,
)
from cardbox_tracker.errors import CardboxError

if TYPE_CHECKING:
    from cardbox_tracker.estimation.config import TrackerConfig
    from cardbox_tracker.recordings.track import Observer

NAME = "track"
HELP = "follow the posture through a recording"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox track``."""
    add_inputs(parser)
    parser.add_argument(
        "--csv",
        type=Path,
        required=True,
        metavar="OUT.csv",
        help="table to write, one row per image",
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
    add_recording(parser, required, needs_background=False)
    add_cameras(parser)
    add_depth(parser)
    add_detector(parser)
    parser.add_argument(
        "--model",
        type=Path,
        required=required,
        metavar="MODEL.yaml",
        help="the person, from 'cardbox initialize', the node initializer, or 'cardbox body'",
    )
    parser.add_argument(
        "--start",
        type=time,
        required=required,
        metavar="T",
        help="second at which the person stands as for --front; tracking starts there. With a "
        "body of 'cardbox body', any posture will do: it is fitted to the first silhouette",
    )
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
    check_outputs(
        (options.csv, options.video),
        options.force,
        inputs=inputs_of(options),
        results=() if options.bag is None else (options.bag,),
    )
    track_inputs(options, options.csv, options.video, options.bag, options.force)
    for path in (options.csv, options.video, options.bag):
        if path is not None:
            print(f"wrote {path}")


def inputs_of(options: argparse.Namespace) -> tuple[Path | None, ...]:
    """Return the files that the arguments of :func:`add_inputs` name."""
    # These two may also be words, which name no file.
    words = options.detector, options.corrector
    files = options.recording, options.model, options.extrinsics, options.settings
    return *files, *(Path(word) for word in words if word)


def track_inputs(
    options: argparse.Namespace,
    csv: Path | None = None,
    video: Path | None = None,
    bag: Path | None = None,
    force: bool = False,
    observers: tuple[Observer, ...] = (),
) -> None:
    """Track the recording of :func:`add_inputs` and print a summary.

    ``observers`` are called after each image. With ``force``, an existing ``bag`` is replaced.

    Raises:
        CardboxError: see :func:`run`.
    """
    from cardbox_tracker.body.model_file import load_body_model
    from cardbox_tracker.progress import progress_bar
    from cardbox_tracker.recordings.recording import open_recording
    from cardbox_tracker.recordings.result_bag import result_bag
    from cardbox_tracker.recordings.track import TrackFiles, track_recording

    body = load_body_model(options.model)
    if body.doubt:
        print(f"{options.model}: {body.doubt}")
    config = _config(options)
    is_more = len(options.cameras) > 1 or options.depth is not None
    if is_more and not config.has_several_views:
        raise CardboxError(
            "--preset paper uses the silhouette of one camera; give --preset default with several "
            "cameras or with --depth"
        )
    with open_recording(
        options.recording,
        silhouettes_of(options),
        options.cameras,
        options.extrinsics,
        options.depth,
        points_of(options),
    ) as source:
        total_s = max(1e-9, source.first.duration_s - options.start)
        with (
            result_bag(bag, source.first.frame_id, force) as record,
            progress_bar("track") as show,
        ):
            summary = track_recording(
                source,
                body,
                config,
                options.seed,
                options.start,
                TrackFiles(csv, video),
                observers=(
                    record,
                    *observers,
                    lambda frame, *_: show((frame.time_s - options.start) / total_s),
                ),
            )
    doubt = f" ({summary.frames_uncertain} of them uncertain)" if summary.frames_uncertain else ""
    print(
        f"tracked {summary.frames_tracked} of {summary.frames} images{doubt}, "
        f"mean cost {summary.mean_cost_px:.0f} px, mean IoU {summary.mean_iou:.3f}"
    )
    print_remarks(source.first, summary.remarks)


def _config(options: argparse.Namespace) -> TrackerConfig:
    """Return the preset changed by the options."""
    from cardbox_tracker.estimation.config import PRESETS

    config = PRESETS[options.preset]()
    if options.depth is not None:
        config = config.with_depth()
    return with_tracker_settings(config, options)
