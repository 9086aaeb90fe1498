"""``cardbox body``: makes a body model from a stature and the proportions of people."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from cardbox_tracker.commands.arguments import add_camera_pitch, add_force, check_outputs


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox body``."""
    parser.add_argument(
        "--stature",
        type=float,
        required=True,
        metavar="M",
        help="height of the person, metres, crown to floor",
    )
    parser.add_argument(
        "--distance",
        type=float,
        metavar="M",
        help="from the camera to the person, metres along the floor; without it, it is found from "
        "the first silhouette, to about a fifth",
    )
    parser.add_argument(
        "--shoulder-breadth",
        type=float,
        metavar="M",
        help="between the shoulder joints, metres; by default it is fitted to the first "
        "silhouette, like all other breadths",
    )
    parser.add_argument(
        "--hip-height",
        type=float,
        metavar="M",
        help="of the middle of the hips above the camera's centre, metres, negative below it; "
        "by default it is fitted to the first silhouette",
    )
    add_camera_pitch(parser)
    parser.add_argument(
        "--output", type=Path, required=True, metavar="MODEL.yaml", help="body model to write"
    )
    add_force(parser)


def run(options: argparse.Namespace) -> None:
    """Write the body model and print its sizes."""
    from cardbox_tracker.person.model import body_from_proportions
    from cardbox_tracker.person.model_file import save_body_model

    check_outputs((options.output,), options.force)
    body = body_from_proportions(
        options.stature,
        options.distance,
        options.shoulder_breadth,
        options.hip_height,
        math.radians(options.camera_pitch_deg),
    )
    save_body_model(body, options.output)
    print(body)
    print(f"wrote {options.output}")
