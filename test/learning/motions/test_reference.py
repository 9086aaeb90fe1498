"""Arms of the reference postures point where people hold them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from learning.motions.motion import Motion
from learning.motions.reference import poses, reference_pose, way, with_slouch
from learning.segments import SEGMENTS

SIDES = ("left", 1.0), ("right", -1.0)


def along(turns: np.ndarray, segment: str) -> np.ndarray:
    """Return the direction of an arm's segment, which lies sideways in the T-pose."""
    sign = 1.0 if segment.startswith("left") else -1.0
    return sign * turns[SEGMENTS.index(segment), :, 1]


def of(turns: np.ndarray, segment: str) -> np.ndarray:
    return turns[SEGMENTS.index(segment)]


@pytest.mark.parametrize(("name", "angle_deg"), [("front", 20.0), ("arms", 80.0)])
def test_upper_arms_are_raised_by_an_angle_from_hanging(name: str, angle_deg: float) -> None:
    turns, place = reference_pose(name)
    aside, down = np.sin(np.radians(angle_deg)), np.cos(np.radians(angle_deg))
    for side, sign in SIDES:
        assert along(turns, f"{side}_upper_arm") == pytest.approx([0.0, sign * aside, -down])
    assert place.tolist() == [0.0, 0.0, 1.0]
    for segment in ("hips", "chest", "head", "left_thigh", "right_foot"):
        assert of(turns, segment) == pytest.approx(np.eye(3))


def test_collars_rise_with_stretched_arms_alone() -> None:
    hanging, stretched = (reference_pose(name)[0] for name in ("front", "arms"))
    rise = np.radians(0.18 * (80.0 - 30.0))
    for side, sign in SIDES:
        assert along(hanging, f"{side}_collar") == pytest.approx([0.0, sign, 0.0])
        expected = [0.0, sign * np.cos(rise), np.sin(rise)]
        assert along(stretched, f"{side}_collar") == pytest.approx(expected)


@pytest.mark.parametrize("name", ["front", "arms"])
def test_forearms_are_bent_forward_a_little(name: str) -> None:
    turns, _ = reference_pose(name)
    for side, _ in SIDES:
        upper, fore = (along(turns, f"{side}_{part}") for part in ("upper_arm", "forearm"))
        assert upper @ fore == pytest.approx(np.cos(np.radians(5.0)))
        assert fore[0] == pytest.approx(np.sin(np.radians(5.0)))
        assert along(turns, f"{side}_hand") == pytest.approx(fore)


def test_palms_face_the_thighs_when_arms_hang() -> None:
    turns, _ = reference_pose("front")
    for side, sign in SIDES:
        # Palms point down in the T-pose, and thumbs forward.
        palm, thumb = -of(turns, f"{side}_hand")[:, 2], of(turns, f"{side}_hand")[:, 0]
        assert sign * palm[1] < -0.9
        assert thumb[0] > 0.9


def test_the_side_is_the_front_turned_to_the_left() -> None:
    front, side = reference_pose("front")[0], reference_pose("side")[0]
    for segment in ("hips", "chest", "left_foot"):
        assert of(side, segment)[:, 0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert np.allclose(side, turn @ front)


def test_people_take_postures_a_little_differently() -> None:
    found = [reference_pose("arms", np.random.default_rng(seed)) for seed in range(300)]
    raised = [np.degrees(np.arcsin(-along(turns, "left_upper_arm")[2])) for turns, _ in found]
    places = np.array([place for _, place in found])
    # The scatter of the trunk's roll is added to that of the arm.
    assert np.mean(raised) == pytest.approx(10.0, abs=1.0) and 3.0 < np.std(raised) < 6.0
    assert places[:, :2].std() == pytest.approx(0.01, rel=0.2) and (places[:, 2] == 1.0).all()
    again = reference_pose("arms", np.random.default_rng(0))
    assert np.array_equal(again[0], found[0][0]) and np.array_equal(again[1], found[0][1])


def test_a_way_eases_from_one_pose_to_another() -> None:
    start, end = reference_pose("front"), (reference_pose("side")[0], np.array([0.3, 0.0, 0.9]))
    found = list(way(start, end, 49))
    assert len(found) == 49
    for one, other in ((found[0], start), (found[-1], end)):
        assert np.allclose(one[0], other[0], atol=0.01) and np.allclose(one[1], other[1], atol=0.01)
    # Half of the way is half of the quarter turn.
    half = np.sqrt(0.5)
    assert of(found[24][0], "hips")[:, 0] == pytest.approx([half, half, 0.0])
    assert found[24][1] == pytest.approx([0.15, 0.0, 0.95])
    steps = [np.linalg.norm(b[0] - a[0]) for a, b in pairwise(found)]
    assert steps[0] < 0.2 * max(steps) and steps[-1] < 0.2 * max(steps)
    for turns, _ in found:
        assert np.allclose(turns @ np.swapaxes(turns, 1, 2), np.eye(3))


def test_no_way_has_no_poses() -> None:
    assert list(way(reference_pose("front"), reference_pose("arms"), 0)) == []


def test_a_slouch_leans_trunk_and_arms_alike_and_leaves_the_legs() -> None:
    turns = np.tile(reference_pose("arms")[0].astype(np.float32), (3, 1, 1, 1))
    motion = Motion("a", "b", 30.0, turns, np.tile(np.float32([0, 0, 1]), (3, 1)))
    leaning = with_slouch(motion, np.random.default_rng(2), 10.0)
    lean = of(leaning.turns[0], "chest")
    assert 1.0 < np.degrees(np.arccos((np.trace(lean) - 1) / 2)) < 40.0
    for index, segment in enumerate(SEGMENTS):
        is_leg = segment.endswith(("hips", "thigh", "shin", "foot"))
        expected = turns[0, index] if is_leg else lean @ turns[0, index]
        assert np.allclose(leaning.turns[:, index], expected, atol=1e-6), segment
    assert len(list(poses(leaning))) == 3
