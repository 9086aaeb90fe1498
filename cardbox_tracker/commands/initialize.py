"""``cardbox initialize``: measures the person in a recording."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from cardbox_tracker.commands.arguments import (
    REFERENCES,
    add_camera_pitch,
    add_cameras,
    add_depth,
    add_detector,
    add_recording,
    add_references,
    add_seed,
    print_remarks,
    silhouettes_of,
)
from cardbox_tracker.commands.camera_arguments import add_camera, detector_among, pitch_of
from cardbox_tracker.commands.output_paths import add_force, check_outputs
from cardbox_tracker.errors import CardboxError

NAME = "initialize"
HELP = "measure the person in a recording"

# Initial distance of the search where depth images or two cameras measure it.
_GUESSED_M = 2.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox initialize``."""
    add_recording(parser, only_bags=False)
    add_cameras(parser)
    add_depth(parser)
    add_detector(parser)
    add_references(parser)
    parser.add_argument(
        "--distance",
        type=float,
        default=None,
        metavar="M",
        help="from the camera to the person, metres along the floor; all sizes are proportional "
        "to it; not needed with --depth, or with two or more --cameras, which measure it",
    )
    add_camera(parser)
    add_camera_pitch(parser, "0; found in the --front images where a detector finds silhouettes")
    add_seed(parser, "the hypotheses")
    parser.add_argument(
        "--output", type=Path, required=True, metavar="MODEL.yaml", help="body model to write"
    )
    add_force(parser)


def run(options: argparse.Namespace) -> None:
    """Measure the person, write the body model and print its sizes.

    Raises:
        CardboxError: the recording cannot be read, its references show wrong postures or give no
            body, or the model cannot be written.
    """
    from cardbox_tracker.body.model import BodyModel
    from cardbox_tracker.body.model_file import save_body_model
    from cardbox_tracker.estimation.initialization.config import InitializationConfig
    from cardbox_tracker.progress import progress_bar
    from cardbox_tracker.recordings.initialize import (
        describe,
        initialize_from_cameras,
        initialize_from_recording,
        initialize_with_depth,
    )
    from cardbox_tracker.recordings.recording import open_recording

    pitch_rad = math.radians(options.camera_pitch_deg or 0.0)
    # The body model refuses an impossible distance or pitch by name, before they are used.
    if options.distance is None and options.depth is None and len(options.cameras) < 2:
        raise CardboxError(
            "the distance of the person cannot be measured with one camera; give --distance M, "
            "--depth TOPIC, or two --cameras"
        )
    distance_m = _GUESSED_M if options.distance is None else options.distance
    BodyModel.of(distance_m=distance_m, camera_pitch_rad=pitch_rad)
    inputs = options.recording, options.extrinsics, options.calibration
    check_outputs((options.output,), options.force, inputs=inputs)
    if None not in (options.depth, options.distance) and options.within is None:
        raise CardboxError(
            "--depth and --distance both give the distance of the person; leave one of them out, "
            "or give --within M in place of --background"
        )
    spans = {name: getattr(options, name) for name in REFERENCES}
    silhouettes = silhouettes_of(options)
    pitch_rad, camera = pitch_of(options, detector_among(silhouettes), spans["front"])
    config = InitializationConfig(
        distance_m=distance_m,
        camera_pitch_rad=pitch_rad,
        side_turn=options.side_turn,
        seed=options.seed,
    )
    with (
        open_recording(
            options.recording,
            silhouettes,
            options.cameras,
            options.extrinsics,
            options.depth if options.distance is None else None,
            camera=camera,
        ) as source,
        progress_bar("initialize") as show,
    ):
        if options.distance is not None:
            result = initialize_from_recording(source.first, spans, config, show)
        elif source.measures_depth:
            result = initialize_with_depth(source, spans, config, show)
        else:
            result = initialize_from_cameras(source, spans, config, show)
        remarks = source.first.remarks
    print_remarks(remarks)
    save_body_model(result.body, options.output)
    print(describe(result))
    print(f"wrote {options.output}")
