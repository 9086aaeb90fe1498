from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from learning.motions import arms
from learning.motions.acclaim import read_amc
from learning.motions.capture import to_motion
from learning.motions.collect import is_copy, main, named
from learning.motions.figure import ends, figures, hands_in_chest
from learning.motions.gestures import gestures
from learning.motions.motion import Motion, load
from learning.motions.rotations import about_axis, between, from_quaternions, to_quaternions
from learning.motions.scripted import scripted
from learning.motions.wrists import bend, has_stiff_wrists, with_wrists
from learning.segments import PARENTS, SEGMENTS

# Half turns make the real part of the quaternion vanish, the hardest case.
ANGLES = (0.0, 0.3, np.pi / 2, np.pi - 1e-9, np.pi)


def still(frames: int = 60, fps: float = 30.0) -> Motion:
    turns = np.tile(np.eye(3, dtype=np.float32), (frames, len(SEGMENTS), 1, 1))
    places = np.tile(np.float32([0, 0, 1]), (frames, 1))
    return Motion("still", "test", fps, turns, places)


def walking() -> Motion:
    motion = still(300).turned(2.0)
    motion.places[:, 1] += np.linspace(0, 12, 300)
    return motion


def test_parents_come_before_their_children() -> None:
    assert len(PARENTS) == len(SEGMENTS)
    assert all(parent < index for index, parent in enumerate(PARENTS))


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("angle", ANGLES)
def test_quaternions_give_the_rotation_back(axis: int, angle: float) -> None:
    turn = about_axis(axis, angle)
    assert np.allclose(from_quaternions(to_quaternions(turn)), turn, atol=1e-7)


def test_half_of_a_quarter_turn() -> None:
    start, end = to_quaternions(np.eye(3)), to_quaternions(about_axis(2, np.pi / 2))
    half = from_quaternions(between(start, -end, 0.5))
    assert np.allclose(half, about_axis(2, np.pi / 4))


def test_t_pose_of_the_figure() -> None:
    tips = ends(still())
    assert tips["left_hand"][0] @ (0, 1, 0) > 0.7
    assert tips["right_hand"][0] @ (0, 1, 0) < -0.7
    assert figures(still())[0, SEGMENTS.index("left_foot"), 2] == pytest.approx(0.08)


def test_facing_forward_turns_the_mean_heading_to_x() -> None:
    assert np.allclose(still().turned(2.0).facing_forward().headings_rad(), 0, atol=1e-6)


def test_resampling_keeps_duration_and_turns() -> None:
    motion = still(61, 60.0)
    motion.turns[:] = about_axis(2, np.linspace(0, 1, 61))[:, None]
    slow = motion.resampled(30.0)
    assert len(slow) == 31
    assert np.allclose(slow.turns[-1], about_axis(2, 1.0), atol=1e-6)
    assert np.allclose(motion.resampled(45.0).headings_rad(), np.arange(46) / 45, atol=1e-6)


def test_a_straight_walk_stays_on_the_spot() -> None:
    places = walking().on_the_spot().places
    assert np.abs(places[:, :2]).max() < 0.01
    jump = still(300)
    jump.places[150:, 0] += 5
    assert np.linalg.norm(jump.on_the_spot().places[:, :2], axis=1).max() <= 0.5


def test_saved_motions_come_back(tmp_path: Path) -> None:
    motion = scripted("a", 2.0, np.random.default_rng(3))
    motion.save(tmp_path / "a.npz")
    again = load(tmp_path / "a.npz")
    assert (again.name, again.source, again.fps) == ("a", "scripted", 30.0)
    assert np.allclose(again.turns, motion.turns, atol=3e-3)


def test_wrong_shapes_are_refused() -> None:
    with pytest.raises(ValueError, match="turns"):
        Motion("a", "b", 30.0, np.zeros((2, 3, 3, 3), np.float32), np.zeros((2, 3), np.float32))


@pytest.mark.parametrize("side", ["left", "right"])
def test_wrists_bend_towards_palm_and_thumb(side: str) -> None:
    finger = np.array([0.0, 1.0 if side == "left" else -1.0, 0.0])
    to_palm, to_thumb = bend(np.array([[0.0, 0.5, 0.0], [0.0, 0.0, 0.5]]), side) @ finger
    assert to_palm[2] == pytest.approx(-np.sin(0.5))
    assert to_thumb[0] == pytest.approx(np.sin(0.5))
    assert bend(np.array([0.5, 0, 0]), side)[2, 0] < 0  # the thumb goes down


def test_wrists_of_a_stiff_capture_move() -> None:
    moved = with_wrists(still(300), np.random.default_rng(0))
    assert has_stiff_wrists(still(300)) and not has_stiff_wrists(moved)


@pytest.mark.parametrize("place", [(0.4, 0.1, -0.2), (0.05, 0.04, -0.6), (0.0, 0.3, 0.5)])
def test_arms_reach_their_places(place: tuple[float, float, float]) -> None:
    arm = arms.reaching(place, (-0.4, 0.7, -0.8))
    upper, fore = arms.directions(arm.upper, arm.elbow_rad)
    assert np.allclose(arms.UPPER_ARM * upper + arms.FOREARM * fore, place, atol=1e-6)


def test_arms_in_the_trunk_are_not_free() -> None:
    inside = arms.reaching((0.0, -0.2, -0.3), (0, 1, 0))
    before = arms.reaching((0.3, -0.1, -0.3), (0, 1, -1))
    assert not arms.is_free(inside.upper[None], [inside.elbow_rad])
    assert arms.is_free(before.upper[None], [before.elbow_rad])


def test_scripted_motions_are_smooth_and_reach_before_and_behind() -> None:
    motions = [scripted(str(k), 20.0, np.random.default_rng(k)) for k in range(4)]
    hands = np.concatenate([hands_in_chest(motion) for motion in motions])
    assert 0.02 < np.mean(hands[:, :, 0] < -0.05) < 0.5
    assert np.mean(hands[:, :, 0] > 0.3) > 0.2
    steps = np.concatenate([np.diff(hands_in_chest(m), axis=0) for m in motions])
    assert np.linalg.norm(steps, axis=2).max() < 0.35
    assert all(np.abs(m.headings_rad().mean()) < 0.5 for m in motions)


SKELETON = """:version 1.10
:bonedata
{bones}:hierarchy
  begin
    root lhipjoint rhipjoint lowerback
    lhipjoint lfemur
    lfemur ltibia
    ltibia lfoot
    rhipjoint rfemur
    rfemur rtibia
    rtibia rfoot
    lowerback upperback
    upperback thorax
    thorax lowerneck lclavicle rclavicle
    lowerneck head
    lclavicle lhumerus
    lhumerus lradius
    lradius lhand
    lhand lfingers
    rclavicle rhumerus
    rhumerus rradius
    rradius rhand
    rhand rfingers
  end
"""


def subject(folder: Path, frame: str) -> Path:
    """Write a skeleton whose arms lie sideways and whose legs splay; return one frame's file."""
    along = {
        "hipjoint": "1 0 0", "femur": "0.342 -0.94 0", "tibia": "0.342 -0.94 0",
        "foot": "0 0 1", "clavicle": "1 0 0", "humerus": "1 0 0", "radius": "1 0 0",
        "hand": "1 0 0", "fingers": "1 0 0",
    }  # fmt: skip
    directions = dict.fromkeys(("lowerback", "upperback", "thorax", "lowerneck"), "0 1 0")
    directions["head"] = "0 1 0"
    directions |= {f"l{name}": words for name, words in along.items()}
    directions |= {f"r{n}": w.replace("1 0 0", "-1 0 0") for n, w in along.items()}
    directions |= {f"r{n}": "-0.342 -0.94 0" for n in ("femur", "tibia")}
    bones = "".join(
        f"begin\nid 1\nname {name}\ndirection {words}\nlength 4\naxis 0 0 0 XYZ\n"
        f"dof rx ry rz\nend\n"
        for name, words in directions.items()
    )
    (folder / "91.asf").write_text(SKELETON.format(bones=bones))
    given = dict(line.split(" ", 1) for line in frame.splitlines())
    zero = {"root": "0 8 0 0 0 0", **dict.fromkeys(directions, "0 0 0")}
    lines = [f"{name} {words}" for name, words in (zero | given).items()]
    path = folder / "91_01.amc"
    frames = [f"{k + 1}\n" + "\n".join(lines) for k in range(200)]
    path.write_text(":FULLY-SPECIFIED\n" + "\n".join(frames) + "\n")
    return path


def hand_of(path: Path, side: str) -> np.ndarray:
    motion = to_motion(read_amc(path), "a", "b")
    arm = motion.turns[0, SEGMENTS.index(f"{side}_upper_arm"), :, 1]
    return np.asarray(arm if side == "left" else -arm)


def test_arms_of_a_capture_turn_as_captured(tmp_path: Path) -> None:
    path = subject(tmp_path, "lhumerus 0 0 -90\nrhumerus 0 90 0")
    assert np.allclose(hand_of(path, "left"), (0, 0, -1), atol=1e-6)
    # The right arm points to -x of the capture; a quarter turn about y brings it forward.
    assert np.allclose(hand_of(path, "right"), (1, 0, 0), atol=1e-6)


def test_splayed_legs_at_rest_are_splayed_and_others_upright(tmp_path: Path) -> None:
    motion = to_motion(read_amc(subject(tmp_path, "lfemur 0 0 -20")), "a", "b")
    down = motion.turns[0, [SEGMENTS.index(f"{s}_thigh") for s in ("left", "right")]] @ (0, 0, -1)
    assert np.allclose(down[0], (0, 0, -1), atol=1e-3)
    assert np.allclose(down[1], (0, -0.342, -0.94), atol=1e-3)


def test_names_tell_the_subject() -> None:
    assert named(Path("x/007/007_01.bvh")) == ("07_01", "cmu-07")
    assert named(Path("train/walking/walking_1.txt")) == ("train_walking_1", "cmu_text-walking")


def test_copies_are_found_despite_a_shift() -> None:
    angles = np.cumsum(np.random.default_rng(0).normal(size=(200, 2)), axis=0)
    assert is_copy(angles, angles[2:] + 20)
    assert not is_copy(angles, angles[::-1])


def test_collecting_writes_one_file_for_a_clip(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    subject(tmp_path, "lradius 0 -30 0")
    output = tmp_path / "out"
    main([str(tmp_path), "--output", str(output), "--scripted", "0.34"])
    assert {p.name for p in output.iterdir()} == {"cmu-91-91_01.npz", "scripted-0000.npz"}
    assert "cmu-91" in capsys.readouterr().out


def test_a_person_who_gestures_faces_the_camera_and_uses_one_arm_or_both() -> None:
    motions = [gestures(str(seed), 20.0, np.random.default_rng(seed)) for seed in range(20)]
    assert {motion.source for motion in motions} == {"gesture"}
    assert all(len(motion) == 600 for motion in motions)
    hands = np.concatenate([hands_in_chest(motion) for motion in motions])
    # Hands are before the shoulders most of the time, and often one alone is raised.
    assert 0.6 < np.mean(hands[:, :, 0] > 0.0) < 0.98
    is_raised = hands[:, :, 2] > -0.4
    assert np.mean(is_raised[:, 0] != is_raised[:, 1]) > 0.1
    turned = np.concatenate([np.abs(motion.headings_rad()) for motion in motions])
    assert np.mean(turned < np.radians(20)) > 0.7
