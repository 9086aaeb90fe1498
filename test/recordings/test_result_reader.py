"""Tables and bags of results as a motion, and mistakes in words."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.applications.exporting.motion import Motion
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import BagError, CardboxError
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.skeleton import Group, KeypointState
from cardbox_tracker.recordings import result_reader
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.bag_writer import BagWriter
from cardbox_tracker.recordings.result_bag import result_bag
from cardbox_tracker.recordings.result_reader import read_results
from cardbox_tracker.recordings.result_table import result_table, units
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.tracker import Tracker

BODY = BodyModel.of(hip_height_m=-0.51)
CAMERA = Camera(64, 48, 66.0, 66.0, 31.5, 23.5)
# As of a clock, which is far beyond all other numbers.
START_NS = 1_700_000_000_000_000_007
GREY = np.zeros((48, 64), np.uint8)


def read_motion(path: Path, person: int | None = None) -> tuple[Motion, BodyModel | None]:
    results = read_results(path, person)
    return Motion.of(results), results.body


def estimates() -> list[Estimate]:
    """Results of five images, of which the second and fourth have no posture."""
    postures = np.random.default_rng(2).uniform(-0.2, 0.5, (2, 12))
    points = CAMERA.reference_to_optical(pose(BODY.rigid, postures).keypoints_m)
    seen = Estimate("tracking", postures[0], np.full(12, 0.1), points[0], 10, 0.9)
    moved = replace(
        seen,
        state="uncertain",
        posture=postures[1],
        keypoints_m=points[1],
        offset_m=np.array([0.0, -0.05]),
        offset_stddev_m=np.full(2, 0.1),
        neck=np.array([0.0, 0.2]),
        neck_stddev=np.full(2, 0.3),
        keypoint_states=(KeypointState.TRACKED,) * 5 + (KeypointState.LOST,),
        keypoint_chances=np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.9]),
    )
    return [seen, Estimate("lost"), moved, Estimate("no_person"), seen]


def write_table(path: Path) -> Path:
    with result_table(path, has_points=True) as add:
        for number, estimate in enumerate(estimates()):
            add(RecordedFrame(START_NS + number * 10**8, 2 + number / 10, GREY, GREY), estimate)
    return path


def write_bag(path: Path) -> Path:
    tracker = Tracker(BODY, CAMERA)
    with result_bag(path, "camera") as add:
        for number, estimate in enumerate(estimates()):
            frame = RecordedFrame(START_NS + number * 10**8, number / 10, GREY, GREY)
            add(frame, estimate, tracker)
    return path


def assert_is_what_was_written(motion: Motion) -> None:
    written = estimates()
    assert motion.stamp_ns.tolist() == [START_NS + i * 10**8 for i in range(5)]
    assert motion.state == ("tracking", "lost", "uncertain", "no_person", "tracking")
    assert motion.is_seen.tolist() == [True, False, True, False, True]
    for number in (0, 2, 4):
        one = written[number]
        assert motion.states[number, :12] == pytest.approx(one.posture, abs=1e-6)
        assert motion.keypoints_m[number] == pytest.approx(one.keypoints_m, abs=1e-6)
    assert motion.states[2, 12:] == pytest.approx([0.0, -0.05])
    assert motion.values_of(Group.NECK)[2] == pytest.approx([0.0, 0.2])
    assert np.isnan(motion.values_of(Group.NECK)[[0, 4]]).all()
    assert motion.rate_hz == 10.0


@pytest.mark.parametrize("name", ["a.csv", "a.parquet"])
def test_a_table_is_read_as_it_was_written(name: str, tmp_path: Path) -> None:
    if name.endswith("parquet"):
        pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    motion, body = read_motion(write_table(tmp_path / name))
    assert_is_what_was_written(motion)
    assert motion.time_s == pytest.approx([2.0, 2.1, 2.2, 2.3, 2.4])
    assert body is None


def test_a_table_that_a_spreadsheet_has_saved_with_decimal_commas(tmp_path: Path) -> None:
    plain = write_table(tmp_path / "a.csv")
    names, *rows = csv.reader(plain.read_text().splitlines())
    reason = "hands are near, and 1,5 m away; see there"
    for row in rows:
        row[names.index("state_reason")] = reason
    with (tmp_path / "b.csv").open("w", newline="", encoding="utf-8-sig") as file:
        cells = ([cell.replace(".", ",") for cell in row] for row in (names, *rows))
        csv.writer(file, delimiter=";", lineterminator="\r\n").writerows(cells)
    assert_is_what_was_written(read_motion(tmp_path / "b.csv")[0])
    plain, other = map(read_results, (plain, tmp_path / "b.csv"))
    assert other.texts_of("state_reason")[0] == reason
    for name, values in plain.numbers.items():
        assert values.tolist() == pytest.approx(other.numbers[name].tolist(), nan_ok=True)
    # Of long films, spreadsheets round the stamps.
    text = (tmp_path / "b.csv").read_text("utf-8-sig").replace(f";{START_NS};", ";1,7E+18;")
    (tmp_path / "b.csv").write_text(text)
    with pytest.raises(CardboxError, match=r"line 2: stamp_ns is '1.7E\+18'"):
        read_results(tmp_path / "b.csv")


def test_of_several_people_one_is_read(tmp_path: Path) -> None:
    lines = write_table(tmp_path / "one.csv").read_text().splitlines()
    rows = [f"{row},{person}" for row in lines[1:] for person in (1, 2)]
    rows[-1] = rows[-1].replace(",tracking,", ",lost,").replace(",uncertain,", ",lost,")
    (tmp_path / "two.csv").write_text("\n".join([f"{lines[0]},person", *rows]))
    for person in (None, 1):
        assert_is_what_was_written(read_motion(tmp_path / "two.csv", person)[0])
    assert read_motion(tmp_path / "two.csv", 2)[0].state[-1] == "lost"
    with pytest.raises(CardboxError, match="has no column person: it is of one person"):
        read_motion(tmp_path / "one.csv", 2)


def test_a_bag_is_read_with_its_body(tmp_path: Path) -> None:
    motion, body = read_motion(write_bag(tmp_path / "results"))
    assert_is_what_was_written(motion)
    assert motion.time_s == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    assert body is not None
    assert body.sizes == pytest.approx(BODY.sizes)
    results = read_results(tmp_path / "results")
    assert results.texts_of("right_hand_state") == ("", "", "lost", "", "")
    assert results.numbers["left_hand_chance"][2] == pytest.approx(0.2)


def test_a_bag_of_one_stamp_is_refused(tmp_path: Path) -> None:
    tracker, seen = Tracker(BODY, CAMERA), estimates()[0]
    with result_bag(tmp_path / "bag", "camera") as add:
        for number in range(6):
            add(RecordedFrame(START_NS + number // 3, number / 10, GREY, GREY), seen, tracker)
    with pytest.raises(CardboxError, match="has 6 results with 2 different stamps"):
        read_results(tmp_path / "bag")


def test_a_live_recording_of_people_beside_the_body_that_was_given(tmp_path: Path) -> None:
    with BagReader(write_bag(tmp_path / "one")) as bag, BagWriter(tmp_path / "live") as writer:
        for one in bag.messages(list(bag.topics)):
            message = bag.deserialize(one)
            writer.write(f"/person_2{one.topic}", message, one.time_ns)
            if one.topic == "/body_model":
                writer.write(one.topic, message, one.time_ns)
    assert len(read_results(tmp_path / "live").state) == 5
    assert read_results(tmp_path / "live", 2).state == read_results(tmp_path / "one").state


STAMP_NS = tuple(units()).index("stamp_ns")


def without_column(rows: list[list[str]]) -> None:
    for row in rows:
        del row[11]


def with_text(rows: list[list[str]]) -> None:
    rows[3][5] = "much"


def with_state(rows: list[list[str]]) -> None:
    rows[1][1] = "sleeping"


def with_negative_deviation(rows: list[list[str]]) -> None:
    rows[3][rows[0].index("torso_roll_stddev_rad")] = "-12.0"


def with_large_chance(rows: list[list[str]]) -> None:
    rows[3][rows[0].index("left_hand_chance")] = "7"


def with_state_of_keypoint(rows: list[list[str]]) -> None:
    rows[1][rows[0].index("left_hand_state")] = "sleeping"


def with_empty_cell(rows: list[list[str]]) -> None:
    rows[1][20] = ""


def without_postures(rows: list[list[str]]) -> None:
    for row in rows[1:]:
        row[1] = "lost"


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (without_column, "has no column right_shoulder_flexion; give the table"),
        (with_text, "line 4: torso_yaw is .much.; .*docs/results.md"),
        (with_state, "line 2: the state is .sleeping"),
        (with_empty_cell, "line 2: left_hand_x is "),
        (lambda rows: rows[2].__setitem__(STAMP_NS, str(10**30)), "the stamp is 1000"),
        (lambda rows: rows[2].__setitem__(STAMP_NS, "-1"), "the stamp is -1"),
        (lambda rows: rows.__delitem__(slice(1, None)), "has no image"),
        (lambda rows: rows.append(rows[1]), "line 7: the stamp 17.*007 ns is not after"),
        (lambda rows: rows.append(rows[-1]), "line 7: the stamp .* not in order of time"),
        (lambda rows: [row.append(row[2]) for row in rows], "has several columns torso_y"),
        (lambda rows: rows[3].__setitem__(2, "nan"), "line 4: torso_y is .nan."),
        (lambda rows: rows[3].__setitem__(2, "1e300"), "line 4: torso_y is .1e300."),
        (with_negative_deviation, "line 4: torso_roll_stddev_rad is .-12.0."),
        (with_state_of_keypoint, "line 2: left_hand_state is .sleeping."),
        (with_large_chance, "line 4: left_hand_chance is .7."),
        (lambda rows: rows[1].append("7"), "line 2: it has not as many cells as line 1"),
        (lambda rows: rows[3].pop(), "line 4: it has not as many cells as line 1"),
        (without_postures, "no image with a posture"),
    ],
)
def test_mistakes_in_a_table(
    change: Callable[[list[list[str]]], None], expected: str, tmp_path: Path
) -> None:
    path = write_table(tmp_path / "a.csv")
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    change(rows)
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(rows)
    with pytest.raises(CardboxError, match=expected):
        read_motion(path)


def with_reversed_stamps(messages: list[tuple[str, Any, int]]) -> None:
    joints = [message for topic, message, _ in messages if topic == "/joint_states"]
    joints[0].header.stamp, joints[-1].header.stamp = (
        joints[-1].header.stamp,
        joints[0].header.stamp,
    )


def with_few_positions(messages: list[tuple[str, Any, int]]) -> None:
    (first, *_) = (message for topic, message, _ in messages if topic == "/joint_states")
    first.position = first.position[:5]


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (with_reversed_stamps, r"the stamp \d+ ns is before the one before"),
        (with_few_positions, "26 joints with 5 positions"),
    ],
)
def test_mistakes_in_a_bag(
    change: Callable[[list[tuple[str, Any, int]]], None], expected: str, tmp_path: Path
) -> None:
    with BagReader(write_bag(tmp_path / "good")) as bag, BagWriter(tmp_path / "bad") as writer:
        every = bag.messages(list(bag.topics))
        messages = [(one.topic, bag.deserialize(one), one.time_ns) for one in every]
        change(messages)
        for message in messages:
            writer.write(*message)
    with pytest.raises(BagError, match=f"/joint_states of .*bad has a damaged message: {expected}"):
        read_motion(tmp_path / "bad")


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("missing.csv", None, "there are no results"),
        ("empty.csv", b"", "has no column stamp_ns"),
        ("binary.csv", bytes(range(256)), "expected a table in UTF-8"),
        ("text.parquet", b"no table", "cannot read .*text.parquet"),
        ("zeros.csv", bytes(100), "has no column|expected a table"),
    ],
)
def test_other_files(name: str, content: bytes | None, expected: str, tmp_path: Path) -> None:
    if name.endswith("parquet"):
        pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(CardboxError, match=expected):
        read_motion(tmp_path / name)


def test_a_parquet_table_that_claims_too_many_rows_is_refused_before_they_are_built(
    tmp_path: Path,
) -> None:
    arrow = pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    nothing = arrow.nulls(3_000_001)
    path = tmp_path / "bomb.parquet"
    parquet.write_table(arrow.table({"stamp_ns": nothing}), path)
    assert path.stat().st_size < 100_000
    with pytest.raises(CardboxError, match="3000001 images"):
        read_motion(path)


def test_a_parquet_table_of_several_batches_is_read_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arrow = pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    expected, _ = read_motion(write_table(tmp_path / "a.csv"))
    with (tmp_path / "a.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    parquet.write_table(arrow.Table.from_pylist(rows), tmp_path / "a.parquet")
    monkeypatch.setattr(result_reader, "_BATCH", 2)
    found, _ = read_motion(tmp_path / "a.parquet")
    np.testing.assert_array_equal(found.stamp_ns, expected.stamp_ns)
    np.testing.assert_array_equal(found.states, expected.states)
