"""``cardbox synthesize``: records a synthetic person."""

from __future__ import annotations

import argparse
from pathlib import Path

from cardbox_tracker.commands.arguments import add_camera_count, add_force, add_seed, check_outputs


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox synthesize``."""
    add = parser.add_argument
    add(
        "--motion",
        default="all",
        help="motion after the reference postures: wave, bend, bow or all",
    )
    add("--output", type=Path, required=True, metavar="BAG", help="recording to write")
    add_seed(parser, "noise and sway")
    add("--storage", choices=("mcap", "sqlite3"), default="mcap", help="format of the recording")
    add("--compressed", action="store_true", help="write JPEG images instead of raw ones")
    add_camera_count(
        parser, "several are cam0, cam1, ..., and BAG/extrinsics.yaml says where they stand"
    )
    add_force(parser)


def run(options: argparse.Namespace) -> None:
    """Write the recording."""
    from cardbox_tracker.applications.simulation.session import SessionFormat, synthesize_session
    from cardbox_tracker.common.progress import progress_bar

    check_outputs((), options.force, results=(options.output,))
    form = SessionFormat(
        cameras=options.cameras, compressed=options.compressed, storage=options.storage
    )
    with progress_bar("synthesize") as show:
        synthesize_session(
            *(options.output, options.motion, options.seed, form),
            overwrite=options.force,
            progress=show,
        )
    print(f"wrote {options.output}")
