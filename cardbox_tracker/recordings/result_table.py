"""The table of ``cardbox track``: a row for each image, as CSV or Parquet (``docs/results.md``)."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from cardbox_tracker.body.kinematics import KEYPOINT_NAMES
from cardbox_tracker.body.neck import NECK_NAMES
from cardbox_tracker.body.posture import JOINT_NAMES, PLACE_NAMES
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.files import atomic_path
from cardbox_tracker.keypoint_status import keypoint_states
from cardbox_tracker.outputs import METRICS, joint_deviations, joint_values, positions_of, unit_of
from cardbox_tracker.recordings.silhouettes import RecordedFrame

Cell = int | float | str | None
"""A value of the table; None is unknown."""

PARQUET = ".parquet"
"""Suffix of the tables that are not CSV."""

_BODY_NAMES = (*JOINT_NAMES, *PLACE_NAMES)


def columns(has_points: bool = False) -> tuple[str, ...]:
    """Return the names of the columns, which end in their unit.

    With ``has_points``, for recordings with points of the person, the neck is among them.
    """
    # New columns are appended, because scripts read these by their position.
    return (
        *("stamp_ns", "time_s", "state"),
        *_joints(JOINT_NAMES),
        *(f"{name}_{axis}_m" for name in KEYPOINT_NAMES for axis in "xyz"),
        *(f"{metric.name}_{metric.unit}".rstrip("_") for metric in METRICS),
        *_joints(PLACE_NAMES),
        *_joints(_BODY_NAMES, "_stddev"),
        *(f"{name}_{what}" for what in ("state", "chance") for name in KEYPOINT_NAMES),
        *(_joints(NECK_NAMES) + _joints(NECK_NAMES, "_stddev") if has_points else ()),
    )


def _joints(names: tuple[str, ...], what: str = "") -> tuple[str, ...]:
    return tuple(f"{name}{what}_{unit_of(name)}" for name in names)


def row_of(
    stamp_ns: int, time_s: float, estimate: Estimate, has_points: bool = False
) -> list[Cell]:
    """Return the row of one image, in the order of :func:`columns`."""
    known: list[Cell] = [stamp_ns, time_s, estimate.state]
    joints, deviations = joint_values(estimate), joint_deviations(estimate)
    if joints is None or estimate.keypoints_m is None:
        return known + [None] * (len(columns(has_points)) - len(known))
    values = positions_of(joints)
    stddevs = {} if deviations is None else positions_of(deviations)
    known += [values[name] for name in JOINT_NAMES]
    known += np.asarray(estimate.keypoints_m, float).ravel().tolist()
    known += [metric.of(estimate) for metric in METRICS]
    known += [values[name] for name in PLACE_NAMES]
    known += [stddevs.get(name) for name in _BODY_NAMES]
    known += _states_of(estimate)
    if has_points:
        is_seen = estimate.neck is not None
        known += [values[name] if is_seen else None for name in NECK_NAMES]
        known += [stddevs.get(name) for name in NECK_NAMES]
    return known


def _states_of(estimate: Estimate) -> list[Cell]:
    """Return states and probabilities of the keypoints; unknown ones without such states."""
    found = keypoint_states(estimate)
    if found is None:
        return [None] * (2 * len(KEYPOINT_NAMES))
    return [*map(str, found.states), *found.chances.tolist()]


def check_table(path: Path) -> None:
    """Check that the libraries for the format of a table are installed.

    Raises:
        CardboxError: ``path`` ends in .parquet, and pyarrow is missing.
    """
    if path.suffix == PARQUET:
        pyarrow_or_error()


@contextmanager
def result_table(
    path: Path, has_points: bool
) -> Iterator[Callable[[RecordedFrame, Estimate], None]]:
    """Context of a function that adds the row of an image to a table, which appears on exit.

    Args:
        path: file to write; with the suffix .parquet it is a Parquet file, else CSV.
        has_points: see :func:`columns`.

    Raises:
        CardboxError: the file cannot be written, or pyarrow is missing.
    """
    names = columns(has_points)
    if path.suffix == PARQUET:
        arrow, parquet = pyarrow_or_error()
        rows: list[list[Cell]] = []
        with atomic_path(path) as temporary:
            yield lambda frame, estimate: rows.append(
                row_of(frame.stamp_ns, frame.time_s, estimate, has_points)
            )
            texts = ("state", *(f"{name}_state" for name in KEYPOINT_NAMES))
            types = {"stamp_ns": arrow.int64()} | dict.fromkeys(texts, arrow.string())
            schema = arrow.schema([(name, types.get(name, arrow.float64())) for name in names])
            found = [dict(zip(names, row, strict=True)) for row in rows]
            parquet.write_table(arrow.Table.from_pylist(found, schema), temporary)
        return
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(names)
        yield lambda frame, estimate: table.writerow(
            map(_text, row_of(frame.stamp_ns, frame.time_s, estimate, has_points))
        )


def _text(cell: Cell) -> str:
    if cell is None:
        return ""
    return f"{cell:.6f}" if isinstance(cell, float) else str(cell)


def pyarrow_or_error() -> tuple[Any, Any]:
    """Return the modules pyarrow and pyarrow.parquet.

    Raises:
        CardboxError: they are not installed.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise CardboxError(
            f"a table in Parquet needs the library pyarrow ({error}); install it with "
            "'pip install cardbox_tracker[parquet]', or give a name that ends in .csv"
        ) from None
    return pyarrow, pyarrow.parquet
