"""Tracking of one recording with the options of a subcommand."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

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
from cardbox_tracker.commands.person_arguments import (
    COMES_WITHIN_S,
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

if TYPE_CHECKING:
    from cardbox_tracker.estimation.config import TrackerConfig
    from cardbox_tracker.recordings.track import Observer, TrackSummary


class ResultFiles(NamedTuple):
    """Files to write for a recording; None for one that is not wanted.

    Attributes:
        table: one row for each image, CSV or Parquet.
        video: overlay video.
        bag: folder of a bag with the topics of the tracker.
        body: the body at the end of the recording.
    """

    table: Path | None = None
    video: Path | None = None
    bag: Path | None = None
    body: Path | None = None


_NO_FILES = ResultFiles()


def add_inputs(
    parser: argparse.ArgumentParser, needs_recording: bool = True, needs_person: bool = True
) -> None:
    """Add the arguments for the recording, the person and the settings.

    Without ``needs_recording`` the recording may be missing; without ``needs_person`` the person.
    """
    add_recording(parser, needs_recording, only_bags=False)
    add_cameras(parser)
    add_depth(parser)
    add_detector(parser)
    add_camera(parser)
    add_person(parser, needs_person)
    add_preset(parser, "default")
    add_tracker_settings(parser)
    add_retired(parser, "--refine-sizes", "breadths stay as they were measured")
    add_seed(parser, "the filters")


def check_person(options: argparse.Namespace) -> None:
    """Check that the options say who is tracked.

    Raises:
        CardboxError: neither ``--model`` nor ``--stature`` is given.
    """
    if options.model is None and options.stature is None:
        raise CardboxError("one of the arguments --model --stature is required")


def inputs_of(options: argparse.Namespace) -> tuple[Path | None, ...]:
    """Return the files that the arguments of :func:`add_inputs` name."""
    files = options.recording, options.model, options.extrinsics, options.settings
    # The detector may also be a word, which names no file.
    detector = Path(options.detector) if options.detector else None
    return *files, options.calibration, detector


def track_inputs(
    options: argparse.Namespace,
    files: ResultFiles = _NO_FILES,
    force: bool = False,
    observers: tuple[Observer, ...] = (),
    show: Callable[[float], None] | None = None,
) -> TrackSummary:
    """Track the recording of :func:`add_inputs`, print remarks and return the summary.

    Args:
        options: arguments of :func:`add_inputs`.
        files: results to write.
        force: whether an existing bag is replaced.
        observers: called after each image.
        show: receives the finished fraction, 0 to 1; if None, there are a progress bar and a line
            with the summary.

    Raises:
        CardboxError: the recording or the body model cannot be read, a setting is out of range, or
            a result cannot be written.
    """
    from cardbox_tracker.applications.drawing.overlay import draw_sharp_overlay
    from cardbox_tracker.applications.drawing.video import overlay_video
    from cardbox_tracker.body.model_file import save_body_model
    from cardbox_tracker.progress import progress_bar
    from cardbox_tracker.recordings.recording import open_recording
    from cardbox_tracker.recordings.result_bag import result_bag
    from cardbox_tracker.recordings.silhouettes import TimeSpan
    from cardbox_tracker.recordings.track import track_recording

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
        detector = detector_among(silhouettes, points)
        # The person may come later.
        pitch_rad, camera = pitch_of(options, detector, standing, start_s + COMES_WITHIN_S)
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
            overlay_video(files.video, source) as film,
            result_bag(files.bag, source.first.frame_id, force, draw_sharp_overlay) as record,
            nullcontext(show) if show else progress_bar("track") as advance,
        ):
            summary = track_recording(
                source,
                body,
                config,
                options.seed,
                start_s,
                files.table,
                observers=(
                    film,
                    record,
                    *observers,
                    lambda frame, *_: advance((frame.time_s - start_s) / total_s),
                ),
            )
        remarks = source.first.remarks
    if show is None:
        _print(summary)
    print_remarks(remarks, summary.remarks)
    if files.body is not None and summary.body is not None:
        save_body_model(summary.body, files.body)
    return summary


def _print(summary: TrackSummary) -> None:
    doubt = f" ({summary.frames_uncertain} of them uncertain)" if summary.frames_uncertain else ""
    print(
        f"tracked {summary.frames_tracked} of {summary.frames} images{doubt}, "
        f"mean cost {summary.mean_cost_px:.0f} px, mean IoU {summary.mean_iou:.3f}"
    )


def _config(options: argparse.Namespace) -> TrackerConfig:
    """Return the preset changed by the options."""
    from cardbox_tracker.estimation.config import PRESETS

    config = PRESETS[options.preset]()
    if options.depth is not None:
        config = config.with_depth()
    return with_tracker_settings(config, options)
