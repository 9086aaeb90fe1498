"""``cardbox export``: results as files of other programs."""

from __future__ import annotations

import argparse
from pathlib import Path

from cardbox_tracker.commands.arguments import add_force, add_results, check_outputs, results_of
from cardbox_tracker.common.files import body_beside, body_of_person


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox export``."""
    from cardbox_tracker.applications.exporting.formats import formats

    add_results(parser)
    add = parser.add_argument
    add(
        "--to",
        choices=formats(),
        required=True,
        help="trc: markers for OpenSim and Pose2Sim; mot: coordinates for OpenSim; bvh: skeleton "
        "for Blender; c3d: markers, with ezc3d; isb: CSV with joint angles by the recommendations "
        "of the ISB (docs/export.md); or a format that another package adds",
    )
    add(
        "--output",
        type=Path,
        metavar="FILE",
        help="file to write; by default it has the name of the results and is in the current "
        "folder",
    )
    add(
        "--model",
        type=Path,
        metavar="MODEL.yaml",
        help="the person with whom the results were tracked, which bvh needs; trc, mot "
        "and c3d take the pitch of the camera and the floor from it, and the places of hips and "
        "neck. A bag contains it, and OUT.body.yaml beside the table OUT.csv is found",
    )
    add_force(parser)


def run(options: argparse.Namespace) -> None:
    """Read the results and write the file."""
    from cardbox_tracker.applications.exporting.formats import export, formats
    from cardbox_tracker.person.model_file import load_body_model

    chosen = formats()[options.to]
    output = options.output or Path(options.results.resolve().stem + chosen.suffix)
    beside = body_of_person(body_beside(options.results), options.person or 1)
    check_outputs((output,), options.force, inputs=(options.results, options.model, beside))
    chosen.check()
    given = None if options.model is None else load_body_model(options.model)
    results = results_of(options.results, options.person)
    remarks = export(results, output, chosen, given)
    if given is None and chosen.has_places and beside.is_file():
        print(f"took the body of {beside}; --model gives another")
    print(*remarks, f"wrote {output}", sep="\n")
