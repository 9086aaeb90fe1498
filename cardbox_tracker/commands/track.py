"""``cardbox track``: the posture in each image of a recording, or of a folder of recordings.

:func:`track` does the same from Python (``docs/python.md``).
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from itertools import chain
from pathlib import Path
from typing import Any

from cardbox_tracker.applications.exporting.formats import Format, Result, export, formats
from cardbox_tracker.applications.reporting.page import FIGURES, page_figure, write_page
from cardbox_tracker.commands.arguments import check_outputs, print_remarks
from cardbox_tracker.commands.request import Request, TrackArguments
from cardbox_tracker.commands.tracking import track as track_request
from cardbox_tracker.commands.tracking_request import TrackFiles, tracking_request
from cardbox_tracker.common.errors import CardboxError, quoted
from cardbox_tracker.common.files import (
    body_beside,
    is_written_in_place,
    of_person,
    scene_beside,
    write_file,
)
from cardbox_tracker.common.settings import suggestion
from cardbox_tracker.measuring.scene import dumps_scene, loads_scene
from cardbox_tracker.recordings.open_images import is_one_recording, recordings_in
from cardbox_tracker.recordings.result_reader import KeptResults, Results
from cardbox_tracker.recordings.result_table import check_table
from cardbox_tracker.recordings.track import TrackSummary
from cardbox_tracker.tracking.precompile import compile_for_films

Arguments = TrackArguments

_FILES = "csv", "bag", "video", "json", "plot", "report"


def run(asked: Arguments) -> None:
    """Track the person and write the requested files."""
    path = asked.recording
    if not asked.films and not is_one_recording(path) and recordings_in(path, asked.output):
        from cardbox_tracker.commands.track_folder import track_folder

        for fault in _without_effect(asked, Request, "a folder of recordings: give --formats"):
            raise CardboxError(fault)
        if None not in (asked.jobs, asked.scheduler):
            raise CardboxError("--jobs has no effect with --scheduler: its workers are as many")
        track_folder(asked)
        return
    faults = _without_effect(asked, TrackArguments, "which is one recording: give --csv")
    asked = replace(asked, csv=asked.csv or Path(f"{_name(path)}.csv"))
    if asked.shots:
        _track_shots(asked, faults)
    else:
        track_one(asked, faults)


def _track_shots(asked: Request, faults: Iterable[str]) -> None:
    """Track each shot by itself; the files of further ones have its number."""
    request = tracking_request(asked, faults)
    with request.recording.open() as source:
        spans = source.first.shots(request.person.start_s, request.person.end_s)
    left_out = 0
    for number, span in enumerate(spans, 1):
        print(f"shot {number} of {len(spans)}: {span.start_s:.2f} to {span.end_s:.2f} s")
        changed: dict[str, Any] = {"start_s": span.start_s, "end_s": span.end_s}
        for name in _FILES:
            path = getattr(asked, name)
            if path is not None and number > 1:
                changed[name] = path.with_name(f"{path.stem}.shot_{number}{path.suffix}")
        try:
            track_one(replace(asked, **changed))
        except CardboxError as error:
            left_out += 1
            if left_out == len(spans):
                raise
            print_remarks([f"shot {number} is left out: {error}"])


def track(
    recording: Request | str | os.PathLike[str] | Sequence[str | os.PathLike[str]], **options: Any
) -> Result:
    """Track a recording as ``cardbox track`` does; return the results, of ``person`` or the first.

    Either a :class:`Request` or a recording, or several films of the same people, and the fields of
    one as keywords. ``Result.people`` has each of several people. Without ``csv`` no table is kept.
    Raises CardboxError if the request is wrong, or a file cannot be read or written.
    """
    known = [entry.name for entry in fields(Request)][1:]
    for name in options.keys() - {*known}:
        near = suggestion(name, known)
        raise CardboxError(f"track has no keyword {name}; {near}expected any of {', '.join(known)}")
    if not isinstance(recording, Request):
        is_one = isinstance(recording, str | os.PathLike)
        paths: list[Any] = list(recording) if isinstance(recording, Iterable) else []
        paths = [recording] if is_one else paths
        if not paths or not all(isinstance(one, str | os.PathLike) for one in paths):
            raise CardboxError(
                f"track has no recording, but {quoted(recording)}; give a path, or several films"
            )
        recording = Request(Path(paths[0]), films=tuple(map(Path, paths[1:])))
    asked = replace(recording, **options)
    path = asked.recording
    if asked.shots:
        raise CardboxError("shots is for files of each: give start_s and end_s of one")
    if asked.export and asked.csv is None:
        raise CardboxError("export writes beside the table: give csv, or save the result")
    if path.is_dir() and not is_one_recording(path):
        raise CardboxError(f"{path} is no recording; track its recordings one by one")
    summary, kept = track_one(asked, show=lambda _: None)
    scene = summary.scene and loads_scene(dumps_scene(summary.scene))
    people = {number: Result(**vars(one), scene=scene) for number, one in kept.items()}
    if asked.number not in people:
        raise CardboxError(f"{path} shows {len(people)} people, and no person {asked.number}")
    return replace(people[asked.number], people={} if asked.people is None else people)


def _name(recording: Path) -> Path:
    path = recording.resolve()
    return Path(path.name if path.is_dir() else path.stem)


def _without_effect(asked: TrackArguments, kind: type[Request], what: str) -> list[str]:
    """Return a fault for each given option of a class itself, which has no effect on ``what``."""
    known = {name for name in vars(kind) if name not in ("force", "blur")}
    own = [flag for flag in asked.given() if flag[2:] in known]
    return [f"{flag} has no effect on {asked.recording}, {what}" for flag in own]


def track_one(
    asked: Request, faults: Iterable[str] = (), show: Callable[[float], None] | None = None
) -> tuple[TrackSummary, dict[int, Results]]:
    """Track one recording and write the requested files; see :func:`.tracking.track`.

    The results of each person are kept and returned with ``show``, or if a file is made of them.
    """
    if asked.blur and not (asked.video or asked.report or asked.bag):
        faults = [*faults, "--blur has no effect without pictures: give --video, --report or --bag"]
    request = tracking_request(asked, faults)
    for flag, suffixes in (("plot", FIGURES), ("report", (".html",)), ("video", (".mp4",))):
        path = getattr(asked, flag)
        if path is not None and path.suffix not in suffixes:
            raise CardboxError(f"--{flag} {path}: its name must end in {' or '.join(suffixes)}")
    files, exports = _files(asked, request.person.model is None)
    written = (files.table, files.body, files.scene, files.video, asked.json)
    derived = (*exports.values(), asked.plot, asked.report)
    check_outputs((*written, *derived), asked.force, request.inputs, results=(asked.bag,))
    if request.preset == "default":
        compile_for_films()
    kept = KeptResults(asked.recording, **request.has)
    observers = (kept,) if show is not None or any(derived) else ()
    summary = track_request(replace(request, files=files, force=asked.force), observers, show)
    if asked.json is not None:
        write_file(asked.json, json.dumps(_account(summary), indent=1) + "\n")
    people = kept.results()
    lines = [f"wrote {path}" for path in (*written, asked.bag) if path is not None]
    more = _derived(asked, summary, people, files.video, exports) if any(derived) else ()
    # If an export fails, what was written before it is told.
    for line in chain(lines, summary.accounts, more):
        if show is None:
            print(line)
    return summary, people


def _files(asked: Request, is_new_body: bool) -> tuple[TrackFiles, dict[Format, Path]]:
    """Return the files that are written while a recording is tracked, and then in formats."""
    table, video = asked.csv, asked.video
    if asked.report is not None and video is None:
        video = asked.report.with_suffix(".overlay.mp4")
    if table is None:
        return TrackFiles(None, video, asked.bag, hides_heads=asked.blur), {}
    check_table(table)
    # There is no place for a further file beside a pipe.
    is_piped = is_written_in_place(table)
    beside = _name(asked.recording) if is_piped else table
    body = body_beside(beside) if is_new_body or not is_piped else None
    chosen = [formats()[name] for name in asked.export or ()]
    for form in chosen:
        form.check()
    exports = {form: beside.with_name(beside.stem + form.suffix) for form in chosen}
    scene = scene_beside(beside)
    return TrackFiles(table, video, asked.bag, body, scene, asked.blur), exports


def _derived(
    asked: Request,
    summary: TrackSummary,
    people: Mapping[int, Results],
    video: Path | None,
    exports: Mapping[Format, Path],
) -> Iterator[str]:
    """Write what is made of the results, of several people files of each, and say it."""
    tracked = (number for number, one in summary.people.items() if one.frames_tracked)
    people = {number: people[number] for number in tracked} or people
    if not people:
        raise CardboxError(f"{asked.recording} shows nobody to export, plot or report")
    if asked.plot is not None:
        for number, results in people.items():
            path = of_person(asked.plot, number, asked.plot.suffix)
            write_file(path, page_figure(results, path.suffix))
            yield f"wrote {path}"
    if asked.report is not None and video is not None:
        named = {
            f"Person {k}" if summary.people else "Person": (one, summary.people.get(k, summary))
            for k, one in people.items()
        }
        lines = (*summary.assumptions, *summary.remarks, *summary.accounts)
        title = f"Posture in {asked.recording.name}"
        write_page(asked.report, video, title, named, lines, summary.cameras, asked.blur)
        yield f"wrote {asked.report}"
    for form, path in exports.items():
        for number, results in people.items():
            output = of_person(path, number, form.suffix)
            yield from (*export(results, output, form), f"wrote {output}")


def _account(summary: TrackSummary) -> dict[str, Any]:
    found: dict[str, Any] = {
        "images": summary.frames,
        "tracked": summary.frames_tracked,
        "uncertain": summary.frames_uncertain,
        "used": dict(summary.used),
        "assumed": summary.assumptions,
        "scene": {} if summary.scene is None else summary.scene.numbers(),
        "remarks": summary.remarks,
        "cameras": summary.accounts,
    }
    if summary.cameras:
        found["extrinsics"] = {
            name: {
                "rotation": one.rotation.tolist(),
                "translation_m": one.translation_m.tolist(),
            }
            for name, one in summary.cameras.items()
        }
    if summary.people:
        found["people"] = {number: _account(one) for number, one in summary.people.items()}
    return found
