"""``cardbox export``: results as files of other programs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cardbox_tracker.applications.exporting.formats import NUMBER, export_all, filtered, formats
from cardbox_tracker.commands.arguments import (
    TrackedResults,
    Written,
    check_outputs,
    one_of,
    option,
    time,
)
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import body_beside, body_of_person
from cardbox_tracker.person.model_file import load_body_model
from cardbox_tracker.recordings.result_reader import read_people
from cardbox_tracker.recordings.smoothing import LONGEST_GAP_S


@dataclass(frozen=True, kw_only=True)
class Arguments(TrackedResults, Written):
    """Results, and the format to write.

    Attributes:
        to: trc: markers for OpenSim and Pose2Sim; mot and sto: coordinates for OpenSim; rates:
            their velocities and accelerations; bvh: skeleton for Blender; c3d: markers, with ezc3d;
            isb: CSV with joint angles by the recommendations of the ISB (docs/export.md);
            velocities: CSV with velocities and accelerations; or a format that another package adds
        output: file to write; by default it has the name of the results and is in the current
            folder. With {n} in its name, a file of each person, whose number is there
        model: the person with whom the results were tracked, which bvh needs; trc, mot, sto and c3d
            take the pitch of the camera and the floor from it, and the places of hips and neck. A
            bag contains it, and OUT.body.yaml beside the table OUT.csv is found
        cutoff: fill short gaps and pass the motion through a low-pass without delay (Butterworth,
            4th order) with this cut-off frequency; docs/export.md recommends one
        fill: longest time between two images whose gap is filled, with --cutoff
    """

    to: str = option("FORMAT", lambda given: one_of(formats())(given), required=True)
    output: Path | None = option("FILE")
    model: Path | None = option("MODEL.yaml")
    cutoff: float | None = option("HZ")
    fill: float = option("S", time, LONGEST_GAP_S)


def run(given: Arguments) -> None:
    """Read the results and write the file."""
    chosen = formats()[given.to]
    output = given.output or Path(given.results.resolve().stem + chosen.suffix)
    chosen.check()
    meant = {one.suffix: name for name, one in formats().items()}
    if not chosen.suffix.endswith(output.suffix) and output.suffix in meant:
        raise CardboxError(
            f"{output.name} has the name of another format; give --to {meant[output.suffix]}, or "
            f"a name that ends with {chosen.suffix}"
        )
    model = None if given.model is None else load_body_model(given.model)
    if NUMBER in output.name and given.person is None:
        people = read_people(given.results)
    else:
        people = {given.person or 1: given.read()}
    bodies = [body_of_person(body_beside(given.results), number) for number in people]
    outputs = [output.with_name(output.name.replace(NUMBER, str(number))) for number in people]
    check_outputs(outputs, given.force, inputs=(given.results, given.model, *bodies))
    if given.cutoff is None and given.fill != LONGEST_GAP_S:
        raise CardboxError(
            "--fill needs a low-pass; give --cutoff, as docs/export.md recommends it"
        )
    if given.cutoff is not None:
        people = {
            number: filtered(one, given.cutoff, given.fill, model) if one.is_seen else one
            for number, one in people.items()
        }
    remarks = [*export_all(people, output, chosen, model)]
    if model is None and chosen.has_places:
        for body in filter(Path.is_file, bodies):
            print(f"took the body of {body}; --model gives another")
    print(*remarks, sep="\n")
