"""Summary of the tracked recordings of a folder, from which an interrupted run goes on."""

from __future__ import annotations

import argparse
import csv
import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import cv2
import numba
import numpy as np

import cardbox_tracker
from cardbox_tracker.commands.arguments import points_of, silhouettes_of
from cardbox_tracker.commands.camera_arguments import detector_among
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.files import write_table

if TYPE_CHECKING:
    from cardbox_tracker.recordings.track import TrackSummary

TRACKED, FAILED = "tracked", "failed"
# Options of the command that change no result of a recording.
_NO_SETTINGS = ("command", "run", "recording", "output", "jobs", "force", "csv", "bag", "video")
# Most names of recordings in a line; the table has all.
_MOST_NAMES = 10
_SOURCES = ("*.py", "*.json", "*.npz")


class Row(NamedTuple):
    """The row of one recording; all values are texts, empty where unknown.

    Attributes:
        recording: its name.
        status: ``TRACKED`` or ``FAILED``.
        images: number of images.
        images_tracked: number of images with a posture.
        images_uncertain: number of images whose posture may be wrong.
        mean_cost_px: mean cost over the tracked images.
        mean_iou: mean overlap over the tracked images.
        reason: reason of a failure.
        inputs: see :func:`digest_of_inputs`.
    """

    recording: str
    status: str
    images: str = ""
    images_tracked: str = ""
    images_uncertain: str = ""
    mean_cost_px: str = ""
    mean_iou: str = ""
    reason: str = ""
    inputs: str = ""

    @classmethod
    def tracked(cls, recording: str, summary: TrackSummary, inputs: str) -> Row:
        """Return the row of a tracked recording."""
        is_seen = summary.frames_tracked > 0
        return cls(
            recording,
            TRACKED,
            str(summary.frames),
            str(summary.frames_tracked),
            str(summary.frames_uncertain),
            f"{summary.mean_cost_px:.1f}" if is_seen else "",
            f"{summary.mean_iou:.4f}" if is_seen else "",
            inputs=inputs,
        )


def read_rows(path: Path) -> dict[str, Row]:
    """Return the rows of a summary by the names of the recordings; none if there is no summary.

    Raises:
        CardboxError: the file is no summary.
    """
    if not path.exists():
        return {}
    try:
        with path.open(newline="", encoding="utf-8") as file:
            header, *cells = csv.reader(file)
        if tuple(header) != Row._fields:
            raise ValueError("it has other columns")
        rows = [Row(*row) for row in cells]
    except (OSError, ValueError, TypeError) as error:
        raise CardboxError(
            f"{path} is no summary of tracked recordings ({error}); remove it, or give another "
            "--output"
        ) from None
    return {row.recording: row for row in rows}


def write_rows(path: Path, rows: Iterable[Row]) -> None:
    """Write a summary in the order of the names.

    Raises:
        CardboxError: the file cannot be written.
    """
    write_table(path, Row._fields, sorted(rows))


def text_of(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the lines of a table for people."""
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


def text_of_failures(rows: Iterable[Row], paths: Mapping[str, Path]) -> Iterator[str]:
    """Yield a line for each reason of failures, with the recordings that failed for it.

    Args:
        rows: all rows.
        paths: each recording's path by its name. Reasons that differ only in it are one, and the
            line has the first recording's.
    """
    reasons: dict[str, list[Row]] = {}
    for row in sorted(rows):
        if row.status == FAILED:
            common = row.reason.replace(str(paths[row.recording]), "")
            reasons.setdefault(common, []).append(row)
    for failed in reasons.values():
        listed = ", ".join(row.recording for row in failed[:_MOST_NAMES])
        more = f" and {len(failed) - _MOST_NAMES} more" if len(failed) > _MOST_NAMES else ""
        yield f"{listed}{more}: {failed[0].reason}"


def digest_of_inputs(options: argparse.Namespace, formats: Sequence[str], program: str) -> str:
    """Return a digest of all that determines the results of a recording.

    A recording counts by the names, sizes and times of its files, smaller inputs by their content.

    Args:
        options: the options of the recording.
        formats: formats of its results.
        program: see :func:`digest_of_program`.

    Raises:
        CardboxError: a source of silhouettes or points is missing.
    """
    digest = hashlib.sha256(f"{program} {formats}".encode())
    for name, value in sorted(vars(options).items()):
        if name not in _NO_SETTINGS:
            path = Path(value) if isinstance(value, str | Path) else None
            is_file = path is not None and path.is_file()
            digest.update(f"\0{name}={'' if is_file else value!r}\0".encode())
            if path is not None and is_file:
                digest.update(path.read_bytes())
    detector = detector_among(silhouettes_of(options), points_of(options))
    networks = () if detector is None else detector.models
    for path in (*_files_of(options.recording), *networks):
        found = path.stat()
        # Names inside of a recording may be no UTF-8.
        digest.update(b"\0" + os.fsencode(path.name))
        digest.update(f" {found.st_size} {found.st_mtime_ns}".encode())
    return digest.hexdigest()[:32]


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
