"""``cardbox export``: results as files of other programs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from cardbox_tracker.commands.arguments import (
    add_force,
    add_person,
    check_outputs,
)
from cardbox_tracker.common.files import body_beside, body_of_person

if TYPE_CHECKING:
    from cardbox_tracker.applications.exporting.formats import Format
    from cardbox_tracker.person.model import BodyModel

NAME = "export"
HELP = "write results as TRC, MOT, BVH or C3D, or as joint angles of the ISB"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox export``."""
    from cardbox_tracker.applications.exporting.formats import FORMATS

    parser.add_argument(
        "results",
        type=Path,
        metavar="RESULTS",
        help="table of 'cardbox track' (CSV or Parquet), or its bag",
    )
    parser.add_argument(
        "--to",
        choices=FORMATS,
        required=True,
        help="trc: markers for OpenSim and Pose2Sim; mot: coordinates for OpenSim; bvh: skeleton "
        "for Blender; c3d: markers, with ezc3d; isb: CSV with joint angles by the recommendations "
        "of the ISB (docs/export.md)",
    )
    parser.add_argument(
        "--output",
        type=Path,
        metavar="FILE",
        help="file to write; by default it has the name of the results and is in the current "
        "folder",
    )
    parser.add_argument(
        "--model",
        type=Path,
        metavar="MODEL.yaml",
        help="the person with whom the results were tracked, which bvh needs; trc, mot "
        "and c3d take the pitch of the camera and the floor from it, and the places of hips and "
        "neck. A bag contains it, and OUT.body.yaml beside the table OUT.csv is found",
    )
    add_person(parser)
    add_force(parser)


def run(options: argparse.Namespace) -> None:
    """Read the results and write the file."""
    from cardbox_tracker.applications.exporting.formats import FORMATS
    from cardbox_tracker.person.model_file import load_body_model

    chosen = FORMATS[options.to]
    output = options.output or Path(options.results.resolve().stem + chosen.suffix)
    beside = body_of_person(body_beside(options.results), options.person or 1)
    check_outputs((output,), options.force, inputs=(options.results, options.model, beside))
    chosen.check()
    given = None if options.model is None else load_body_model(options.model)
    export(options.results, options.person, chosen, output, given)
    if given is None and chosen.has_places and beside.is_file():
        print(f"took the body of {beside}; --model gives another")


def export(
    path: Path, person: int | None, chosen: Format, output: Path, given: BodyModel | None = None
) -> None:
    """Write results in a format, and print what is exported.

    Args:
        path: table or bag.
        person: number of one of several people.
        chosen: the format.
        output: file to write.
        given: the person that was tracked; None for the one of the results.

    Raises:
        CardboxError: the results cannot be read, have no posture or are those of another body, or
            the file cannot be written.
    """
    from cardbox_tracker.applications.exporting.motion import Motion
    from cardbox_tracker.applications.exporting.placed import images_of_body
    from cardbox_tracker.person.legs import floor_m
    from cardbox_tracker.recordings.result_reader import read_results
    from cardbox_tracker.tracking.estimate import UNCERTAIN

    results = read_results(path, person)
    motion = Motion.of(results)
    body = given or results.body
    images, seen = len(motion.state), int(motion.is_seen.sum())
    if body is not None and chosen.has_places:
        motion = images_of_body(motion, body)
    chosen.write(output, motion, body)
    print(
        f"exported {seen} of {images} images, {motion.state.count(UNCERTAIN)} of them uncertain; "
        f"{images - seen} without a posture are gaps"
    )
    others = seen - int(motion.is_seen.sum())
    if others:
        print(f"{others} of these images were tracked with another body and are gaps, too")
    if body is None and chosen.has_places:
        print("the camera is taken as level, and the floor is not known; --model gives both")
    elif chosen.has_places and body is not None and floor_m(body) is None:
        print("the floor is not known, so heights are those above the camera")
    print(f"wrote {output}")
