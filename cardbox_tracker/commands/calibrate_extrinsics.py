"""``cardbox calibrate-extrinsics``: estimates the extrinsics of a recording's cameras."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from cardbox_tracker.commands.arguments import (
    REFERENCES,
    add_force,
    add_options,
    add_references,
    add_seed,
    check_outputs,
    span,
)
from cardbox_tracker.commands.initialize import measuring_config
from cardbox_tracker.commands.request import CAMERA_PITCH, RecordingOptions, TrackingOptions


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox calibrate-extrinsics``."""
    add_options(
        parser,
        RecordingOptions,
        *("recording", "background", "cameras"),
        recording={"metavar": "BAG", "help": "rosbag2 folder or file of all cameras"},
        background={"required": True},
        cameras={
            "required": True,
            "help": "cameras of the recording that see the person, such as cam0 cam1, the one that "
            "the person faced first",
        },
    )
    add_references(parser)
    parser.add_argument(
        "--motion",
        type=span,
        required=True,
        metavar="T0:T1",
        help="seconds in which the person moves, at first standing as for --front; 10 s or more "
        "in which the arms are raised and the person turns and steps about",
    )
    add_options(
        parser,
        TrackingOptions,
        *("distance_m", "camera_pitch_deg"),
        distance_m={
            "required": True,
            "help": "from the first camera to the person, metres along the floor; distances "
            "between the cameras are proportional to it",
        },
        camera_pitch_deg={"default": 0.0, "help": CAMERA_PITCH},
    )
    add_seed(parser, "the hypotheses and the filter")
    parser.add_argument(
        "--output",
        type=Path,
        required=True,
        metavar="EXTRINSICS.yaml",
        help="camchain as of Kalibr to write, for --extrinsics",
    )
    add_force(parser)


def run(options: argparse.Namespace) -> None:
    """Estimate the extrinsics, write them and print their uncertainty."""
    from cardbox_tracker.camera.extrinsics_files import save_camchain
    from cardbox_tracker.common.progress import progress_bar
    from cardbox_tracker.recordings.calibrate import calibrate_recording

    check_outputs((options.output,), options.force, inputs=(options.recording,))
    pitch_rad = math.radians(options.camera_pitch_deg)
    config = measuring_config(options, options.distance_m, pitch_rad)
    references = {name: getattr(options, name) for name in REFERENCES}
    with progress_bar("calibrate") as show:
        result = calibrate_recording(
            options.recording,
            options.cameras,
            options.background,
            references,
            options.motion,
            config,
            show,
        )
    found = {name: camera.extrinsics for name, camera in result.found.items()}
    save_camchain(options.output, result.cameras, found)
    for name, camera in result.found.items():
        print(f"{name}: {camera}")
    print(f"wrote {options.output}")
