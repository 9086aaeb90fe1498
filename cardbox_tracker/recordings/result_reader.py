"""Reads results for all that use them: tables of ``cardbox track``, bags of it or of the nodes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.errors import BagError, CardboxError, quoted, reason_of
from cardbox_tracker.common.files import body_beside, body_of_person, foreign, table_rows
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.model_file import dumps_body_model, load_body_model, loads_body_model
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import (
    HAND_OPEN_NAMES,
    JOINT_NAMES,
    KEYPOINT_NAMES,
    PLACE_NAMES,
    STATE_NAMES,
    KeypointState,
)
from cardbox_tracker.recordings.bag_reader import BagReader, stamp_ns_of
from cardbox_tracker.recordings.open_images import is_bag
from cardbox_tracker.recordings.outputs import chances_of, joints_of, known_deviations, person_space
from cardbox_tracker.recordings.result_table import (
    DECIMALS,
    PARQUET,
    PERSON,
    POINT_COLUMNS,
    TEXT_COLUMNS,
    deviation_columns,
    pyarrow_or_error,
    row_of,
    units,
)
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.tracking.estimate import FILLED, LOST, NO_PERSON, TRACKING, UNCERTAIN, Estimate
from cardbox_tracker.tracking.tracker import Tracker

MODEL = "/body_model"
_STATE, _JOINTS, _STDDEV = "/tracking_state", "/joint_states", "/joint_states_stddev"
_KEYPOINTS, _HANDS, _STATES = "/keypoints", "/hands", ("/keypoint_states", "/place_state")

_SEEN, _GAPS = (TRACKING, UNCERTAIN, FILLED), (LOST, NO_PERSON)
_KEYPOINT_STATES = frozenset(map(str, KeypointState))
_TIMES = ("stamp_ns", "time_s", "state")
_POSTURE = (*JOINT_NAMES, *PLACE_NAMES)
_NEEDED = (*_TIMES, *_POSTURE, *POINT_COLUMNS)
# All lengths, angles and numbers of pixels are far below.
_MOST = 1e6
# A day at 30 Hz has 2.6 million images.
_MOST_ROWS, _MOST_BYTES = 3_000_000, 4 * 1024**3
# Rows that are read at once.
_BATCH = 10_000
_EXPECTED = "a table in UTF-8 or Parquet, or a bag, that 'cardbox track' has written"
_LATEST_NS = np.iinfo(np.int64).max


@dataclass(frozen=True)
class Results:
    """Results of n images in order of time; those of a gap, without a posture, are nan."""

    path: Path  #: table or bag
    stamp_ns: NDArray[np.int64]  #: stamps of the images, (n,), rising
    time_s: FloatArray  #: seconds from the start of the recording, (n,)
    state: tuple[str, ...]  #: tracking state of each image, n texts
    #: values (n,) by the names of the columns of a table (``docs/results.md``), in their units; nan
    #: where they are unknown.
    numbers: Mapping[str, FloatArray]
    #: the same for columns of texts, such as the states of keypoints.
    texts: Mapping[str, tuple[str, ...]]
    bodies: tuple[BodyModel | None, ...]  #: the person as of each image; None where it is not known
    has_others: bool = False  #: whether the file has results of other people, too
    cutoff_hz: float | None = None  #: that of the low-pass that they have passed, if any

    @property
    def body(self) -> BodyModel | None:
        """The person as of most images with a posture, since a tracker may get another; or None."""
        pairs = zip(self.bodies, self.state, strict=True)
        known = {id(body): body for body in self.bodies}
        counts = Counter(id(body) for body, state in pairs if body and state in _SEEN)
        return known[counts.most_common(1)[0][0]] if counts else None

    @property
    def is_seen(self) -> bool:
        """Whether an image has a posture."""
        return not {*_SEEN}.isdisjoint(self.state)

    def check_body(self) -> None:
        """Raise CardboxError unless the person is known."""
        if not any(self.bodies):
            raise CardboxError(
                f"{self.path} has no posture of a known person: keep OUT.body.yaml, which "
                "'cardbox track' writes, beside the table OUT.csv"
            )

    def of(self, names: Sequence[str]) -> FloatArray:
        """Return the values (n, number of names) of columns; nan for those that are missing."""
        nothing = np.full(len(self.state), np.nan)
        columns = [self.numbers.get(name, nothing) for name in names]
        return np.stack(columns, axis=1) if columns else np.zeros((len(self.state), 0))

    def deviations_of(self, joints: Sequence[str]) -> FloatArray:
        """Return the standard deviations (n, number of joints), rad and metres; nan if unknown."""
        return self.of(deviation_columns(joints))

    def texts_of(self, name: str) -> tuple[str, ...]:
        """Return the texts (n) of a column; empty ones if it is missing."""
        return self.texts.get(name, ("",) * len(self.state))

    @property
    def upright_state(self) -> tuple[str, ...]:
        """State of each image, ``uncertain`` where the vertical is: that of leans."""
        pairs = zip(self.state, self.texts_of("vertical_state"), strict=True)
        return tuple(
            UNCERTAIN if (state, vertical) == (TRACKING, KeypointState.UNCERTAIN) else state
            for state, vertical in pairs
        )

    def keypoints(self) -> Iterator[dict[str, tuple[str, float]]]:
        """Yield state and chance to be wrong of each image's keypoints, where they are known."""
        chances = self.of([f"{name}_chance" for name in KEYPOINT_NAMES]).tolist()
        states = zip(*(self.texts_of(f"{name}_state") for name in KEYPOINT_NAMES), strict=True)
        for texts, values in zip(states, chances, strict=True):
            pairs = zip(KEYPOINT_NAMES, texts, values, strict=True)
            yield {name: (text, chance) for name, text, chance in pairs if text}


class _Rows:
    """Checks the values of image after image, and collects them."""

    def __init__(self, path: Path, names: Iterable[str], needed: Sequence[str]) -> None:
        found = set(names)
        self._path = path
        known = [name for name in units(*[True] * 5) if name in found and name not in _TIMES]
        self.names = [name for name in known if name not in (*TEXT_COLUMNS, PERSON, "stamp")]
        self._texts = [name for name in known if name in TEXT_COLUMNS]
        self._are_chances = np.array([name.endswith("_chance") for name in self.names], bool)
        are_deviations = np.array(["_stddev_" in name for name in self.names], bool)
        self._are_positive = self._are_chances | are_deviations
        self._is_needed = np.array([name in needed for name in self.names])
        self._times: list[tuple[int, float, str]] = []
        self._blocks: list[FloatArray] = []
        self._rows: list[FloatArray] = []
        self._found_texts: dict[str, list[str]] = {name: [] for name in self._texts}

    def add(self, row: Mapping[str, Any]) -> None:
        """Take an image's values, None or "" if unknown; ValueError names one of no result."""
        stamp_ns = _number(row, "stamp_ns", int)
        time_s, state = _number(row, "time_s"), str(row["state"])
        if state not in (*_SEEN, *_GAPS):
            raise ValueError(f"the state is {quoted(state)}")
        if not 0 <= stamp_ns <= _LATEST_NS:
            raise ValueError(f"the stamp is {quoted(stamp_ns)} ns")
        if not abs(time_s) < _MOST**2:
            raise ValueError(f"the time is {time_s} s")
        if self._times and not (stamp_ns > self._times[-1][0] and time_s >= self._times[-1][1]):
            raise ValueError(
                f"the stamp {stamp_ns} ns is not after that of the image before, "
                f"{self._times[-1][0]} ns, so the images are not in order of time"
            )
        is_seen = state in _SEEN
        self._rows.append(self._numbers(row) if is_seen else np.full(len(self.names), np.nan))
        for name in self._texts:
            text = str(row.get(name) or "") if is_seen else ""
            if text and name.endswith("_state") and text not in _KEYPOINT_STATES:
                raise ValueError(f"{name} is {quoted(text)}")
            self._found_texts[name].append(text)
        self._times.append((stamp_ns, time_s, state))
        if len(self._rows) == _BATCH:
            self._pack()

    def _numbers(self, row: Mapping[str, Any]) -> FloatArray:
        cells = [row[name] for name in self.names]
        is_empty = np.array([cell is None or cell == "" for cell in cells], bool)
        try:
            values = np.array([float(cell or 0) for cell in cells])
        except (TypeError, ValueError):
            cells = ["0" if empty else cell for empty, cell in zip(is_empty, cells, strict=True)]
            known = dict(zip(self.names, cells, strict=True))
            values = np.array([_number(known, name) for name in self.names])
        # A comparison with nan is false.
        is_wrong = ~(np.abs(values) < _MOST) | (self._are_positive & (values < 0.0))
        is_wrong |= self._are_chances & (values > 1.0)
        is_wrong |= is_empty & self._is_needed
        if is_wrong.any():
            wrong = int(np.argmax(is_wrong))
            raise ValueError(f"{self.names[wrong]} is {quoted(str(row[self.names[wrong]]))}")
        values[is_empty] = np.nan
        return values

    def _pack(self) -> None:
        if self._rows:
            self._blocks.append(np.array(self._rows, float))
        self._rows = []

    def results(self, bodies: Sequence[BodyModel | None]) -> Results:
        self._pack()
        nothing = np.zeros((0, len(self.names)))
        values = np.concatenate([nothing, *self._blocks])
        stamps, times, states = zip(*self._times, strict=True) if self._times else ((), (), ())
        return Results(
            self._path,
            np.array(stamps, np.int64),
            np.array(times, float),
            states,
            dict(zip(self.names, values.T, strict=True)),
            {name: tuple(texts) for name, texts in self._found_texts.items()},
            tuple(bodies),
        )


def _number(row: Mapping[str, Any], name: str, kind: Callable[[Any], Any] = float) -> Any:
    try:
        return kind(row[name])
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name} is {quoted(str(row[name]))}") from None


class KeptResults:
    """Observer that keeps the results of each person as a table of CSV has them, in memory."""

    def __init__(self, path: Path, **has: bool) -> None:
        """Take the recording, and what :func:`~.result_table.result_table` takes."""
        self._path, self._has = path, has
        self._rows: dict[int, _Rows] = {}
        self._bodies: dict[int, BodyModel] = {}

    def __call__(self, frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        """Keep the row of an image; CardboxError if it is not after the one before."""
        names, number = units(**self._has), estimate.person or 1
        self._bodies[number] = tracker.body
        if number not in self._rows:
            self._rows[number] = _Rows(self._path, names, _NEEDED)
        estimate = estimate.as_camera_stands(tracker.body.camera_pose.roll_rad)
        row = row_of(frame.stamp_ns, frame.time_s, estimate, **self._has)
        cells = (round(float(cell), DECIMALS) if isinstance(cell, float) else cell for cell in row)
        try:
            self._rows[number].add(dict(zip(names, cells, strict=True)))
        except ValueError as error:
            raise CardboxError(f"{self._path}: {error}; record it again") from None

    def results(self) -> dict[int, Results]:
        """Return the results by the numbers of the people, with the body at the end."""
        found = {}
        for number, rows in self._rows.items():
            # What a file does not keep is unknown here, too.
            body = loads_body_model(dumps_body_model(self._bodies[number]))
            results = rows.results(())
            bodies = (body,) * len(results.state)
            found[number] = replace(results, bodies=bodies, has_others=len(self._rows) > 1)
        return found


def read_results(path: Path, person: int | None = None) -> Results:
    """Return the results in a table or a bag, and the body with which they were tracked.

    The body of a table is in the file OUT.body.yaml beside it. Of several people, ``person`` is the
    number of one, or the first one. Raises CardboxError, with the line, if the file cannot be read
    or has what no result is.
    """
    return read_people(path, person, person or 1)[person or 1]


def read_people(
    path: Path, person: int | None = None, only: int | None = None
) -> dict[int, Results]:
    """Return what :func:`read_results` does, of all people, or ``only`` one, by their numbers.

    Without several people in the file, that is number 1.
    """
    only = person or only
    if not path.exists():
        raise CardboxError(
            f"there are no results {path}; give a table or a bag that 'cardbox track' has written"
        )
    if is_bag(path):
        with BagReader(path) as bag:
            spaces = {k: person_space(k) + MODEL for k in range(1, len(bag.topics))}
            known = [k for k, end in spaces.items() if any(t.endswith(end) for t in bag.topics)]
            numbers: list[int | None] = [person] if only or len(known) < 2 else [*known]
            found = {number or 1: results_in(bag, number) for number in numbers}
        return {k: replace(one, has_others=len(known) > 1) for k, one in found.items()}
    if not path.is_file():
        raise CardboxError(f"{path} is no table and no bag; give the results of 'cardbox track'")
    rows, has_others = dict[int, _Rows](), False
    cells = _parquet_cells(path) if path.suffix == PARQUET else _csv_cells(path)
    for line, row in cells:
        if person is not None and PERSON not in row:
            raise CardboxError(f"{path} has no column {PERSON}: it is of one person")
        try:
            # A line of CSV has None for cells that are missing, and as the name of those beyond.
            if path.suffix != PARQUET and (None in row or None in row.values()):
                raise ValueError("it has not as many cells as line 1")
            number = _number(row, PERSON, int) if PERSON in row else 1
            if number != (only or number):
                has_others = True
                continue
            if number not in rows:
                rows[number] = _Rows(path, row, _NEEDED)
            rows[number].add(row)
        except ValueError as error:
            raise CardboxError(
                f"{path}, {line}: {error}; give the table as 'cardbox track' wrote it "
                "(docs/results.md)"
            ) from None
    if not rows:
        text = "image" if person is None else f"person {person}"
        raise CardboxError(f"{path} has no {text}; give the table of a recording with one")
    found = {}
    for number, each in sorted(rows.items()):
        beside = body_of_person(body_beside(path), number)
        body = load_body_model(beside) if beside.is_file() else None
        results = each.results(())
        bodies, has_others = (body,) * len(results.state), has_others or len(rows) > 1
        found[number] = replace(results, bodies=bodies, has_others=has_others)
    return found


def _csv_cells(path: Path) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield each row of a CSV table, and where it is."""
    with (
        foreign(path, CardboxError, _EXPECTED),
        table_rows(path, _MOST_BYTES) as rows,
    ):
        _check(path, rows.fieldnames or ())
        for row in rows:
            yield f"line {rows.line_num}", row


def _parquet_cells(path: Path) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield each row of a Parquet table, and where it is."""
    _, parquet = pyarrow_or_error()
    with foreign(path, CardboxError, _EXPECTED), parquet.ParquetFile(path) as file:
        rows, names = file.metadata.num_rows, file.schema_arrow.names
        # A small file can claim any number of equal rows.
        if rows > _MOST_ROWS:
            raise CardboxError(f"it has {rows} images, expected at most {_MOST_ROWS}")
        _check(path, names)
        number = 0
        for batch in file.iter_batches(_BATCH, columns=list(names)):
            for row in batch.to_pylist():
                number += 1
                yield f"row {number}", row


def _check(path: Path, names: Sequence[str]) -> None:
    for name in _NEEDED:
        if names.count(name) != 1:
            problem = "several columns" if name in names else "no column"
            raise CardboxError(
                f"{path} has {problem} {name}; give the table as 'cardbox track' wrote it "
                "(docs/results.md)"
            )


def namespace_of(bag: BagReader, person: int | None = None) -> str:
    """Return the first namespace with topics of the tracker, or of ``person``; else BagError."""
    models = sorted(topic for topic in bag.topics if topic.endswith(MODEL))
    if not models:
        raise BagError(
            f"{bag.path} has no results of the tracker (no topic body_model); make them with "
            "'cardbox track BAG ... --bag RESULTS'"
        )
    spaces = [topic.removesuffix(MODEL) for topic in models]
    if person is None:
        # Beside several people, there may be the body that was given for all.
        return next((space for space in spaces if space + _JOINTS in bag.topics), spaces[0])
    chosen = [space for space in spaces if space.endswith(person_space(person))]
    if not chosen:
        raise BagError(
            f"{bag.path} has no results of person {person}, only those on {', '.join(models)}"
        )
    return chosen[0]


def points_of(message: Any) -> FloatArray:
    """Return the positions (n, 3), metres, of a PoseArray."""
    points = [(p.position.x, p.position.y, p.position.z) for p in message.poses]
    return np.array(points, np.float64).reshape(-1, 3)


def results_in(bag: BagReader, person: int | None = None) -> Results:
    """Return the results in an open bag, the last one of each stamp; see :func:`read_results`."""
    space = namespace_of(bag, person)
    of_images = _STATE, _JOINTS, _STDDEV, _KEYPOINTS, _HANDS, *_STATES
    topics = [space + name for name in (MODEL, *of_images)]
    found = _Messages()
    for message in bag.messages([topic for topic in topics if topic in bag.topics]):
        content = bag.deserialize(message)
        try:
            found.take(message.topic.removeprefix(space), message.time_ns, content)
        except (AttributeError, TypeError, ValueError) as error:
            # The message type is defined by the recording and may lack fields.
            raise _damaged(f"{message.topic} of {bag.path}", error) from None
    if found.repeated > len(found.by_stamp):
        raise BagError(
            f"{bag.path} has {len(found.by_stamp) + found.repeated} results with "
            f"{len(found.by_stamp)} different stamps: the camera's clock stood still; track the "
            "recording itself, whose times are then those of the recorder"
        )
    rows = _Rows(bag.path, {name for row in found.by_stamp.values() for name in row}, JOINT_NAMES)
    every = dict.fromkeys(rows.names)
    bodies = []
    for number, (stamp_ns, row) in enumerate(sorted(found.by_stamp.items()), 1):
        time_s = (stamp_ns - min(found.by_stamp)) / 1e9
        bodies.append(row.pop("body"))
        try:
            rows.add({**every, **row, "stamp_ns": stamp_ns, "time_s": time_s})
        except ValueError as error:
            raise _damaged(f"image {number} of {bag.path}", error) from None
    return rows.results(bodies)


def _damaged(where: str, error: Exception) -> BagError:
    return BagError(f"{where} has a damaged message: {reason_of(error)}; record it again")


class _Messages:
    """Joins the messages of each image, of which joints, deviations and points have its stamp."""

    def __init__(self) -> None:
        self._state, self._last_ns, self.repeated = NO_PERSON, 0, 0
        self._body: BodyModel | None = None
        self._keypoints: dict[int, dict[str, Any]] = {}
        self.by_stamp: dict[int, dict[str, Any]] = {}

    def take(self, name: str, time_ns: int, message: Any) -> None:
        if name == MODEL:
            self._body = loads_body_model(str(message.data), source=name)
        elif name == _STATE:
            self._state = str(message.data)
            if self._state not in _SEEN:
                self.by_stamp[time_ns] = {"state": self._state, "body": self._body}
        elif name == _JOINTS:
            stamp_ns = stamp_ns_of(message)
            if self._last_ns > stamp_ns:
                raise ValueError(f"the stamp {stamp_ns} ns is before the one before")
            self._last_ns = stamp_ns
            joints = joints_of(message)
            row: dict[str, Any] = {"state": self._state, "body": self._body}
            row |= zip(JOINT_NAMES, joints.posture.tolist(), strict=True)
            # A node without the place of the torso keeps it constant.
            row |= dict.fromkeys(PLACE_NAMES, 0.0) | joints.by_name
            self.repeated += stamp_ns in self.by_stamp
            row |= self._keypoints.get(stamp_ns, {})
            self.by_stamp[stamp_ns] = row
        elif name in _STATES:
            # They come before the joints of their image.
            stamp_ns = stamp_ns_of(message)
            states = self._keypoints.get(stamp_ns, {})
            for keypoint, (state, chance) in chances_of(message).items():
                states |= {f"{keypoint}_state": state, f"{keypoint}_chance": chance}
            self._keypoints = {stamp_ns: states}
        elif (found := self.by_stamp.get(stamp_ns_of(message))) is not None:
            if name == _KEYPOINTS:
                points_m = points_of(message).ravel().tolist()
                if len(points_m) != len(POINT_COLUMNS):
                    raise ValueError(f"{len(points_m) // 3} keypoints")
                found |= zip(POINT_COLUMNS, points_m, strict=True)
            elif name == _HANDS:
                values = joints_of(message).by_name
                found |= {name: values[name] for name in HAND_OPEN_NAMES if name in values}
            else:
                stddev = known_deviations(joints_of(message))
                found |= zip(deviation_columns(stddev), stddev.values(), strict=True)
                # Joints that are not known have a position, but no deviation.
                for joint in set(STATE_NAMES) - {*_POSTURE, *stddev}:
                    found.pop(joint, None)
