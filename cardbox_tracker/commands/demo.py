"""``cardbox demo``: runs the whole chain on a synthetic recording."""

from __future__ import annotations

import argparse
from pathlib import Path

from cardbox_tracker.commands.arguments import add_camera_count, add_preset, add_seed

NAME = "demo"
HELP = "run the whole chain on a synthetic recording, with real nodes"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox demo``."""
    parser.add_argument(
        "--output", type=Path, default=Path("demo_output"), metavar="DIR", help="folder of results"
    )
    add_preset(parser)
    add_camera_count(parser, "several see the person together, with the preset default")
    add_seed(parser, "the recording and the filters")


def run(options: argparse.Namespace) -> None:
    """Record, measure and track a synthetic person through the nodes; write the results."""
    from cardbox_tracker.ros.demo.run import run_demo

    run_demo(options.output, options.preset, options.seed, options.cameras)
