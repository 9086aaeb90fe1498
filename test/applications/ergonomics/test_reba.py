"""REBA by hand: scores of parts, the three tables, sitting and lifted feet, tables of results."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.applications.ergonomics.reba import (
    REBA,
    TABLE_A,
    TABLE_B,
    TABLE_C,
    RebaConfig,
    images_of,
    reba_scores,
    score_table,
    sits,
)
from cardbox_tracker.applications.ergonomics.recording import score_shares, summarize, write_csv
from cardbox_tracker.applications.ergonomics.report import PageContent, report_lines, write_page
from cardbox_tracker.applications.ergonomics.rula import declared
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.posture import PITCH, ROLL
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import JOINT_NAMES, KeypointState
from cardbox_tracker.recordings.result_reader import read_results
from cardbox_tracker.recordings.result_table import row_of, units
from cardbox_tracker.tracking.estimate import Estimate, Hand, Legs

CONFIG = RebaConfig()
LENGTHS_M = np.array([0.5, 0.42, 0.42, 0.42, 0.42])
STANDING = np.zeros(8)
SEATED = np.radians([90.0, 0.0, 0.0, 90.0] * 2)


def posture(**degrees: float) -> FloatArray:
    found = np.zeros(12)
    for name, angle in degrees.items():
        found[JOINT_NAMES.index(name)] = np.radians(angle)
    return found


def legs_of(degrees: dict[int, float], pitch: float = 0.0) -> int:
    angles = STANDING.copy()
    for at, angle in degrees.items():
        angles[at] = np.radians(angle)
    body = posture(torso_pitch=pitch)
    return int(reba_scores(body, CONFIG, legs=angles, lengths_m=LENGTHS_M)["legs"])


def test_a_person_who_stands_upright_has_the_least_scores() -> None:
    """Trunk, neck and legs 1: A = 1. Upper arm 1, straight elbow 2, wrist 1: B = 1. C = 1."""
    found = reba_scores(np.zeros(12), CONFIG, np.zeros(2), STANDING, lengths_m=LENGTHS_M)
    assert (found["trunk"], found["neck"], found["legs"], found["table_a"]) == (1, 1, 1, 1)
    assert (found["left_upper_arm"], found["left_lower_arm"], found["left_table_b"]) == (1, 2, 1)
    assert found["grand"] == 1


def test_a_bowed_person_who_lifts_by_hand() -> None:
    """Bowed by 65 degrees, knees by 40, right arm forwards by 50, a load of 2, poor handles.

    Trunk 4, neck 2 (bent by 25), legs 1 + 1 = 2: table A has 6, and 8 with the load. Right arm:
    3, straight elbow 2, wrist 1: table B has 4, and 6 with the handles. Table C has 10 for (8, 6).
    """
    bowed = posture(torso_pitch=65.0, right_shoulder_flexion=50.0)
    legs = np.radians([20.0, 0.0, 0.0, 40.0] * 2)
    config = replace(CONFIG, load=2, coupling=2)
    found = reba_scores(bowed, config, np.radians([0.0, 25.0]), legs, lengths_m=LENGTHS_M)
    assert (found["trunk"], found["neck"], found["legs"], found["table_a"]) == (4, 2, 2, 6)
    assert (found["right_upper_arm"], found["right_lower_arm"], found["right_table_b"]) == (3, 2, 4)
    assert found["right_grand"] == 10
    assert found["grand"] == 10
    # Neck and legs as declared: table A has 3, and 5 with the load; table C has 7 for (5, 6).
    assert reba_scores(bowed, replace(config, activity=2))["grand"] == 7 + 2


@pytest.mark.parametrize(
    ("pitch", "roll", "expected"),
    [(0, 0, 1), (15, 0, 2), (-15, 0, 2), (45, 0, 3), (-24, 0, 3), (70, 0, 4), (15, 15, 3)],
)
def test_scores_of_the_trunk(pitch: float, roll: float, expected: int) -> None:
    body = np.zeros(12)
    body[[PITCH, ROLL]] = np.radians([pitch, roll])
    assert reba_scores(body, CONFIG)["trunk"] == expected


@pytest.mark.parametrize(
    ("yaw", "pitch", "expected"), [(0, 15, 1), (0, 25, 2), (0, -15, 2), (30, 0, 2), (30, 25, 3)]
)
def test_scores_of_the_neck(yaw: float, pitch: float, expected: int) -> None:
    assert reba_scores(np.zeros(12), CONFIG, np.radians([yaw, pitch]))["neck"] == expected


def test_scores_of_the_legs() -> None:
    assert legs_of({}) == 1
    # The bent thigh keeps the feet below the body.
    assert legs_of({0: 25.0, 3: 45.0, 4: 25.0, 7: 45.0}) == 2
    # A squat: the trunk leans over the feet.
    assert legs_of({0: 70.0, 3: 100.0, 4: 70.0, 7: 100.0}, pitch=40.0) == 3
    # One foot 0.42 (1 - cos 60) = 21 cm higher; its knee does not count.
    assert legs_of({0: 60.0, 3: 60.0}) == 2


def test_knees_do_not_count_for_who_sits(tmp_path: Path) -> None:
    def legs_in(angles: FloatArray, period_s: float) -> list[float]:
        path = table(tmp_path / "sits.csv", angles, period_s=period_s)
        rows = score_table(images_of(read_results(path)), CONFIG, seed=1)
        return [float(row.scores.parts["legs"].argmax()) + 1 for row in rows if row.scores]

    assert legs_in(SEATED, 0.5) == [1.0] * 4
    # For 0.6 s, nobody knows whether the person falls or sits down.
    assert legs_in(SEATED, 0.2) == [3.0] * 4
    # Thighs that slope by 45 degrees: a squat whose trunk was found too upright.
    assert legs_in(np.radians([45.0, 0.0, 0.0, 85.0] * 2), 0.5) == [3.0] * 4


@pytest.mark.parametrize(("hip", "knee", "lean"), [(95, 115, 35), (80, 95, 40), (100, 125, 35)])
@pytest.mark.parametrize("error", [-9, 0, 9])
def test_a_squat_that_is_found_too_upright_is_none_who_sits(
    hip: float, knee: float, lean: float, error: float
) -> None:
    """Knees or trunk off by what is usual: the centre of mass of these is above the feet."""
    for legs, trunk in (((hip, knee + error), lean), ((hip, knee), lean - abs(error) - 6)):
        angles = np.radians([legs[0], 0.0, 0.0, legs[1]] * 2)
        assert not sits(angles, np.radians(trunk), LENGTHS_M)


@pytest.mark.parametrize("lean", [-20, 0, 15])
@pytest.mark.parametrize(("hip", "knee"), [(90, 90), (80, 80), (95, 70)])
def test_who_sits_is_found(hip: float, knee: float, lean: float) -> None:
    assert sits(np.radians([hip, 0.0, 0.0, knee] * 2), np.radians(lean), LENGTHS_M)


def test_what_is_not_measured_counts_as_declared() -> None:
    config = replace(CONFIG, neck=3, legs=4)
    found = reba_scores(np.zeros(12), config)
    assert (found["neck"], found["legs"], found["table_a"]) == (3, 4, 6)
    names = [one.name for one in declared(config, ("neck", "legs"))]
    assert "neck" not in names and "legs" not in names
    assert {"load", "coupling", "activity", "wrist"} <= set(names)


@pytest.mark.parametrize(
    ("flexion_deg", "deviation_deg", "score"), [(14, 0, 1), (-16, 0, 2), (0, 20, 2), (40, -20, 3)]
)
def test_wrists_by_hand(flexion_deg: float, deviation_deg: float, score: int) -> None:
    wrists = np.radians([(np.nan, np.nan), (flexion_deg, deviation_deg)])
    found = reba_scores(np.zeros(12), replace(CONFIG, wrist=3), wrists=wrists)
    assert (found["left_wrist"], found["right_wrist"]) == (3, score)
    # Upper arm 1, straight elbow 2.
    assert found["right_table_b"] == (1, 2, 3)[score - 1]


def test_wrists_of_a_table_are_read(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    hand = Hand(0.5, np.array([0.0, 0.0, 1.0]), np.full(3, 0.4), np.full(3, 0.1))
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(units(has_points=True, has_hands=True))
        for i, hands in enumerate((None, (None, hand))):
            found = replace(seen(SEATED), hands=hands)
            cells = row_of(10**9 + i, 0.0, found, has_points=True, has_hands=True)
            writer.writerow(["" if cell is None else cell for cell in cells])
    before, after = score_table(images_of(read_results(path)), CONFIG, seed=1)
    assert (before.measured, after.measured) == ({"legs"}, {"legs", "right_wrist"})
    # 23 degrees, and bent aside.
    assert after.scores is not None and after.scores.parts["right_wrist"][2] > 0.8


def test_corners_of_the_tables() -> None:
    assert (TABLE_A[0, 0, 0], TABLE_A[4, 2, 3], TABLE_A[1, 1, 2], TABLE_A[3, 0, 3]) == (1, 9, 5, 7)
    assert (TABLE_B[0, 0, 0], TABLE_B[5, 1, 2], TABLE_B[2, 1, 1], TABLE_B[4, 0, 0]) == (1, 9, 5, 6)
    assert (TABLE_C[0, 0], TABLE_C[11, 11], TABLE_C[4, 3], TABLE_C[6, 9]) == (1, 12, 5, 11)
    # A higher score of a part never lowers the result.
    for table in (TABLE_A, TABLE_B, TABLE_C):
        for axis in range(table.ndim):
            assert (np.diff(table, axis=axis) >= 0).all()


def seen(angles: FloatArray, state: KeypointState = KeypointState.TRACKED) -> Estimate:
    points_m = np.zeros((6, 3))
    points_m[[1, 4], 1], points_m[[2, 5], 1] = 0.42, 0.84
    legs = Legs(angles, np.full(8, 0.05), points_m, np.full(6, 0.05), (state,) * 6)
    keypoints = np.full((6, 3), -0.5)
    return Estimate("tracking", np.zeros(12), np.full(12, 0.02), keypoints, 100, 0.9, legs=legs)


def table(
    path: Path,
    angles: FloatArray,
    state: KeypointState = KeypointState.TRACKED,
    period_s: float = 1.0,
) -> Path:
    found, times_s = seen(angles, state), period_s * np.arange(4)
    rows = [row_of(round(1e9 * t), t, found, has_points=True) for t in times_s.tolist()]
    rows.append(row_of(4 * 10**9, 4.0, Estimate("lost"), has_points=True))
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(units(has_points=True))
        writer.writerows(["" if cell is None else cell for cell in row] for row in rows)
    return path


def test_a_table_of_results_is_scored(tmp_path: Path) -> None:
    images = images_of(read_results(table(tmp_path / "a.csv", SEATED)))
    rows = score_table(images, CONFIG, seed=1)
    assert [row.scores is None for row in rows] == [False] * 4 + [True]
    assert all(row.measured == {"legs"} for row in rows[:4])
    assert rows[0].scores is not None
    assert rows[0].scores.parts["legs"][0] == 1.0
    assert float(rows[0].scores.grand.sum()) == pytest.approx(1.0)
    again = score_table(images, CONFIG, seed=1)[0].scores
    assert again is not None and (again.grand == rows[0].scores.grand).all()
    shares = score_shares(rows, CONFIG, REBA)
    sources = {one.name: one.source for one in shares}
    assert sources["legs"] == "measured" and sources["neck"] == "declared"
    lines = "\n".join(report_lines(summarize(rows, REBA), shares, CONFIG, REBA))
    assert "expected REBA score" in lines and "the legs were measured all the time" in lines
    write_csv(rows, tmp_path / "reba.csv", REBA)
    text = (tmp_path / "reba.csv").read_text().splitlines()
    assert text[0].endswith("mean_posture_score,legs_from,left_wrist_from,right_wrist_from")
    assert text[1].endswith(",measured,declared,declared")
    page = tmp_path / "reba.html"
    write_page(PageContent("Sitting", {}, CONFIG, rows, method=REBA), page)
    assert "Rapid Entire Body Assessment" in page.read_text(encoding="utf-8")
    assert "RULA" not in page.read_text(encoding="utf-8")


def test_hidden_legs_count_as_declared(tmp_path: Path) -> None:
    images = images_of(read_results(table(tmp_path / "a.csv", SEATED, KeypointState.HIDDEN)))
    rows = score_table(images, replace(CONFIG, legs=4), seed=1)
    assert not any(row.measured for row in rows)
    assert rows[0].scores is not None and rows[0].scores.parts["legs"][3] == 1.0


def test_a_table_without_legs_is_refused(tmp_path: Path) -> None:
    path = table(tmp_path / "a.csv", SEATED)
    path.write_text(path.read_text().replace("left_hip_flexion", "other"))
    with pytest.raises(CardboxError, match="--detector mediapipe --csv"):
        images_of(read_results(path))
    with pytest.raises(CardboxError, match="there are no results"):
        images_of(read_results(tmp_path / "none.csv"))
