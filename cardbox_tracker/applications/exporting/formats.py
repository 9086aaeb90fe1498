"""The formats of ``cardbox export`` by name, and results for programs, which save in them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cache, partial
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cardbox_tracker.applications.exporting.bvh import write_bvh
from cardbox_tracker.applications.exporting.markers import ezc3d_or_error, write_c3d, write_trc
from cardbox_tracker.applications.exporting.mot import write_mot, write_rates, write_sto
from cardbox_tracker.applications.exporting.motion import Motion, images_of_body
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.extensions import (
    EXPORTERS,
    called,
    extensions,
    loaded,
    optional,
    place_of,
)
from cardbox_tracker.common.files import atomic_path, scene_beside, write_table
from cardbox_tracker.measuring.scene import Scene, load_scene
from cardbox_tracker.person.isb_angles import ISB_NAMES, isb_angles
from cardbox_tracker.person.legs import floor_m
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import POSTURE_GROUPS, Group, joints_of
from cardbox_tracker.recordings import result_reader
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.recordings.result_table import RATE_COLUMNS, units
from cardbox_tracker.recordings.smoothing import LONGEST_GAP_S, AnyResults, low_passed, rates_of
from cardbox_tracker.tracking.estimate import FILLED, UNCERTAIN

NUMBER = "{n}"
"""Where the number of the person is in a name for the files of all people."""


def _write_csv(path: Path, motion: Motion, names: Iterable[str], values: FloatArray) -> None:
    rows = (
        (str(stamp_ns), f"{time_s:.6f}", state, *("" if v != v else f"{v:.6f}" for v in row))
        for stamp_ns, time_s, state, row in zip(
            motion.stamp_ns.tolist(), motion.time_s, motion.state, values.tolist(), strict=True
        )
    )
    write_table(path, ("stamp_ns", "time_s", "state", *names), rows)


def write_isb(path: Path, motion: Motion, body: BodyModel | None = None) -> None:
    """Write CSV with angles of the ISB in degrees, then our joints, or raise CardboxError."""
    groups = *POSTURE_GROUPS, Group.PLACE, Group.NECK
    values = np.hstack([np.degrees(isb_angles(motion.states)), motion.values_of(*groups)])
    units = (f"{joint.name}_{joint.unit}" for joint in joints_of(*groups))
    _write_csv(path, motion, (*(f"{name}_deg" for name in ISB_NAMES), *units), values)


def write_velocities(path: Path, motion: Motion, body: BodyModel | None = None) -> None:
    """Write CSV with the known ones of ``RATE_COLUMNS``, or raise CardboxError."""
    rates = motion.rates()
    known = np.flatnonzero(np.isfinite(rates).any(axis=0))
    _write_csv(path, motion, (RATE_COLUMNS[i] for i in known), rates[:, known])


class Format(NamedTuple):
    """One format."""

    suffix: str  #: end of the names of its files
    #: writes a motion of a body to a file; the body may be unknown
    write: Callable[[Path, Motion, BodyModel | None], None]
    check: Callable[[], object] = lambda: None  #: raises CardboxError if a library is missing
    has_places: bool = True  #: whether it depends on the pitch of the camera


FORMATS: dict[str, Format] = {
    "trc": Format(".trc", write_trc),
    "bvh": Format(".bvh", write_bvh),
    "c3d": Format(".c3d", write_c3d, ezc3d_or_error),
    "mot": Format(".mot", write_mot),
    "sto": Format(".sto", write_sto),
    "rates": Format(".rates.sto", write_rates),
    "isb": Format(".isb.csv", write_isb, has_places=False),
    "velocities": Format(".velocities.csv", write_velocities, has_places=False),
}


@cache
def formats() -> Mapping[str, Format]:
    """Return all formats by name, others' last; CardboxError if a name is taken.

    Distributions that are installed later are not seen.

    One that cannot be loaded raises CardboxError, with its distribution, where it is used.
    """
    foreign = {name: _foreign(one) for name, one in extensions(EXPORTERS, FORMATS).items()}
    return FORMATS | foreign


def _foreign(entry: EntryPoint) -> Format:
    """Return a format of another distribution, whose files are whole or not there."""
    name = f"{entry.name} of {place_of(entry)}"
    try:
        found = loaded(entry)
        if (
            not isinstance(found, Format)
            or not isinstance(found.suffix, str)
            or not found.suffix.startswith(".")
            or os.sep in found.suffix
        ):
            raise CardboxError(f"{name} is no {Format} with an ending such as .trc")
    except CardboxError as error:
        return Format(f".{entry.name}", write_mot, partial(_raise, error))

    def write(path: Path, motion: Motion, body: BodyModel | None) -> None:
        with atomic_path(path) as there:
            # What it changes must not change what others write.
            own = deepcopy((motion, body))
            called(lambda: found.write(there, *own), f"{name} fails, so {path} is not written")
            if there.is_symlink() or not there.is_file() or not there.stat().st_size:
                raise CardboxError(f"{name} has not written the file whose path it was given")

    return found._replace(write=write, check=lambda: called(found.check, f"{name} cannot be used"))


def _raise(error: Exception) -> None:
    raise error


def filtered(
    results: AnyResults,
    cutoff_hz: float,
    longest_gap_s: float = LONGEST_GAP_S,
    model: BodyModel | None = None,
) -> AnyResults:
    """Return results after :func:`low_passed`; those of another body, if it is known, are gaps.

    Raises CardboxError as it does, if no image has a posture, or most are of another body.
    """
    motion, body = Motion.of(results), model or results.body
    is_gap = ~(motion if body is None else images_of_body(motion, body)).is_seen
    numbers = {name: np.where(is_gap, np.nan, of) for name, of in results.numbers.items()}
    return low_passed(replace(results, numbers=numbers), cutoff_hz, longest_gap_s)


def export(results: Results, path: Path, to: Format, model: BodyModel | None = None) -> list[str]:
    """Write results of one person, by default of the body that they have; return lines about it.

    Raises CardboxError if no image has a posture, the results are those of another person, a
    library is missing, or the file cannot be written.
    """
    to.check()
    motion, body = Motion.of(results), model or results.body
    images, seen = len(motion.state), int(motion.is_seen.sum())
    # The low-pass moves points from where the joints have them.
    if body is not None and to.has_places and results.cutoff_hz is None:
        motion = images_of_body(motion, body)
    to.write(path, motion, body)
    lines = [
        f"exported {seen} of {images} images, {motion.state.count(UNCERTAIN)} of them uncertain; "
        f"{images - seen} without a posture are gaps"
    ]
    if filled := motion.state.count(FILLED):
        lines.append(f"{filled} of them were gaps that are filled")
    if images == 1:
        lines.append("a single image has no rate: 1 Hz is written")
    if others := seen - int(motion.is_seen.sum()):
        lines.append(f"{others} of these images were tracked with another body and are gaps, too")
    if body is None and to.has_places:
        lines.append("the camera is taken as level, and the floor is not known; --model gives both")
    elif to.has_places and body is not None and floor_m(body) is None:
        lines.append("the floor is not known, so heights are those above the camera")
    return lines


def export_all(
    people: Mapping[int, Results], named: Path, to: Format, model: BodyModel | None = None
) -> Iterator[str]:
    """Write a file of each person by their numbers, and yield lines about it; see :func:`export`.

    In the name of a file, ``NUMBER`` is the number. Who is seen in no image has no file, which is
    said, unless nobody is seen.
    """
    seen = {k: one for k, one in people.items() if one.is_seen} or people
    yield from (f"person {k} is in no image, and has no file" for k in people if k not in seen)
    for number, results in seen.items():
        path = named.with_name(named.name.replace(NUMBER, str(number)))
        yield from (*export(results, path, to, model), f"wrote {path}")


@dataclass(frozen=True)
class Result(Results):
    """Results of one person."""

    scene: Scene | None = None  #: camera and people as of ``OUT.scene.yaml``, if they are known
    #: those of ``track(..., people=...)``, or in the file, by the numbers; empty for one alone
    people: Mapping[int, Result] = field(default_factory=dict)

    def filtered(self, cutoff_hz: float, longest_gap_s: float = LONGEST_GAP_S) -> Result:
        """Return this person's results after a low-pass without delay, with short gaps filled.

        See ``docs/export.md``. Raises CardboxError unless the cut-off, Hz, is from 0.01 to 0.45
        of the rate of the images, or if no image has a posture.
        """
        return filtered(self, cutoff_hz, longest_gap_s)

    def velocities(self) -> dict[str, FloatArray]:
        """Return velocities and accelerations, (n,), by columns as ``--to velocities`` has them."""
        return dict(zip(RATE_COLUMNS, rates_of(self).T, strict=True))

    def to_pandas(self) -> Any:
        """Return a ``pandas.DataFrame`` with a row for each image and the columns of the table.

        Unknown numbers are nan, unknown texts empty; ``stamp_ns`` is the only stamp. Raises
        CardboxError if pandas is not installed.
        """
        pandas = optional("pandas", "to_pandas needs the library pandas", "pandas")
        times = {"stamp_ns": self.stamp_ns, "time_s": self.time_s, "state": self.state}
        found = {**times, **self.numbers, **self.texts}
        return pandas.DataFrame({name: found[name] for name in units(*[True] * 5) if name in found})

    def save(self, path: str | os.PathLike[str]) -> list[str]:
        """Write, or replace, a file in the format of its ending; return lines about it.

        With ``{n}`` in its name, each of ``people`` has a file with their number there. Raises
        CardboxError if no format has this ending, or as :func:`~.formats.export`.
        """
        path, known = Path(path), formats().values()
        fitting = [one for one in known if path.name.endswith(one.suffix)]
        if not fitting:
            endings = ", ".join(one.suffix for one in known)
            raise CardboxError(
                f"no format has the ending of {path}; those are {endings}; "
                "track(..., csv='OUT.csv') keeps the table"
            )
        to = max(fitting, key=lambda one: len(one.suffix))
        if NUMBER in path.name:
            return [*export_all(self.people or {1: self}, path, to)]
        return export(self, path, to)


def read_result(path: str | os.PathLike[str], person: int | None = None) -> Result:
    """Return the results in a table or a bag, and their scene; CardboxError names a wrong line.

    Without ``person``, they are those of the first one, and ``people`` has each of several.
    """
    path = Path(path)
    found, beside = result_reader.read_people(path, person), scene_beside(path)
    scene = load_scene(beside) if beside.is_file() else None
    people = {number: Result(**vars(one), scene=scene) for number, one in found.items()}
    first = people[min(people)]
    return first if len(people) == 1 else replace(first, people=people)
