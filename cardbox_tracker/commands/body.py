"""``cardbox body``: makes a body model from a stature and the proportions of people."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from cardbox_tracker.commands.arguments import add_force, add_options, check_outputs, number
from cardbox_tracker.commands.request import CAMERA_PITCH, TrackingOptions


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox body``."""
    add_options(
        parser,
        TrackingOptions,
        *("stature_m", "distance_m", "camera_pitch_deg"),
        stature_m={
            "type": number,
            "required": True,
            "metavar": "M",
            "help": "height of the person, metres, crown to floor",
        },
        distance_m={
            "help": "from the camera to the person, metres along the floor; without it, it is "
            "found from the first silhouette, to about a fifth"
        },
        camera_pitch_deg={"default": 0.0, "help": CAMERA_PITCH},
    )
    add = parser.add_argument
    add(
        "--shoulder-breadth",
        type=float,
        metavar="M",
        help="between the shoulder joints, metres; by default it is fitted to the first "
        "silhouette, like all other breadths",
    )
    add(
        "--hip-height",
        type=float,
        metavar="M",
        help="of the middle of the hips above the camera's centre, metres, negative below it; "
        "by default it is fitted to the first silhouette",
    )
    add("--output", type=Path, required=True, metavar="MODEL.yaml", help="body model to write")
    add_force(parser)


def run(options: argparse.Namespace) -> None:
    """Write the body model and print its sizes."""
    from cardbox_tracker.person.model_file import save_body_model
    from cardbox_tracker.person.proportions import body_from_proportions

    check_outputs((options.output,), options.force)
    body = body_from_proportions(
        options.stature_m,
        options.distance_m,
        options.shoulder_breadth,
        options.hip_height,
        math.radians(options.camera_pitch_deg),
    )
    save_body_model(body, options.output)
    print(body)
    print(f"wrote {options.output}")
