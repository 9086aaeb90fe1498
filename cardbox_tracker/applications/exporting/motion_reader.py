"""Reads results as a motion: the table of ``cardbox track``, or a bag of results."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cardbox_tracker.applications.exporting.motion import Motion
from cardbox_tracker.common.errors import BagError, CardboxError, quoted
from cardbox_tracker.common.files import UnreadableFileError, regular_file
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_JOINTS, N_STATE
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import JOINT_NAMES, KEYPOINT_NAMES, NECK_NAMES, PLACE_NAMES
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.open_images import is_bag
from cardbox_tracker.recordings.result_reader import Result, read_results
from cardbox_tracker.recordings.result_table import PARQUET, PERSON, POINT_COLUMNS, pyarrow_or_error
from cardbox_tracker.tracking.estimate import LOST, NO_PERSON, TRACKING, UNCERTAIN

_STATES = (*JOINT_NAMES, *PLACE_NAMES)
_NEEDED = ("stamp_ns", "time_s", "state", *_STATES, *POINT_COLUMNS)
_VALUES = N_STATE + len(NECK_NAMES) + len(POINT_COLUMNS)
# A day at 30 Hz has 2.6 million images.
_MOST_ROWS, _MOST_BYTES = 3_000_000, 4 * 1024**3
# Rows that are read at once.
_BATCH = 10_000
_LATEST_NS = np.iinfo(np.int64).max
_GAP: FloatArray = np.full(_VALUES, np.nan)


class _Row(NamedTuple):
    """State, neck and keypoints of an image in one array (34,); nan where they are unknown."""

    stamp_ns: int
    time_s: float
    state: str
    values: FloatArray


def read_motion(path: Path, person: int | None = None) -> tuple[Motion, BodyModel | None]:
    """Return the results of a recording, and the body that a bag contains.

    Images with the states ``tracking`` and ``uncertain`` have a posture, all others are gaps.

    Args:
        path: table of ``cardbox track``, or bag of ``cardbox track --bag`` or of nodes.
        person: number of one of several people; without it, the first one counts.

    Raises:
        CardboxError: the file cannot be read, or contains no results or no posture.
    """
    body = None
    if not path.exists():
        raise CardboxError(
            f"there are no results {path}; give a table or a bag that 'cardbox track' has written"
        )
    if is_bag(path):
        with BagReader(path) as bag:
            results = read_results(bag, person)
        body = next((one.body for one in reversed(results) if one.body is not None), None)
        rows = [_row_of_result(one, results[0].stamp_ns, path) for one in results]
    elif path.is_file():
        rows = sorted(_table_rows(path, person), key=lambda row: row.stamp_ns)
    else:
        raise CardboxError(f"{path} is no table and no bag; give the results of 'cardbox track'")
    # Two results with one stamp occur in tables of several runs; the last one counts.
    rows = list({row.stamp_ns: row for row in rows}.values())
    values = np.array([row.values for row in rows]).reshape(-1, _VALUES)
    states, neck, points = np.split(values, (N_STATE, N_STATE + len(NECK_NAMES)), axis=1)
    motion = Motion(
        np.array([row.stamp_ns for row in rows], np.int64),
        np.array([row.time_s for row in rows]),
        tuple(row.state for row in rows),
        states,
        neck,
        points.reshape(-1, len(KEYPOINT_NAMES), 3),
    )
    if not motion.is_seen.any():
        raise CardboxError(f"{path} has no image with a posture; track a recording of a person")
    return motion, body


def _row_of_result(result: Result, first_ns: int, path: Path) -> _Row:
    values = _GAP.copy()
    posture, stddev, points_m = result.posture, result.stddev, result.keypoints_m
    if posture is not None:
        place_m = np.zeros(len(PLACE_NAMES)) if result.place_m is None else result.place_m
        values[:N_STATE] = [*posture[:N_JOINTS], *place_m]
        # The joint states have a straight neck where the face is not seen.
        if stddev is None or len(stddev) == len(posture):
            values[N_STATE : N_STATE + len(posture) - N_JOINTS] = posture[N_JOINTS:]
    if points_m is not None:
        if points_m.shape != (len(KEYPOINT_NAMES), 3):
            raise BagError(
                f"{path} has a damaged message: {len(points_m)} keypoints; record it again"
            )
        values[-len(POINT_COLUMNS) :] = points_m.ravel()
    return _Row(result.stamp_ns, (result.stamp_ns - first_ns) / 1e9, result.state, values)


def _table_rows(path: Path, person: int | None) -> Iterator[_Row]:
    cells = _parquet_cells(path) if path.suffix == PARQUET else _csv_cells(path)
    for number, row in enumerate(cells, 1):
        if person is not None and PERSON not in row:
            raise CardboxError(f"{path} has no column {PERSON}: it is of one person")
        try:
            if int(row.get(PERSON) or 1) != (person or 1):
                continue
            yield _row_of_cells(row)
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise CardboxError(
                f"{path}, image {number}: {quoted(str(error))}; expected the columns of "
                "docs/results.md with numbers: export the table as 'cardbox track' wrote it"
            ) from None


def _row_of_cells(row: Mapping[str, Any]) -> _Row:
    state = str(row["state"])
    values = _GAP
    if state in (TRACKING, UNCERTAIN):
        # The face is not seen in every image, and not sought without a detector.
        neck = ["nan" if row.get(name) in (None, "") else row[name] for name in NECK_NAMES]
        known = [float(row[name]) for name in (*_STATES, *POINT_COLUMNS)]
        if not np.isfinite(known).all():
            raise ValueError("a value is not finite")
        values = np.array([*known[:N_STATE], *map(float, neck), *known[N_STATE:]])
    elif state not in (LOST, NO_PERSON):
        raise ValueError(f"the state is {quoted(state)}")
    stamp_ns = int(row["stamp_ns"])
    if not 0 <= stamp_ns <= _LATEST_NS:
        raise ValueError(f"the stamp is {quoted(stamp_ns)} ns")
    time_s = float(row["time_s"])
    if not np.isfinite(time_s):
        raise ValueError(f"the time is {time_s} s")
    return _Row(stamp_ns, time_s, state, values)


def _csv_cells(path: Path) -> Iterator[Mapping[str, Any]]:
    try:
        # Spreadsheets begin a file with a byte order mark.
        with (
            regular_file(path, _MOST_BYTES) as data,
            io.TextIOWrapper(data, newline="", encoding="utf-8-sig") as file,
        ):
            rows = csv.DictReader(file)
            _check(path, rows.fieldnames or ())
            yield from rows
    except UnreadableFileError as error:
        raise CardboxError(f"cannot read {path}: {error}; give a table or a bag") from None
    except OSError as error:
        raise CardboxError(f"cannot read {path}: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise CardboxError(
            f"{path} is not a table in UTF-8 ({quoted(str(error))}); give a table or a bag that "
            "'cardbox track' has written"
        ) from None


def _parquet_cells(path: Path) -> Iterator[Mapping[str, Any]]:
    arrow, parquet = pyarrow_or_error()
    try:
        with parquet.ParquetFile(path) as file:
            rows, names = file.metadata.num_rows, file.schema_arrow.names
            # A small file can claim any number of equal rows.
            if rows > _MOST_ROWS:
                raise CardboxError(
                    f"{path} has {rows} images, expected at most {_MOST_ROWS}; give a table that "
                    "'cardbox track' wrote"
                )
            _check(path, names)
            read = [name for name in (*_NEEDED, *NECK_NAMES, PERSON) if name in names]
            for batch in file.iter_batches(_BATCH, columns=read):
                yield from batch.to_pylist()
    except (OSError, arrow.ArrowException) as error:
        raise CardboxError(
            f"cannot read {path}: {quoted(str(error))}; give a table that 'cardbox track' wrote"
        ) from None


def _check(path: Path, names: Sequence[str]) -> None:
    missing = [name for name in _NEEDED if name not in names]
    if missing:
        raise CardboxError(
            f"{path} has no column {missing[0]}; give a table that 'cardbox track' has written "
            "(docs/results.md)"
        )
