"""``cardbox initialize``: measures the person in a recording."""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path

from cardbox_tracker.commands.arguments import (
    REFERENCES,
    add_force,
    add_options,
    add_references,
    add_seed,
    check_outputs,
    print_remarks,
)
from cardbox_tracker.commands.request import CAMERA_PITCH, RecordingOptions, TrackingOptions
from cardbox_tracker.commands.scene import tilt_in
from cardbox_tracker.commands.tracking_request import Problems, inputs_of, recording_request
from cardbox_tracker.common.progress import progress_bar
from cardbox_tracker.measuring.config import InitializationConfig
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import save_body_model
from cardbox_tracker.recordings.initialize import (
    describe,
    initialize_at_scale,
    initialize_from_recording,
)

# Initial distance of the search where depth images or two cameras measure it.
_GUESSED_M = 2.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox initialize``."""
    add_options(parser, RecordingOptions)
    add_references(parser)
    add_options(
        parser,
        TrackingOptions,
        *("distance_m", "camera_pitch_deg"),
        distance_m={
            "help": "from the camera to the person, metres along the floor; all sizes are "
            "proportional to it; not needed with --depth, or with two or more --cameras, which "
            "measure it"
        },
        camera_pitch_deg={
            "help": f"{CAMERA_PITCH} (default: 0; found in the --front images where a detector "
            "finds silhouettes)"
        },
    )
    add_seed(parser, "the hypotheses")
    parser.add_argument(
        "--output", type=Path, required=True, metavar="MODEL.yaml", help="body model to write"
    )
    add_force(parser)


def measuring_config(
    options: argparse.Namespace, distance_m: float, pitch_rad: float
) -> InitializationConfig:
    """Return the settings of a measurement."""
    # The body model refuses an impossible distance or pitch by name.
    BodyModel.of(distance_m=distance_m, camera_pitch_rad=pitch_rad)
    return InitializationConfig(distance_m, pitch_rad, options.side_turn, seed=options.seed)


def run(options: argparse.Namespace) -> None:
    """Measure the person, write the body model and print its sizes."""
    asked, problems = RecordingOptions.of(options), Problems(options.recording)
    # The silhouettes alone are measured.
    recording = replace(recording_request(asked, problems), points=None)
    is_given = options.distance_m is not None
    if not is_given and asked.depth is None and len(asked.cameras) < 2:
        problems.miss("--distance M or --depth TOPIC or two --cameras", "one camera has no scale")
    if is_given and asked.depth is not None and asked.within_m is None:
        problems.add(
            "--depth and --distance both give the distance of the person; leave one of them out, "
            "or give --within M in place of --background"
        )
    distance_m = options.distance_m if is_given else _GUESSED_M
    pitch_rad = math.radians(options.camera_pitch_deg or 0.0)
    config = problems.caught(
        lambda: measuring_config(options, distance_m, pitch_rad), InitializationConfig()
    )
    problems.check()
    check_outputs((options.output,), options.force, inputs_of(asked))
    spans = {name: getattr(options, name) for name in REFERENCES}
    if options.camera_pitch_deg is None and recording.detector is not None:
        pitch_rad, recording = tilt_in(recording, spans["front"])
        config = replace(config, camera_pitch_rad=pitch_rad)
    if is_given:
        recording = replace(recording, depth=None)
    with recording.open() as source, progress_bar("initialize") as show:
        if is_given:
            result = initialize_from_recording(source.first, spans, config, show)
        else:
            result = initialize_at_scale(source, spans, config, show)
        remarks, accounts = source.first.remarks, [one.account for one in source.sources]
    print_remarks(remarks)
    roll_rad = recording.camera.stands_rad
    save_body_model(result.body.with_values(camera_roll_rad=roll_rad), options.output)
    print(describe(result))
    print(f"wrote {options.output}", *accounts, sep="\n")
