"""``cardbox urdf``: prints the robot description of a measured person."""

from __future__ import annotations

import argparse
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox urdf``."""
    parser.add_argument("model", type=Path, metavar="MODEL.yaml", help="the person")
    parser.add_argument(
        "--no-torso-place",
        dest="torso_place",
        action="store_false",
        help="leave out the joints of place, neck and clavicles, for joint states without them",
    )


def run(options: argparse.Namespace) -> None:
    """Print the URDF."""
    from cardbox_tracker.person.model_file import load_body_model
    from cardbox_tracker.person.urdf import urdf_from_body

    print(urdf_from_body(load_body_model(options.model), torso_place=options.torso_place))
