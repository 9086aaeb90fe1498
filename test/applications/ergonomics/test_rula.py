"""RULA: the tables of the paper, angles to scores, and the chances of uncertain postures."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cardbox_tracker.applications.ergonomics.rula import (
    PARTS,
    POSTURE_ROWS,
    RULA,
    SAMPLES,
    TABLE_A,
    TABLE_B,
    TABLE_C,
    RulaConfig,
    declared,
    grand_score,
    neck_samples,
    part_values,
    rula_scores,
    sampled_scores,
    score_distribution,
)
from cardbox_tracker.person.model import body_from_proportions
from cardbox_tracker.person.posture import TURNING_LIMITS
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import JOINT_NAMES, STATE

BODY = body_from_proportions(1.75, 2.0)


def state(mean: FloatArray, **parts: FloatArray) -> FloatArray:
    """Values and deviations of all joints, of which some parts are known beside the posture."""
    joints = np.full((2, len(STATE)), np.nan)
    joints[0, POSTURE_ROWS] = mean
    for name, values in parts.items():
        joints[:, PARTS[name]] = values
    return joints


def posture(**angles_deg: float) -> np.ndarray:
    d = np.zeros(12)
    for name, value in angles_deg.items():
        d[JOINT_NAMES.index(name)] = np.radians(value)
    return d


def scores(config: RulaConfig | None = None, **angles_deg: float) -> tuple[int, ...]:
    """Upper arm, lower arm, trunk, grand score, of the left arm; the right one hangs."""
    found = rula_scores(BODY, posture(**angles_deg), config or RulaConfig())
    names = "left_upper_arm", "left_lower_arm", "trunk", "left_grand"
    return tuple(int(found[name]) for name in names)


@pytest.mark.parametrize(
    ("upper", "lower", "wrist", "twist", "score"),
    [(1, 1, 1, 1, 1), (2, 2, 3, 2, 4), (3, 3, 3, 1, 4), (4, 3, 2, 2, 5), (6, 1, 4, 2, 9)],
)
def test_table_a_is_the_worksheets(
    upper: int, lower: int, wrist: int, twist: int, score: int
) -> None:
    assert TABLE_A[upper - 1, lower - 1, wrist - 1, twist - 1] == score


@pytest.mark.parametrize(
    ("neck", "trunk", "legs", "score"),
    [(1, 1, 2, 3), (2, 3, 1, 4), (3, 4, 2, 6), (4, 6, 1, 8), (6, 4, 2, 9)],
)
def test_table_b_is_the_worksheets(neck: int, trunk: int, legs: int, score: int) -> None:
    assert TABLE_B[neck - 1, trunk - 1, legs - 1] == score


def test_scores_beyond_table_c_count_as_its_last() -> None:
    assert [grand_score(np.array(a), np.array(b)) for a, b in ((3, 3), (12, 2), (2, 9))] == [
        3,
        5,
        5,
    ]


@pytest.mark.parametrize("table", [TABLE_A, TABLE_B, TABLE_C])
def test_no_table_falls_where_a_part_is_worse(table: np.ndarray) -> None:
    for axis in range(table.ndim):
        assert (np.diff(table, axis=axis) >= 0).all()


# Worked by hand on the worksheet: upper arm, lower arm, trunk; A, B, then the grand score.
@pytest.mark.parametrize(
    ("angles_deg", "expected"),
    [
        ({}, (1, 2, 1, 2)),  # A 2, B 1
        ({"left_elbow_flexion": 80}, (1, 1, 1, 1)),  # A 1, B 1
        ({"left_shoulder_flexion": 30, "left_elbow_flexion": 70}, (2, 1, 1, 2)),  # A 2, B 1
        ({"left_shoulder_flexion": 60, "left_elbow_flexion": 20}, (3, 2, 1, 3)),  # A 3, B 1
        ({"left_shoulder_flexion": -30}, (2, 2, 1, 3)),  # A 3, B 1
        ({"left_shoulder_abduction": 60}, (4, 3, 1, 3)),  # A 4, B 1
        ({"left_shoulder_abduction": 100, "torso_pitch": 30}, (5, 3, 3, 5)),  # A 6, B 3
        ({"torso_pitch": 70, "torso_roll": 15}, (1, 2, 5, 5)),  # A 2, B 6
        ({"torso_pitch": -15}, (1, 2, 2, 2)),  # A 2, B 2
    ],
)
def test_postures_score_as_on_the_worksheet(
    angles_deg: dict[str, float], expected: tuple[int, ...]
) -> None:
    assert scores(**angles_deg) == expected


def test_a_hand_beyond_the_middle_of_the_body_adds_one() -> None:
    # The elbow is bent by 80 degrees each time.
    assert scores(left_elbow_flexion=80)[1] == 1
    assert scores(left_elbow_abduction=-80)[1] == 2
    assert scores(left_elbow_abduction=80)[1] == 2  # to the outside


@pytest.mark.parametrize(
    ("flexion_deg", "deviation_deg", "score"),
    [(0, 0, 1), (4, 0, 1), (-10, 0, 2), (16, 0, 3), (0, 20, 2), (-30, -20, 4)],
)
def test_wrists_by_hand(flexion_deg: float, deviation_deg: float, score: int) -> None:
    """The left wrist is known, the right one counts as declared. Upper arm 1, lower arm 1."""
    wrists = np.radians([(flexion_deg, deviation_deg), (np.nan, np.nan)])
    bent = posture(left_elbow_flexion=80, right_elbow_flexion=80)
    found = rula_scores(BODY, bent, RulaConfig(wrist=2), wrists=wrists)
    assert (found["left_wrist"], found["right_wrist"]) == (score, 2)
    assert found["left_table_a"] == (1, 2, 2, 3)[score - 1]


def test_a_wrist_counts_with_all_of_its_deviation() -> None:
    """At 15 degrees, it is beyond the limit in half of the samples."""
    rng, mean = np.random.default_rng(0), posture(left_elbow_flexion=80)
    joints = state(mean, left_wrist=np.radians([(15.0, 0.0), (5.0, 1.0)]))
    drawn = np.tile(mean, (SAMPLES, 1))
    found, measured = sampled_scores(BODY, joints, drawn, RulaConfig(), rng)
    assert measured == {"left_wrist"}
    assert found.parts["left_wrist"][2] == pytest.approx(0.5, abs=0.07)
    assert found.parts["right_wrist"].tolist() == [1, 0, 0, 0]
    names = [one.name for one in declared(RulaConfig(), measured | {"right_wrist"})]
    assert "wrist" not in names and "wrist_twist" in names
    assert "wrist" in [one.name for one in declared(RulaConfig(), measured)]


def test_tables_count_without_load_and_muscle_use() -> None:
    config = RulaConfig(wrist=3, wrist_twist=2, arm_load=2, legs=2, body_muscle_use=1)
    found = rula_scores(BODY, posture(left_shoulder_abduction=100, torso_pitch=30), config)
    # Upper arm 5, lower arm 3, wrist 3, twist 2; upper arm 1, lower arm 2; neck 1, trunk 3, legs 2.
    assert (found["left_table_a"], found["right_table_a"], found["table_b"]) == (7, 3, 4)
    spread = score_distribution(BODY, posture(torso_pitch=30)[None], config)
    assert {name: len(chances) for name, chances in spread.parts.items()} == {
        part.name: part.highest for part in RULA.parts
    }
    assert spread.parts["trunk"].tolist() == [0, 0, 1, 0, 0, 0]


def test_each_input_that_is_not_seen_is_named_with_its_value() -> None:
    found = list(map(str, declared(RulaConfig(wrist=2, trunk_twisted=True))))
    assert found == [
        *("neck 1 (default)", "wrist 2", "wrist twist 1 (default)", "legs 1 (default)"),
        *("arm load 0 (default)", "arm muscle use 0 (default)"),
        *("body load 0 (default)", "body muscle use 0 (default)"),
        *("shoulders raised no (default)", "arms supported no (default)", "trunk twisted yes"),
    ]


def test_what_is_declared_counts() -> None:
    assert scores(RulaConfig(neck=3, legs=2))[3] == 3  # A 2, B 3
    assert scores(RulaConfig(arm_load=3, arm_muscle_use=1))[3] == 4  # A 2 + 4, B 1
    assert scores(RulaConfig(shoulders_raised=True, trunk_twisted=True))[:3] == (2, 2, 2)
    assert scores(RulaConfig(arms_supported=True), left_shoulder_flexion=30)[0] == 1
    with pytest.raises(ValueError, match=r"neck is 7; expected 1 to 6"):
        RulaConfig(neck=7)


# Table B with the trunk's score 1 and legs 1: necks 1 to 5 give 1, 2, 3, 5, 7; A is 2.
@pytest.mark.parametrize(
    ("yaw_deg", "pitch_deg", "neck", "grand"),
    [
        (0, 0, 1, 2),
        (0, -8, 1, 2),
        (0, 15, 2, 2),
        (0, 30, 3, 3),
        (0, -15, 4, 4),
        (30, 15, 3, 3),
        (-30, -15, 5, 5),
        (15, 5, 1, 2),
    ],
)
def test_a_known_neck_replaces_the_declared_one(
    yaw_deg: float, pitch_deg: float, neck: int, grand: int
) -> None:
    angles = np.radians([yaw_deg, pitch_deg])
    found = rula_scores(BODY, posture(), RulaConfig(neck=6), angles)
    assert (int(found["neck"]), int(found["grand"])) == (neck, grand)
    assert int(rula_scores(BODY, posture(), RulaConfig(neck=6))["neck"]) == 6


def test_an_uncertain_neck_spreads_the_score() -> None:
    postures = np.tile(posture(), (SAMPLES, 1))
    rng = np.random.default_rng(0)
    exact, unsure = (
        score_distribution(
            BODY,
            postures,
            RulaConfig(),
            neck_samples(np.radians([0.0, 30.0]), np.full(2, stddev), SAMPLES, rng),
        )
        for stddev in (0.0, 0.3)
    )
    assert exact.grand[2] == 1.0
    assert 0.0 < unsure.grand[2] < 1.0


def test_the_worse_arm_decides_and_sides_are_alike() -> None:
    left = rula_scores(BODY, posture(left_shoulder_abduction=100), RulaConfig())
    right = rula_scores(BODY, posture(right_shoulder_abduction=100), RulaConfig())
    assert left["grand"] == left["left_grand"] > left["right_grand"]
    mirrored = {"left": "right", "right": "left"}
    for name, score in left.items():
        side, _, rest = name.partition("_")
        assert right[f"{mirrored[side]}_{rest}" if side in mirrored else name] == score


@given(
    arrays(np.float64, 12, elements=st.floats(0, 1)),
    st.builds(RulaConfig, neck=st.integers(1, 6), arm_load=st.integers(0, 3)),
)
def test_every_posture_has_a_score(share: np.ndarray, config: RulaConfig) -> None:
    low, high = TURNING_LIMITS.T
    found = rula_scores(BODY, (low + share * (high - low))[None], config)
    assert 1 <= found["grand"][0] <= 7
    assert found["grand"][0] == max(found["left_grand"][0], found["right_grand"][0])


def test_a_posture_on_a_line_is_as_likely_on_either_side() -> None:
    on_the_line = posture(left_shoulder_flexion=45, left_elbow_flexion=80)
    spread = np.zeros((2001, 12))
    spread[:, JOINT_NAMES.index("left_shoulder_flexion")] = np.linspace(-0.2, 0.2, 2001)
    found = score_distribution(BODY, on_the_line + spread, RulaConfig())
    assert found.grand.sum() == pytest.approx(1)
    # Upper arm 2 or 3 with a lower arm of 1 is A 2 or 3, with B 1.
    assert found.left[[1, 2]] == pytest.approx([0.5, 0.5], abs=0.01)
    assert found.mean == pytest.approx(2.5, abs=0.01)


def test_a_measured_neck_is_not_among_the_declared_inputs() -> None:
    scores = score_distribution(BODY, posture()[None], RulaConfig(neck=2))
    measured, assumed = (part_values(scores, RulaConfig(neck=2), x) for x in ({"neck"}, ()))
    assert measured["neck (measured)"] == "2.00"
    assert "neck" not in measured["declared, not seen"]
    assert assumed["declared, not seen"].startswith("neck 2, wrist 1 (default)")
    assert assumed["legs (declared)"] == "1"


@pytest.mark.parametrize("pitch_deg", [0.0, 5.0])
def test_the_spread_does_not_push_the_score_up(pitch_deg: float) -> None:
    """Deviations as of a film: the neck's is wider than its first limit."""
    rng, mean = np.random.default_rng(0), posture(torso_pitch=pitch_deg, left_elbow_flexion=80)
    drawn = mean + np.radians(9.0) * rng.standard_normal((SAMPLES, 12))
    neck = np.array([np.zeros(2), np.radians([12.0, 12.0])])
    found, measured = sampled_scores(BODY, state(mean, neck=neck), drawn, RulaConfig(), rng)
    assert measured == {"neck"}
    assert found.of_mean == 2
    assert found.mean == pytest.approx(2.0, abs=0.3)
    known = score_distribution(BODY, drawn, RulaConfig(), neck_samples(*neck, SAMPLES, rng))
    assert known.mean > 2.5
