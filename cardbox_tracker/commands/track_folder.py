"""``cardbox track FOLDER``: all recordings of a folder, in parallel processes."""

from __future__ import annotations

import argparse
import errno
import io
import shutil
import sys
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from cardbox_tracker import interrupts
from cardbox_tracker.commands.recording_options import options_of
from cardbox_tracker.commands.tracking import ResultFiles, check_person, track_inputs
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.files import claimed_name
from cardbox_tracker.progress import SharedProgress, progress_bar, told

if TYPE_CHECKING:
    from cardbox_tracker.commands.folder_summary import Row

FORMATS = ("csv", "parquet", "mp4", "bag")
"""Results of a recording: a table in one of two formats, a video, a bag."""
_TABLES = FORMATS[:2]
_BODY = ".body.yaml"


class Job(NamedTuple):
    """A recording to track.

    Attributes:
        name: see :func:`~.recordings.folder.recordings_in`.
        options: its options.
        inputs: see :func:`~.folder_summary.digest_of_inputs`.
        files: results to write, in a folder of the job's own.
        progress: the common progress.
        number: number of the job in the common progress.
    """

    name: str
    options: argparse.Namespace
    inputs: str
    files: ResultFiles = ResultFiles()
    progress: SharedProgress | None = None
    number: int = 0


class Outcome(NamedTuple):
    """A finished job: its row, and the lines that it printed."""

    job: Job
    row: Row
    lines: list[str]


def track_folder(options: argparse.Namespace) -> None:
    """Track each recording of a folder that is not finished, and print a summary.

    Raises:
        CardboxError: the results cannot be written, or recordings failed; the text names them.
    """
    from cardbox_tracker.commands.folder_summary import (
        FAILED,
        read_rows,
        text_of,
        text_of_failures,
        write_rows,
    )
    from cardbox_tracker.recordings.folder import SUMMARY, recordings_in

    folder = options.recording
    output = options.output or Path(f"{folder.resolve().name}_tracked")
    recordings = recordings_in(folder, output)
    formats = _formats(options.formats)
    _check_output(output, folder, recordings, options.force)
    before = read_rows(output / SUMMARY)
    jobs, rows = _jobs(options, recordings, formats)
    _check_reasons(rows, len(recordings))
    if not options.force:
        kept = [job for job in jobs if _is_finished(job, before, output, formats)]
        jobs = [job for job in jobs if job not in kept]
        rows |= {job.name: before[job.name] for job in kept}
        if kept:
            print(f"{len(kept)} of {len(recordings)} recordings are finished; --force does again")
    remarks = _track_all(jobs, rows, output, formats, options.jobs)
    for name, row in rows.items():
        if row.status == FAILED:
            _remove(output, name)
    write_rows(output / SUMMARY, rows.values())
    in_order: list[Row] = sorted(rows.values())
    for name, lines in sorted(remarks.items()):
        for line in lines:
            print(f"{name}: {line.removeprefix('cardbox: ')}", file=sys.stderr)
    print(*text_of(in_order), sep="\n")
    print(f"wrote {output}, with this table as {SUMMARY}")
    failed = sum(row.status == FAILED for row in in_order)
    if failed:
        reasons = "".join(f"\n  {line}" for line in text_of_failures(in_order, recordings))
        raise CardboxError(f"{failed} of {len(rows)} recordings failed{reasons}")


def _formats(given: Sequence[str] | None) -> tuple[str, ...]:
    """Return the formats in the order of ``FORMATS``, with a table among them."""
    from cardbox_tracker.recordings.result_table import check_table

    chosen = set(given or ()) | (set() if set(given or ()) & set(_TABLES) else {"csv"})
    if chosen.issuperset(_TABLES):
        raise CardboxError("--formats has csv and parquet; give one of the two")
    formats = tuple(name for name in FORMATS if name in chosen)
    check_table(Path(f"table.{formats[0]}"))
    return formats


def _check_output(output: Path, folder: Path, recordings: Mapping[str, Path], force: bool) -> None:
    """Make the folder of the results, unless it has something else in it."""
    from cardbox_tracker.recordings.folder import SUMMARY

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
    options: argparse.Namespace, recordings: Mapping[str, Path], formats: Sequence[str]
) -> tuple[list[Job], dict[str, Row]]:
    """Return a job for each recording, and the rows of those whose options are wrong."""
    from cardbox_tracker.commands.folder_summary import (
        FAILED,
        Row,
        digest_of_inputs,
        digest_of_program,
    )

    program = digest_of_program()
    jobs, rows = [], {}
    for name, path in recordings.items():
        try:
            own = options_of(options, options.recording, name)
            own.recording = path
            check_person(own)
            jobs.append(Job(name, own, digest_of_inputs(own, formats, program)))
        except (CardboxError, OSError) as error:
            rows[name] = Row(name, FAILED, reason=_one_line(error))
    return jobs, rows


def _check_reasons(rows: Mapping[str, Row], count: int) -> None:
    """Refuse options that are wrong for the same reason in each of several recordings."""
    reasons = {row.reason for row in rows.values()}
    if len(rows) == count > 1 and len(reasons) == 1:
        raise CardboxError(f"{reasons.pop()} (the same for all {count} recordings)")


def _is_finished(job: Job, before: Mapping[str, Row], output: Path, formats: Sequence[str]) -> bool:
    from cardbox_tracker.commands.folder_summary import TRACKED

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
) -> dict[str, list[str]]:
    """Track, and add each row to ``rows`` and to the summary; return printed lines by name."""
    from cardbox_tracker.commands.folder_summary import TRACKED, write_rows
    from cardbox_tracker.estimation.precompile import compile_all
    from cardbox_tracker.processes import cores, results_of
    from cardbox_tracker.recordings.folder import SUMMARY

    # Rows of former settings go first, because their results are replaced one by one.
    write_rows(output / SUMMARY, rows.values())
    remarks: dict[str, list[str]] = {}
    if not jobs:
        return remarks
    count = min(processes or cores(), len(jobs))
    with claimed_name(output / "work", is_folder=True) as work, progress_bar("track") as show:
        if count > 1:
            # Else each process would compile.
            compile_all(sorted({job.options.preset for job in jobs}))
        progress = SharedProgress(work / "progress", len(jobs))
        progress.start()
        prepared = [
            _prepared(job, number, work, formats, progress) for number, job in _by_size(jobs)
        ]
        with (
            told(lambda _: show(progress.fraction()), "", every_s=1.0),
            results_of(track_job, prepared, count) as outcomes,
        ):
            for job, row, lines in outcomes:
                # Results without their row would be tracked again.
                with interrupts.withheld():
                    if row.status == TRACKED:
                        _publish(job, output)
                    rows[job.name], remarks[job.name] = row, lines
                    write_rows(output / SUMMARY, rows.values())
        show(1.0)
    return remarks


def _by_size(jobs: Sequence[Job]) -> list[tuple[int, Job]]:
    """Return the jobs with their numbers, the largest first, so that none is left at the end."""

    def size(job: Job) -> int:
        path = job.options.recording
        files = path.rglob("*") if path.is_dir() else [path]
        return sum(file.stat().st_size for file in files if file.is_file())

    return list(enumerate(sorted(jobs, key=size, reverse=True)))


def _prepared(
    job: Job, number: int, work: Path, formats: Sequence[str], progress: SharedProgress
) -> Job:
    """Return the job with a folder of its own for its results."""
    place = work / str(number) / Path(job.name).name
    place.parent.mkdir()
    paths = {ending: place.with_name(f"{place.name}.{ending}") for ending in formats}
    table = next(paths[ending] for ending in _TABLES if ending in paths)
    body = None if job.options.stature is None else place.with_name(f"{place.name}{_BODY}")
    files = ResultFiles(table, paths.get("mp4"), paths.get("bag"), body)
    return job._replace(files=files, progress=progress, number=number)


def track_job(job: Job) -> Outcome:
    """Track one recording on one thread; a failure is part of the outcome."""
    import cv2

    from cardbox_tracker.commands.folder_summary import FAILED, Row

    cv2.setNumThreads(1)
    show = job.progress.of_task(job.number) if job.progress else lambda _: None
    printed = io.StringIO()
    try:
        with redirect_stdout(printed), redirect_stderr(printed):
            summary = track_inputs(job.options, job.files, force=True, show=show)
        row = Row.tracked(job.name, summary, job.inputs)
    except (CardboxError, OSError) as error:
        row = Row(job.name, FAILED, reason=_one_line(error))
    except Exception as error:
        # A fault of the program in one recording must not stop a hundred others.
        reason = f"unexpected {_one_line(error)}; 'cardbox track' with this recording shows more"
        row = Row(job.name, FAILED, reason=reason)
    show(1.0)
    return Outcome(job, row, printed.getvalue().splitlines())


def _one_line(error: Exception) -> str:
    text = " ".join(str(error).split())
    return text if isinstance(error, CardboxError) else f"{type(error).__name__}: {text}"


def _publish(job: Job, output: Path) -> None:
    """Move the results of a job to their places."""
    _remove(output, job.name)
    place = (output / job.name).parent
    place.mkdir(parents=True, exist_ok=True)
    for path in filter(None, job.files):
        if path.exists():
            path.rename(place / path.name)


def _remove(output: Path, name: str) -> None:
    """Remove the former results of a recording."""
    for ending in (*(f".{ending}" for ending in FORMATS), _BODY):
        path = output / f"{name}{ending}"
        try:
            if path.is_dir():
                shutil.rmtree(path)
            else:
                path.unlink(missing_ok=True)
        except OSError as error:
            # A name that is too long for a file has no results.
            if error.errno != errno.ENAMETOOLONG:
                raise
