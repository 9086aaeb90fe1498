"""The table of ``cardbox track``: a row for each image, as CSV or Parquet (``docs/results.md``)."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from decimal import Decimal
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from cardbox_tracker.common.extensions import optional
from cardbox_tracker.common.files import atomic_path
from cardbox_tracker.person.isb_angles import ANATOMICAL_NAMES, anatomical_angles
from cardbox_tracker.person.legs import LEG_KEYPOINT_NAMES
from cardbox_tracker.person.skeleton import (
    JOINT_NAMES,
    KEYPOINT_NAMES,
    LEG_NAMES,
    NECK_NAMES,
    PLACE_NAMES,
    STATE_NAMES,
    UNITS,
    Group,
    KeypointState,
    names_of,
)
from cardbox_tracker.recordings.outputs import keypoint_states
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.tracking.estimate import Estimate, Hand, Legs

Cell = int | float | str | Decimal | None
"""A value of the table; None is unknown. A Decimal keeps the nine decimals of a stamp."""

DECIMALS = 6
"""Decimals of the numbers in CSV."""
PARQUET = ".parquet"
"""Suffix of the tables that are not CSV."""

PERSON = "person"
"""Column of the number of the person; it follows the others if several people are tracked."""
PERSON_CHANCE = "person_chance"
"""Column of the probability that it is the person who had this number before, behind it."""

SMOOTHED = "smoothed_hz"
"""Column of the frequency of which smoothing over time has left half, in the results of it."""

_CLAVICLES = names_of(Group.CLAVICLE)

POINT_COLUMNS = tuple(f"{name}_{axis}" for name in KEYPOINT_NAMES for axis in "xyz")
"""Columns of the keypoints, m in the optical frame of the first camera."""

_RATES = {"velocity": "s", "acceleration": "s2"}


def _rate_units(names: Iterable[str]) -> dict[str, str]:
    return {
        f"{name}_{rate}{what}_{UNITS.get(name, 'm')}_{per}": f"{UNITS.get(name, 'm')}/{per}"
        for name in names
        for rate, per in _RATES.items()
        for what in ("", "_stddev")
    }


RATE_COLUMNS = tuple(_rate_units((*STATE_NAMES, *POINT_COLUMNS)))
"""Velocity, its deviation, acceleration and its deviation of each joint, then of each coordinate of
the keypoints."""


_SIDES = "left", "right"
PALM_COLUMNS = tuple(f"{side}_palm_{axis}" for side in _SIDES for axis in "xyz")
"""Columns of the normals out of the palms, in the optical frame of the first camera."""
_WRIST = "wrist_flexion", "wrist_deviation", "forearm_rotation"
WRIST_COLUMNS = tuple(f"{side}_{name}" for side in _SIDES for name in _WRIST)
"""Columns of flexion, deviation and rotation of the forearm of both hands, rad."""
_HAND = {"hand_open": "", **dict.fromkeys(("palm_x", "palm_y", "palm_z"), "")} | dict.fromkeys(
    _WRIST, "rad"
)


@cache
def units(
    has_points: bool = False,
    has_people: bool = False,
    has_hands: bool = False,
    is_smoothed: bool = False,
    has_rates: bool = False,
) -> dict[str, str]:
    """Return the unit of each column by its name, in their order; empty for none.

    The first names are fixed, because scripts read them; standard deviations end in their unit.
    Neck and legs are there for recordings with points of the person.
    """
    moved = JOINT_NAMES, PLACE_NAMES, NECK_NAMES * has_points, _CLAVICLES, LEG_NAMES * has_points
    return {
        "stamp": "s",
        "state": "",
        **_units(JOINT_NAMES),
        **dict.fromkeys(POINT_COLUMNS, "m"),
        "cost": "px",
        "iou": "",
        **_units(PLACE_NAMES),
        "stamp_ns": "ns",
        "time_s": "s",
        **_deviation_units((*JOINT_NAMES, *PLACE_NAMES)),
        **{f"{name}_{what}": "" for what in ("state", "chance") for name in KEYPOINT_NAMES},
        **(_units(NECK_NAMES) | _deviation_units(NECK_NAMES) if has_points else {}),
        **_units(_CLAVICLES),
        **_deviation_units(_CLAVICLES),
        "place_state": "",
        "place_chance": "",
        "place_rests_on": "",
        "vertical_state": "",
        "state_reason": "",
        **dict.fromkeys(ANATOMICAL_NAMES, "deg"),
        **(dict.fromkeys((PERSON, PERSON_CHANCE), "") if has_people else {}),
        **(_HAND_UNITS if has_hands else {}),
        **(_leg_units() if has_points else {}),
        **({SMOOTHED: "Hz"} if is_smoothed else {}),
        **(_rate_units((*chain(*moved), *POINT_COLUMNS)) if has_rates else {}),
    }


_HAND_UNITS = {f"{side}_{name}": unit for side in _SIDES for name, unit in _HAND.items()} | {
    f"{side}_{name}_stddev_rad": "rad" for side in _SIDES for name in _WRIST
}


LEG_POINT_COLUMNS = tuple(f"{name}_{axis}" for name in LEG_KEYPOINT_NAMES for axis in "xyz")
"""Columns of the points of the legs, m in the optical frame of the first camera."""


def _leg_units() -> dict[str, str]:
    return {
        **_units(LEG_NAMES),
        **_deviation_units(LEG_NAMES),
        **dict.fromkeys(LEG_POINT_COLUMNS, "m"),
        **{f"{name}_state": "" for name in LEG_KEYPOINT_NAMES},
        **{f"{name}_stddev_m": "m" for name in LEG_KEYPOINT_NAMES},
    }


def _units(joints: Iterable[str]) -> dict[str, str]:
    return {name: UNITS[name] for name in joints}


def _deviation_units(joints: Iterable[str]) -> dict[str, str]:
    return {f"{name}_stddev_{unit}": unit for name, unit in _units(joints).items()}


def deviation_columns(joints: Iterable[str]) -> list[str]:
    """Return the columns of the standard deviations of joints."""
    return list(_deviation_units(joints))


TEXT_COLUMNS = (
    *("state", "place_state", "place_rests_on", "vertical_state", "state_reason"),
    *(f"{name}_state" for name in (*KEYPOINT_NAMES, *LEG_KEYPOINT_NAMES)),
)
"""Columns of texts."""


def row_of(stamp_ns: int, time_s: float, estimate: Estimate, **has: bool) -> list[Cell]:
    """Return the row of one image; its columns, in their order, are those of ``units(**has)``."""
    names = units(**has)
    stamp = Decimal(stamp_ns).scaleb(-9)
    known: dict[str, Cell] = {"stamp": stamp, "state": estimate.state}
    known |= {"stamp_ns": stamp_ns, "time_s": time_s, PERSON: estimate.person}
    known |= {PERSON_CHANCE: estimate.person_chance, SMOOTHED: estimate.smoothed_hz}
    if estimate.posture is None or estimate.keypoints_m is None:
        return [known.get(name) for name in names]
    for columns_of, values in zip((_units, _deviation_units), estimate.joints, strict=True):
        known |= zip(columns_of(STATE_NAMES), map(_known, values), strict=True)
    angles = anatomical_angles(np.asarray(estimate.posture, float)[None])[0].tolist()
    known |= {name: x for name, x in zip(ANATOMICAL_NAMES, angles, strict=True) if x == x}
    if estimate.rates is not None:
        known |= zip(RATE_COLUMNS, map(_known, estimate.rates.T.ravel()), strict=True)
    points_m = np.asarray(estimate.keypoints_m, float).ravel()
    known |= zip(POINT_COLUMNS, points_m.tolist(), strict=True)
    known |= {"cost": estimate.cost_px, "iou": estimate.iou}
    states = keypoint_states(estimate)
    if states is not None:
        for name, state, chance in zip(*states[:3], strict=True):
            known |= {f"{name}_state": str(state), f"{name}_chance": float(chance)}
    if estimate.place is not None:
        place = estimate.place
        known |= {"place_state": str(place.state), "place_chance": place.chance}
        known["place_rests_on"] = place.rests_on
    if estimate.vertical_state is not None:
        known["vertical_state"] = str(estimate.vertical_state)
    known["state_reason"] = estimate.reason or None
    known |= {f"{name}_state": str(KeypointState.HIDDEN) for name in LEG_KEYPOINT_NAMES}
    for side, hand in zip(_SIDES, estimate.hands or (None, None), strict=True):
        if hand is not None:
            known |= _hand_cells(side, hand)
    if estimate.legs is not None:
        known |= _leg_cells(estimate.legs)
    return [known.get(name) for name in names]


def _hand_cells(side: str, hand: Hand) -> dict[str, Cell]:
    values = [hand.open, *hand.palm.tolist(), *map(_known, hand.wrist)]
    cells: dict[str, Cell] = dict(zip((f"{side}_{name}" for name in _HAND), values, strict=True))
    stddevs = zip(_WRIST, map(_known, hand.wrist_stddev), strict=True)
    return cells | {f"{side}_{name}_stddev_rad": stddev for name, stddev in stddevs}


def _leg_cells(legs: Legs) -> dict[str, Cell]:
    cells: dict[str, Cell] = dict(
        zip(LEG_POINT_COLUMNS, legs.points_m.ravel().tolist(), strict=True)
    )
    each = zip(LEG_KEYPOINT_NAMES, legs.states, legs.points_stddev_m.tolist(), strict=True)
    for name, state, stddev_m in each:
        cells |= {f"{name}_state": str(state), f"{name}_stddev_m": stddev_m}
    return cells


def _known(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def check_table(path: Path) -> None:
    """Raise CardboxError if ``path`` ends in .parquet and pyarrow is missing."""
    if path.suffix == PARQUET:
        pyarrow_or_error()


@contextmanager
def result_table(path: Path, **has: bool) -> Iterator[Callable[[RecordedFrame, Estimate], None]]:
    """Context of a function that adds the row of an image to a table, which appears on exit.

    A ``path`` with the suffix .parquet is a Parquet file, else CSV; with ``has_people`` each person
    of an image has a row. The columns are ``units(**has)``. Raises CardboxError if the file cannot
    be written, or pyarrow is missing.
    """
    names = units(**has)
    if path.suffix == PARQUET:
        arrow, parquet = pyarrow_or_error()
        rows: list[list[Cell]] = []
        with atomic_path(path) as temporary:
            yield lambda frame, estimate: rows.append(
                row_of(frame.stamp_ns, frame.time_s, estimate, **has)
            )
            whole = dict.fromkeys(("stamp_ns", PERSON), arrow.int64())
            types = whole | dict.fromkeys(TEXT_COLUMNS, arrow.string())
            schema = arrow.schema(
                arrow.field(name, types.get(name, arrow.float64()), metadata={"unit": unit})
                for name, unit in units(**has).items()
            )
            for row in rows:
                row[0] = float(row[0] or 0)
            found = [dict(zip(names, row, strict=True)) for row in rows]
            parquet.write_table(arrow.Table.from_pylist(found, schema), temporary)
        return
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(names)
        yield lambda frame, estimate: table.writerow(
            map(_text, row_of(frame.stamp_ns, frame.time_s, estimate, **has))
        )


def _text(cell: Cell) -> str:
    match cell:
        case None:
            return ""
        case Decimal():
            return f"{cell:.9f}"
        case float():
            return f"{cell:.{DECIMALS}f}"
    return str(cell)


def pyarrow_or_error() -> tuple[Any, Any]:
    """Return the modules pyarrow and pyarrow.parquet, or raise CardboxError."""
    needs = "a table in Parquet needs the library pyarrow"
    given = needs, "parquet", ", or give a name that ends in .csv"
    return optional("pyarrow", *given), optional("pyarrow.parquet", *given)
