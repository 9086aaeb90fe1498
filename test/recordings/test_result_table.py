"""The table of results: its columns, its rows by hand, and its two formats."""

from __future__ import annotations

import csv
import re
import sys
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.skeleton import STATE_NAMES, KeypointState
from cardbox_tracker.recordings.result_table import (
    RATE_COLUMNS,
    check_table,
    result_table,
    row_of,
    units,
)
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.tracking.estimate import Estimate, Hand, Legs, Place

ROOT = Path(__file__).parents[2]
ANGLES = (
    *("torso_roll", "torso_pitch", "torso_yaw"),
    *("left_shoulder_abduction", "left_shoulder_flexion"),
    *("left_elbow_abduction", "left_elbow_flexion"),
    *("right_shoulder_abduction", "right_shoulder_flexion"),
    *("right_elbow_abduction", "right_elbow_flexion"),
)
FIXED = (
    *("stamp", "state", "torso_y", *ANGLES),
    *("left_shoulder_x", "left_shoulder_y", "left_shoulder_z"),
    *("left_elbow_x", "left_elbow_y", "left_elbow_z"),
    *("left_hand_x", "left_hand_y", "left_hand_z"),
    *("right_shoulder_x", "right_shoulder_y", "right_shoulder_z"),
    *("right_elbow_x", "right_elbow_y", "right_elbow_z"),
    *("right_hand_x", "right_hand_y", "right_hand_z"),
    *("cost", "iou", "torso_x", "torso_z"),
)
HEADER = (
    *FIXED,
    *("stamp_ns", "time_s", "torso_y_stddev_m"),
    *(f"{name}_stddev_rad" for name in ANGLES),
    *("torso_x_stddev_m", "torso_z_stddev_m"),
    *("left_shoulder_state", "left_elbow_state", "left_hand_state"),
    *("right_shoulder_state", "right_elbow_state", "right_hand_state"),
    *("left_shoulder_chance", "left_elbow_chance", "left_hand_chance"),
    *("right_shoulder_chance", "right_elbow_chance", "right_hand_chance"),
)
NECK = ("neck_yaw", "neck_pitch", "neck_yaw_stddev_rad", "neck_pitch_stddev_rad")
CLAVICLES = (
    *("left_clavicle_elevation", "right_clavicle_elevation"),
    *("left_clavicle_elevation_stddev_m", "right_clavicle_elevation_stddev_m"),
)
PLACE = (
    *("place_state", "place_chance", "place_rests_on"),
    *("vertical_state", "state_reason"),
)
ANATOMICAL = (
    *("left_elbow_bend_deg", "left_arm_elevation_deg", "left_arm_plane_deg"),
    *("right_elbow_bend_deg", "right_arm_elevation_deg", "right_arm_plane_deg"),
    *("trunk_lean_deg", "trunk_side_lean_deg"),
)
_SIDES, _LEG_POINTS = ("left", "right"), ("hip", "knee", "ankle")
_LEG_ANGLES = ("hip_flexion", "hip_abduction", "hip_rotation", "knee_flexion")
LEGS = (
    *(f"{side}_{name}" for side in _SIDES for name in _LEG_ANGLES),
    *(f"{side}_{name}_stddev_rad" for side in _SIDES for name in _LEG_ANGLES),
    *(f"{side}_{name}_{axis}" for side in _SIDES for name in _LEG_POINTS for axis in "xyz"),
    *(f"{side}_{name}_state" for side in _SIDES for name in _LEG_POINTS),
    *(f"{side}_{name}_stddev_m" for side in _SIDES for name in _LEG_POINTS),
)
UPPER = HEADER + NECK + CLAVICLES + PLACE + ANATOMICAL
WHOLE = UPPER + LEGS
HANDS = (
    *("left_hand_open", "left_palm_x", "left_palm_y", "left_palm_z"),
    *("left_wrist_flexion", "left_wrist_deviation", "left_forearm_rotation"),
    *("right_hand_open", "right_palm_x", "right_palm_y", "right_palm_z"),
    *("right_wrist_flexion", "right_wrist_deviation", "right_forearm_rotation"),
    *("left_wrist_flexion_stddev_rad", "left_wrist_deviation_stddev_rad"),
    *("left_forearm_rotation_stddev_rad", "right_wrist_flexion_stddev_rad"),
    *("right_wrist_deviation_stddev_rad", "right_forearm_rotation_stddev_rad"),
)
POINTS_M = np.arange(18).reshape(6, 3) / 4
FOUND = Estimate("tracking", np.arange(12) / 10, np.arange(12) / 100, POINTS_M, 812, 0.87654)
PLACED = replace(FOUND, offset_m=np.array([0.25, -0.05]), offset_stddev_m=np.array([0.03, 0.01]))
SEEN = replace(PLACED, neck=np.array([0.4, -0.1]), neck_stddev=np.array([0.2, 0.3]))
STAMP_NS, STAMP = 1_700_000_000_000_000_005, Decimal("1700000000.000000005")


def test_scripts_find_the_columns_that_they_know() -> None:
    assert tuple(units()) == HEADER + CLAVICLES + PLACE + ANATOMICAL
    assert tuple(units(has_points=True)) == WHOLE


def test_legs_follow_all_others() -> None:
    states = (KeypointState.TRACKED,) * 5 + (KeypointState.HIDDEN,)
    values = np.arange(8) / 10, np.arange(8) / 100, np.arange(18).reshape(6, 3) / 10
    found = replace(FOUND, legs=Legs(*values, np.arange(6) / 10, states))
    row = row_of(STAMP_NS, 1.0, found, has_points=True)
    named = dict(zip(units(has_points=True), row, strict=True))
    assert named["right_knee_flexion"] == 0.7
    assert named["right_knee_flexion_stddev_rad"] == 0.07
    assert (named["left_knee_x"], named["right_ankle_z"]) == pytest.approx((0.3, 1.7))
    assert (named["left_hip_state"], named["right_ankle_state"]) == ("tracked", "hidden")
    assert named["right_ankle_stddev_m"] == 0.5
    assert row_of(STAMP_NS, 1.0, found) == row_of(STAMP_NS, 1.0, FOUND)


def test_each_column_has_its_unit() -> None:
    found = units(has_points=True)
    expected = {"stamp": "s", "torso_y": "m", "torso_yaw": "rad", "left_hand_x": "m", "cost": "px"}
    assert {name: found[name] for name in expected} == expected
    for name, unit in found.items():
        later = name not in FIXED + NECK + CLAVICLES + PLACE + LEGS[:8] + LEGS[16:34]
        assert not (later and unit) or name.endswith(f"_{unit}")


@pytest.mark.parametrize("state", ["no_person", "lost"])
def test_a_row_without_an_estimate_by_hand(state: str) -> None:
    row = row_of(STAMP_NS, 2.5, Estimate(state), has_points=True)
    cells = dict(zip(WHOLE, row, strict=True))
    known = {"stamp": STAMP, "state": state, "stamp_ns": STAMP_NS, "time_s": 2.5}
    assert cells == dict.fromkeys(WHOLE) | known


@pytest.mark.parametrize("state", ["tracking", "uncertain"])
def test_a_row_by_hand(state: str) -> None:
    row = dict(zip(units(), row_of(42, 1.5, replace(PLACED, state=state)), strict=True))
    assert [row[name] for name in HEADER[:4]] == [Decimal("0.000000042"), state, 0.0, 0.1]
    assert (row["stamp_ns"], row["time_s"]) == (42, 1.5)
    assert (row["right_elbow_flexion"], row["right_elbow_flexion_stddev_rad"]) == (1.1, 0.11)
    assert (row["left_shoulder_y"], row["right_hand_z"]) == (0.25, 4.25)
    assert (row["cost"], row["iou"]) == (812, 0.87654)
    assert (row["torso_x"], row["torso_z"]) == (0.25, -0.05)
    assert (row["torso_x_stddev_m"], row["torso_z_stddev_m"]) == (0.03, 0.01)
    still = dict(zip(units(), row_of(42, 1.5, FOUND), strict=True))
    assert (still["torso_x"], still["torso_x_stddev_m"]) == (0.0, 0.0)
    unsure = row_of(42, 1.5, replace(FOUND, posture_stddev=None))
    first = HEADER.index("torso_y_stddev_m")
    assert unsure[first : first + 14] == [None] * 14


def test_keypoints_have_states_and_chances() -> None:
    states = tuple(KeypointState(one) for one in ("tracked", "uncertain", "hidden") * 2)
    known = replace(PLACED, keypoint_states=states, keypoint_chances=np.arange(6) / 10)
    row = dict(zip(units(), row_of(42, 1.5, known), strict=True))
    assert (row["left_elbow_state"], row["right_hand_state"]) == ("uncertain", "hidden")
    assert (row["left_shoulder_chance"], row["right_hand_chance"]) == (0.0, 0.5)
    unknown = row_of(42, 1.5, PLACED)
    first = HEADER.index("left_shoulder_state")
    assert unknown[first : first + 12] == [None] * 12


def test_the_neck_is_empty_while_the_face_is_not_seen() -> None:
    assert row_of(42, 1.5, SEEN, has_points=True)[-67:-63] == [0.4, -0.1, 0.2, 0.3]
    assert row_of(42, 1.5, PLACED, has_points=True)[-67:-63] == [None] * 4


def test_the_clavicles_follow_the_neck() -> None:
    raised = replace(
        SEEN, clavicles_m=np.array([0.02, 0.0]), clavicles_stddev_m=np.array([0.003, 0.001])
    )
    for has_points in (False, True):
        row = dict(
            zip(
                tuple(units(has_points)),
                row_of(42, 1.5, raised, has_points=has_points),
                strict=True,
            )
        )
        assert [row[name] for name in CLAVICLES] == [0.02, 0.0, 0.003, 0.001]


def test_the_place_has_its_own_state() -> None:
    place = Place(np.array([0.2, 0.0, 0.1]), 0.13, "given stature")
    row = row_of(42, 1.5, replace(PLACED, place=place))
    assert row[-13:-8] == ["uncertain", 0.13, "given stature", None, None]
    assert row_of(42, 1.5, PLACED)[-13:-8] == [None] * 5


def test_the_vertical_has_its_own_state_and_an_uncertain_one_its_reason() -> None:
    sure = replace(PLACED, pitch_stddev_rad=0.1)
    assert row_of(42, 1.5, sure)[-10:-8] == ["tracked", None]
    unsure = replace(PLACED, state="uncertain", reason="a hand hides", pitch_stddev_rad=0.2)
    assert row_of(42, 1.5, unsure)[-10:-8] == ["uncertain", "a hand hides"]


def test_anatomical_angles_are_in_degrees_and_empty_where_they_are_not_determined() -> None:
    posture = np.zeros(12)
    posture[[2, 4, 6]] = np.radians([10.0, 90.0, 62.0])
    row = row_of(42, 1.5, replace(PLACED, posture=posture))[-8:]
    assert row[:2] + row[3:5] + row[6:] == pytest.approx([62, 90, 0, 0, 10, 0], abs=1e-6)
    assert row[2] == pytest.approx(0)
    assert row[5] is None


def test_hands_follow_all_other_columns_and_are_empty_where_unknown() -> None:
    wrist = np.array([0.1, -0.2, np.nan])
    seen = Hand(0.9, np.array([0.0, 0.6, -0.8]), wrist, np.array([0.3, 0.4, np.nan]))
    small = seen._replace(open=None, wrist=np.array([0.5, 0.6, 0.7]))
    names = tuple(units(has_points=True, has_people=True, has_hands=True))
    assert names == (*UPPER, "person", "person_chance", *HANDS, *LEGS)
    cells = row_of(42, 1.5, replace(SEEN, hands=(seen, None)), has_hands=True)[-20:]
    first = [0.9, 0.0, 0.6, -0.8, 0.1, -0.2, None]
    assert cells == [*first, *[None] * 7, 0.3, 0.4, None, *[None] * 3]
    cells = row_of(42, 1.5, replace(SEEN, hands=(None, small)), has_hands=True)[-20:]
    second = [None, 0.0, 0.6, -0.8, 0.5, 0.6, 0.7]
    assert cells == [*[None] * 7, *second, *[None] * 3, 0.3, 0.4, None]
    assert row_of(42, 1.5, SEEN, has_hands=True)[-20:] == [None] * 20


def write(path: Path) -> None:
    grey = np.zeros((3, 4), np.uint8)
    with result_table(path, has_points=True) as add:
        for number, estimate in enumerate((SEEN, Estimate("lost"))):
            add(RecordedFrame(STAMP_NS + number, number / 4, grey, grey), estimate)


def test_both_formats_have_the_same_content(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    write(tmp_path / "a.csv")
    write(tmp_path / "a.parquet")
    with (tmp_path / "a.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    table: Any = parquet.read_table(tmp_path / "a.parquet")
    assert tuple(table.column_names) == tuple(rows[0]) == WHOLE
    assert len(rows) == table.num_rows == 2
    assert [row["stamp"] for row in rows] == [f"{STAMP}", "1700000000.000000006"]
    assert table.schema.field("left_hand_x").metadata == {b"unit": b"m"}
    for row, other in zip(rows, table.to_pylist(), strict=True):
        assert (row["stamp_ns"], row["state"]) == (str(other["stamp_ns"]), other["state"])
        texts = {name for name in row if name.endswith(("state", "reason"))}
        assert all((row[name] or None) == other[name] for name in texts)
        for name in set(row) - texts - {"stamp_ns"}:
            known = None if row[name] == "" else float(row[name])
            assert known == (None if other[name] is None else pytest.approx(other[name], abs=1e-6))


def test_without_pyarrow_the_extra_is_named_and_nothing_is_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    for use in (check_table, write):
        with pytest.raises(CardboxError, match=r"pip install 'cardbox_tracker\[parquet\]'.*\.csv"):
            use(tmp_path / "a.parquet")
    check_table(tmp_path / "a.csv")
    assert list(tmp_path.iterdir()) == []


def test_the_page_lists_all_columns_in_their_order() -> None:
    """A row of the page may name several columns; JOINT stands for every joint of the posture."""
    text = (ROOT / "docs" / "results.md").read_text(encoding="utf-8")
    listed: list[str] = []
    for cell in re.findall(r"(?m)^\| (`.*?) \|", text):
        listed += re.findall(r"`([a-z_]+)`", cell)
    assert tuple(listed) == (*UPPER, "person", "person_chance", *HANDS, *LEGS, "smoothed_hz")


def test_the_smoothing_comes_after_all_others_and_only_where_there_is_one() -> None:
    assert tuple(units(is_smoothed=True)) == (*units(), "smoothed_hz")
    assert row_of(42, 1.5, replace(FOUND, smoothed_hz=4.0), is_smoothed=True)[-1] == 4.0
    assert row_of(42, 1.5, FOUND, is_smoothed=True)[-1] is None


def test_rates_are_further_columns_only_where_they_are_asked_for() -> None:
    rates = np.arange(float(len(RATE_COLUMNS))).reshape(-1, 4).T.copy()
    rates[:, 3] = np.nan
    names = tuple(units(has_rates=True))
    row = dict(
        zip(names, row_of(42, 1.5, replace(FOUND, rates=rates), has_rates=True), strict=True)
    )
    # Each joint has four values: velocity, deviation, acceleration, deviation.
    assert [row[name] for name in names[len(units()) :][:4]] == [0.0, 1.0, 2.0, 3.0]
    assert row["torso_y_velocity_m_s"] == 0.0 and row["torso_y_acceleration_stddev_m_s2"] == 3.0
    assert row["torso_yaw_velocity_rad_s"] is None
    first = 4 * len(STATE_NAMES)
    assert row["left_shoulder_x_velocity_stddev_m_s"] == first + 1
    assert units(has_rates=True)["right_hand_z_acceleration_m_s2"] == "m/s2"
    assert not any("left_knee" in name or "wrist" in name for name in names)
    assert "left_knee_flexion_velocity_rad_s" in units(has_points=True, has_rates=True)


def test_of_several_people_the_number_comes_last() -> None:
    assert tuple(units(has_people=True)) == (*units(), "person", "person_chance")
    found = replace(FOUND, person=2, person_chance=0.9)
    assert row_of(42, 1.5, found, has_people=True)[-2:] == [2, 0.9]
    nobody = Estimate("no_person", person=1)
    assert row_of(42, 1.5, nobody, has_people=True)[-2:] == [1, None]
