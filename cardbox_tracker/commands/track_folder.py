"""``cardbox track FOLDER``: all recordings of a folder, in parallel processes.

The summary, ``_summary.csv``, has a row for each with a digest of what determines its results. By
it an interrupted run goes on, and only what changed is done again.
"""

from __future__ import annotations

import csv
import errno
import hashlib
import io
import os
import shutil
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import fields, is_dataclass, replace
from glob import escape
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numba
import numpy as np

import cardbox_tracker
from cardbox_tracker.commands.request import FORMATS, TABLES, TrackArguments, with_own_options
from cardbox_tracker.commands.tracking import track
from cardbox_tracker.commands.tracking_request import TrackFiles, TrackingRequest, tracking_request
from cardbox_tracker.common import interrupts
from cardbox_tracker.common.errors import CardboxError, plain
from cardbox_tracker.common.files import (
    body_beside,
    claimed_name,
    foreign,
    read_regular,
    scene_beside,
    write_table,
)
from cardbox_tracker.common.processes import cores, results_of
from cardbox_tracker.common.progress import progress_bar
from cardbox_tracker.detectors.point_table import PointTable
from cardbox_tracker.recordings.bag_files import lone_parts
from cardbox_tracker.recordings.open_images import FORMULA, SUMMARY, recordings_in
from cardbox_tracker.recordings.result_table import check_table
from cardbox_tracker.recordings.track import TrackSummary
from cardbox_tracker.tracking.precompile import compile_all

TRACKED, FAILED = "tracked", "failed"

_BODY = body_beside(Path("NAME.csv")).name.removeprefix("NAME")
_SCENE = scene_beside(Path("NAME.csv")).name.removeprefix("NAME")
# Most names of recordings in a line; the table has all.
_MOST_NAMES = 10
# A summary of 100,000 recordings.
_MOST_BYTES = 64 * 1024 * 1024
_SOURCES = ("*.py", "*.json")


class Row(NamedTuple):
    """The row of one recording in the summary; all values are texts, empty where unknown."""

    recording: str  #: its name
    status: str  #: ``TRACKED`` or ``FAILED``
    images: str = ""  #: number of images
    images_tracked: str = ""  #: number of images with a posture
    images_uncertain: str = ""  #: number of images whose posture may be wrong
    mean_cost_px: str = ""  #: mean cost over the tracked images
    mean_iou: str = ""  #: mean overlap over the tracked images
    reason: str = ""  #: reason of a failure
    inputs: str = ""  #: see :func:`digest_of_inputs`

    @classmethod
    def tracked(cls, recording: str, summary: TrackSummary, inputs: str) -> Row:
        """Return the row of a tracked recording."""
        tracked, uncertain = str(summary.frames_tracked), str(summary.frames_uncertain)
        means = f"{summary.mean_cost_px:.1f}", f"{summary.mean_iou:.4f}"
        cost_px, iou = means if summary.frames_tracked else ("", "")
        counts = str(summary.frames), tracked, uncertain
        return cls(recording, TRACKED, *counts, cost_px, iou, inputs=inputs)

    @classmethod
    def failed(cls, recording: str, error: Exception) -> Row:
        """Return the row of a recording that cannot be tracked, with the reason in one line."""
        reason = plain(" ".join(str(error).split()))
        if isinstance(error, OSError):
            reason = f"{type(error).__name__}: {reason}"
        elif not isinstance(error, CardboxError):
            reason = (
                f"unexpected {type(error).__name__}: {reason}; 'cardbox track' with this recording "
                "shows more"
            )
        # Spreadsheets take a path such as =1+1.mp4 for a formula.
        shown = f"({reason})" if reason.startswith(FORMULA) else reason
        return cls(recording, FAILED, reason=shown)


class Job(NamedTuple):
    """A recording to track."""

    name: str  #: see :func:`~.recordings.open_images.recordings_in`
    request: TrackingRequest  #: what is tracked; its results are in a folder of the job's own
    inputs: str  #: see :func:`digest_of_inputs`
    #: folder in which relative paths begin; None for that of the process
    folder: Path | None = None
    program: str = ""  #: see :func:`digest_of_program`; empty if the process has this program


def track_folder(asked: TrackArguments) -> None:
    """Track each recording of a folder that is not finished, and print a summary."""
    folder = asked.recording
    output = asked.output or Path(f"{folder.resolve().name}_tracked")
    recordings = recordings_in(folder, output)
    formats = _formats(asked.formats or ())
    _check_output(output, folder, recordings, asked.force)
    if parts := lone_parts(recordings.values()):
        print(
            f"cardbox: {_listed(parts)} are recordings of their own, and times count from each "
            "one's start; if they are parts of one, complete them, or join those that are left "
            f"with 'ros2 bag reindex {folder}'",
            file=sys.stderr,
        )
    before = _read_rows(output / SUMMARY)
    jobs, rows = _jobs(asked, recordings, formats)
    reasons = list(_reasons(rows.values(), recordings))
    if len(rows) == len(recordings) > 1 and len(reasons) == 1:
        raise CardboxError(f"{reasons[0][1]} (the same for all {len(rows)} recordings)")
    if not asked.force:
        kept = {job.name for job in jobs if _is_finished(job, before, output, formats)}
        jobs = [job for job in jobs if job.name not in kept]
        rows |= {name: before[name] for name in kept}
        if kept:
            print(f"{len(kept)} of {len(recordings)} recordings are finished; --force does again")
    if asked.scheduler is not None:
        # Workers began elsewhere, and may have another version.
        here, program = Path.cwd(), digest_of_program()
        jobs = [job._replace(folder=here, program=program) for job in jobs]
    remarks = _track_all(jobs, rows, output, formats, asked.jobs, asked.scheduler)
    for row in rows.values():
        if row.status == FAILED:
            _remove(output, row.recording)
    _write_rows(output / SUMMARY, rows.values())
    for name, lines in sorted(remarks.items()):
        for line in lines:
            print(f"{name}: {line.removeprefix('cardbox: ')}", file=sys.stderr)
    print(*_table(sorted(rows.values())), sep="\n")
    print(f"wrote {output}, with this table as {SUMMARY}")
    failed = sum(row.status == FAILED for row in rows.values())
    if failed:
        lines = [f"\n  {names}: {reason}" for names, reason in _reasons(rows.values(), recordings)]
        raise CardboxError(f"{failed} of {len(rows)} recordings failed{''.join(lines)}")


def _formats(given: Sequence[str]) -> tuple[str, ...]:
    """Return the formats in the order of ``FORMATS``, with a table among them."""
    chosen = {*given} if {*given} & {*TABLES} else {*given, "csv"}
    if chosen.issuperset(TABLES):
        raise CardboxError("--formats has csv and parquet; give one of the two")
    formats = tuple(name for name in FORMATS if name in chosen)
    check_table(Path(f"table.{formats[0]}"))
    return formats


def _check_output(output: Path, folder: Path, recordings: Mapping[str, Path], force: bool) -> None:
    """Make the folder of the results, unless it has something else in it."""
    for read in (folder, *recordings.values()):
        is_inside = read != folder and read.resolve() in output.resolve().parents
        if is_inside or output.resolve() == read.resolve():
            raise CardboxError(f"cannot write {output}: it is read, as {read}; give another name")
    try:
        output.mkdir(parents=True, exist_ok=True)
        is_other = any(output.iterdir()) and not (output / SUMMARY).exists()
    except OSError as error:
        raise CardboxError(
            f"cannot make the folder {output}: {error.strerror}; give another --output"
        ) from None
    if is_other and not force:
        raise CardboxError(
            f"{output} exists and has no {SUMMARY} of tracked recordings; choose another --output, "
            "or give --force to write into it"
        )


def _jobs(
    asked: TrackArguments, recordings: Mapping[str, Path], formats: Sequence[str]
) -> tuple[list[Job], dict[str, Row]]:
    """Return a job for each recording, and the rows of those whose options are wrong."""
    program = digest_of_program()
    jobs, rows = [], {}
    for name, path in recordings.items():
        try:
            own = with_own_options(asked, asked.recording, name)
            files = TrackFiles(hides_heads=own.blur)
            request = tracking_request(replace(own, recording=path))
            request = replace(request, force=True, files=files)
            jobs.append(Job(name, request, digest_of_inputs(request, formats, program)))
        except (CardboxError, OSError) as error:
            rows[name] = Row.failed(name, error)
    return jobs, rows


def _is_finished(job: Job, before: Mapping[str, Row], output: Path, formats: Sequence[str]) -> bool:
    row = before.get(job.name)
    if row is None or row.status != TRACKED or row.inputs != job.inputs:
        return False
    return all((output / f"{job.name}.{ending}").exists() for ending in formats)


def _track_all(
    jobs: Sequence[Job],
    rows: dict[str, Row],
    output: Path,
    formats: Sequence[str],
    processes: int | None,
    scheduler: str | None,
) -> dict[str, list[str]]:
    """Track, and add each row to ``rows`` and to the summary; return printed lines by name."""
    # Rows of former settings go first, because their results are replaced one by one.
    _write_rows(output / SUMMARY, rows.values())
    remarks: dict[str, list[str]] = {}
    if not jobs:
        return remarks
    count = min(processes or cores(), len(jobs))
    with claimed_name(output / "work", is_folder=True) as work, progress_bar("track") as show:
        if count > 1 or scheduler is not None:
            # Else each process would compile.
            compile_all(sorted({job.request.preset for job in jobs}))
        prepared = [
            _prepared(job, number, work, formats)
            for number, job in enumerate(sorted(jobs, key=_size, reverse=True))
        ]
        with results_of(track_job, prepared, count, scheduler) as outcomes:
            for number, (job, row, lines) in enumerate(outcomes, 1):
                # Results without their row would be tracked again.
                with interrupts.withheld():
                    if row.status == TRACKED:
                        _publish(job, output)
                    rows[job.name], remarks[job.name] = row, lines
                    _write_rows(output / SUMMARY, rows.values())
                show(number / len(prepared))
    return remarks


def _size(job: Job) -> int:
    return sum(file.stat().st_size for file in _files_of(job.request.recording.path))


def _prepared(job: Job, number: int, work: Path, formats: Sequence[str]) -> Job:
    place = work / str(number) / Path(job.name).name
    place.parent.mkdir()
    paths = {ending: place.with_name(f"{place.name}.{ending}") for ending in formats}
    table = next(paths[ending] for ending in TABLES if ending in paths)
    beside = body_beside(table), scene_beside(table)
    given = table, paths.get("mp4"), paths.get("bag"), *beside
    files = TrackFiles(*given, job.request.files.hides_heads)
    return job._replace(request=replace(job.request, files=files))


def track_job(job: Job) -> tuple[Job, Row, list[str]]:
    """Track one recording on one thread; return its row, also of a failure, and printed lines."""
    cv2.setNumThreads(1)
    if job.folder is not None:
        os.chdir(job.folder)
    printed = io.StringIO()
    try:
        if job.program and job.program != digest_of_program():
            raise CardboxError(
                "a worker of the cluster has another version of the package or its libraries; "
                "install the same on all computers"
            )
        with redirect_stdout(printed), redirect_stderr(printed):
            row = Row.tracked(job.name, track(job.request, show=lambda _: None), job.inputs)
    except Exception as error:
        # A fault of the program in one recording must not stop a hundred others.
        row = Row.failed(job.name, error)
    return job, row, printed.getvalue().splitlines()


def _publish(job: Job, output: Path) -> None:
    _remove(output, job.name)
    place = (output / job.name).parent
    place.mkdir(parents=True, exist_ok=True)
    assert job.request.files.table is not None
    # Each of several people has a body.
    for path in sorted(job.request.files.table.parent.iterdir()):
        path.rename(place / path.name)


def _remove(output: Path, name: str) -> None:
    paths = [
        output / f"{name}{ending}" for ending in (*(f".{one}" for one in FORMATS), _BODY, _SCENE)
    ]
    for path in (*paths, *output.glob(f"{escape(name)}.person_*{_BODY}")):
        try:
            if path.is_dir():
                shutil.rmtree(path)
            else:
                path.unlink(missing_ok=True)
        except OSError as error:
            # A name that is too long for a file has no results.
            if error.errno != errno.ENAMETOOLONG:
                raise


def _read_rows(path: Path) -> dict[str, Row]:
    """Return the rows of a summary by the names of the recordings; none if there is no summary."""
    if not path.exists():
        return {}
    expected = "a summary of tracked recordings; remove it, or give another --output"
    with foreign(path, CardboxError, expected):
        text = read_regular(path, _MOST_BYTES).decode()
        header, *cells = csv.reader(io.StringIO(text, newline=""))
        if tuple(header) != Row._fields:
            raise ValueError("it has other columns")
        rows = [Row(*row) for row in cells]
    return {row.recording: row for row in rows}


def _write_rows(path: Path, rows: Iterable[Row]) -> None:
    write_table(path, Row._fields, sorted(rows))


def _table(rows: Sequence[Row]) -> Iterator[str]:
    width = max(len(row.recording) for row in rows)
    yield f"{'':{width}}  images  tracked  uncertain  mean IoU"
    for row in rows:
        if row.status == FAILED:
            yield f"{row.recording:{width}}  failed"
        else:
            yield (
                f"{row.recording:{width}}  {row.images:>6}  {row.images_tracked:>7}  "
                f"{row.images_uncertain:>9}  {row.mean_iou:>8}"
            )


def _reasons(rows: Iterable[Row], paths: Mapping[str, Path]) -> Iterator[tuple[str, str]]:
    """Yield recordings that failed for one reason but for their path, and the first one's text."""
    reasons: dict[str, list[Row]] = {}
    for row in sorted(rows):
        if row.status == FAILED:
            common = row.reason.replace(str(paths[row.recording]), "")
            reasons.setdefault(common, []).append(row)
    for failed in reasons.values():
        yield _listed([row.recording for row in failed]), failed[0].reason


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return f"{', '.join(names[:_MOST_NAMES])}{more}"


def digest_of_inputs(request: TrackingRequest, formats: Sequence[str], program: str) -> str:
    """Return a digest of what determines results: content, but name, size, time of recordings."""
    path = request.recording.path
    asked = replace(request, recording=replace(request.recording, path=Path()), inputs=())
    digest = hashlib.sha256(f"{program} {formats}".encode())
    for value in _values(asked):
        if isinstance(value, Path) and value.is_file():
            with value.open("rb") as file:
                digest.update(b"\0" + hashlib.file_digest(file, "sha256").digest())
        else:
            digest.update(b"\0" + repr(value).encode())
    points = request.recording.points
    folders = [points.path] if isinstance(points, PointTable) and points.path.is_dir() else []
    for entry in [file for folder in (path, *folders) for file in _files_of(folder)]:
        found = entry.stat()
        # Names inside of a recording may be no UTF-8.
        digest.update(b"\0" + os.fsencode(entry.name))
        digest.update(f" {found.st_size} {found.st_mtime_ns}".encode())
    return digest.hexdigest()[:32]


def _values(part: Any) -> Iterator[Any]:
    """Yield the values in a request, and the types of its parts."""
    if is_dataclass(part) and not isinstance(part, type):
        yield type(part).__name__
        for entry in fields(part):
            yield from _values(getattr(part, entry.name))
    elif isinstance(part, tuple):
        yield type(part).__name__
        for one in part:
            yield from _values(one)
    else:
        yield part


def _files_of(recording: Path) -> list[Path]:
    if not recording.is_dir():
        return [recording]
    return sorted(path for path in recording.rglob("*") if path.is_file())


def digest_of_program() -> str:
    """Return a digest of the package's files and of the versions of its numerical libraries."""
    folder = Path(cardbox_tracker.__file__).parent
    digest = hashlib.sha256(f"{np.__version__} {cv2.__version__} {numba.__version__}".encode())
    for path in sorted(path for pattern in _SOURCES for path in folder.rglob(pattern)):
        digest.update(f"{path.relative_to(folder)}\0".encode() + path.read_bytes())
    return digest.hexdigest()
