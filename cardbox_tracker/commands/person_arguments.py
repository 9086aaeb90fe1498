"""Options that describe the person in a recording: a measured model, or the stature."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from cardbox_tracker.commands.arguments import add_camera_pitch, time
from cardbox_tracker.commands.camera_arguments import check_alone
from cardbox_tracker.errors import CardboxError

if TYPE_CHECKING:
    from cardbox_tracker.body.model import BodyModel

STANDING_S = 1.0
"""Time for which a person of a given stature stands upright at the start, seconds."""
COMES_WITHIN_S = 30.0
"""Time after the start within which a person of a given stature is sought, seconds."""


def add_person(parser: argparse.ArgumentParser, required: bool = True) -> None:
    """Add ``--model``, ``--stature``, ``--distance``, ``--camera-pitch-deg`` and ``--start``."""
    person = parser.add_mutually_exclusive_group(required=required)
    person.add_argument(
        "--model",
        type=Path,
        default=None,
        metavar="MODEL.yaml",
        help="the person, from 'cardbox initialize', the node initializer, or 'cardbox body'",
    )
    person.add_argument(
        "--stature",
        type=float,
        default=None,
        metavar="M",
        help="in place of --model: height of the person, metres, crown to floor; sizes are the "
        "mean ones of people of that stature",
    )
    parser.add_argument(
        "--distance",
        type=float,
        default=None,
        metavar="M",
        help="with --stature: from the camera to the person, metres along the floor; without it, "
        "it is found from the first images",
    )
    add_camera_pitch(parser, "with --stature, found from the person who stands upright at --start")
    parser.add_argument(
        "--start",
        type=time,
        default=None,
        metavar="T",
        help="second at which the person stands as for --front; tracking starts there. With "
        "--stature, or a body of 'cardbox body', any posture will do: it is fitted to the first "
        "silhouette (default with --stature: 0)",
    )


def start_of(options: argparse.Namespace) -> float:
    """Return the second at which tracking starts.

    Raises:
        CardboxError: neither ``--start`` nor ``--stature`` is given.
    """
    if options.start is not None:
        return float(options.start)
    if options.stature is None:
        raise CardboxError(
            "--model needs --start T, the second at which the person stands as for --front"
        )
    return 0.0


def measured_person(options: argparse.Namespace) -> BodyModel:
    """Return the body of ``--model``.

    Raises:
        BodyModelError: the file cannot be read.
        CardboxError: options are given that only act with ``--stature``.
    """
    from cardbox_tracker.body.model_file import load_body_model

    check_alone(options, ("--distance", "--camera-pitch-deg"), "with --model, which contains it")
    body = load_body_model(options.model)
    if body.doubt:
        print(f"{options.model}: {body.doubt}")
    return body


def person_of_stature(options: argparse.Namespace, camera_pitch_rad: float = 0.0) -> BodyModel:
    """Return a body of ``--stature``.

    Raises:
        BodyModelError: a number is out of range.
    """
    from cardbox_tracker.body.proportions import body_from_proportions

    return body_from_proportions(
        options.stature, options.distance, camera_pitch_rad=camera_pitch_rad
    )
