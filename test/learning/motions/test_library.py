"""Excerpts are drawn by seed; a mirror exchanges left and right."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cardbox_tracker.errors import CardboxError
from learning.motions.library import draw_motion, mirrored
from learning.motions.motion import Motion
from learning.motions.rotations import about_axis
from learning.motions.scripted import scripted
from learning.segments import SEGMENTS


def clip(name: str, source: str, seed: int = 0, seconds: float = 4.0) -> Motion:
    made = scripted(name, seconds, np.random.default_rng(seed))
    return Motion(name, source, made.fps, made.turns, made.places)


@pytest.fixture
def library(tmp_path: Path) -> Path:
    """One subject with nine clips, one with a single clip, and scripted motions."""
    many = [(f"07_{number:02d}", "cmu-07") for number in range(9)]
    for name, source in [*many, ("13_01", "cmu-13"), ("0000", "scripted")]:
        clip(name, source, seconds=1.0).save(tmp_path / f"{source}-{name}.npz")
    return tmp_path


def test_a_mirror_exchanges_left_and_right() -> None:
    motion = clip("a", "b")
    other = mirrored(motion)
    for limb in ("collar", "upper_arm", "forearm", "hand", "foot"):
        left, right = (SEGMENTS.index(f"{side}_{limb}") for side in ("left", "right"))
        # Arms lie along y in the T-pose, the right one along -y.
        one, seen = motion.turns[:, left, :, 1], -other.turns[:, right, :, 1]
        assert np.allclose(seen, one * (1, -1, 1), atol=1e-6)
    assert np.allclose(other.places, motion.places * (1, -1, 1))
    assert np.allclose(other.headings_rad(), -motion.headings_rad(), atol=1e-5)


def test_a_turned_head_in_the_mirror() -> None:
    """A head that is turned left and nods is turned right and nods in the mirror."""
    turns = np.tile(np.eye(3, dtype=np.float32), (1, len(SEGMENTS), 1, 1))
    turns[0, SEGMENTS.index("head")] = about_axis(2, 0.5) @ about_axis(1, 0.2)
    motion = Motion("a", "b", 30.0, turns, np.float32([[0.1, 0.2, 1.0]]))
    found = mirrored(motion).turns[0, SEGMENTS.index("head")]
    assert np.allclose(found, about_axis(2, -0.5) @ about_axis(1, 0.2), atol=1e-6)


def test_mirrored_twice_is_the_same() -> None:
    motion = clip("a", "b")
    again = mirrored(mirrored(motion))
    np.testing.assert_array_equal(again.turns, motion.turns)
    np.testing.assert_array_equal(again.places, motion.places)


def test_the_same_seed_draws_the_same_motion(library: Path) -> None:
    for seed in range(4):
        one, other = (draw_motion(np.random.default_rng(seed), library, 0.6) for _ in "ab")
        assert (one.name, one.source, one.fps) == (other.name, other.source, other.fps)
        np.testing.assert_array_equal(one.turns, other.turns)
        np.testing.assert_array_equal(one.places, other.places)


def test_sources_with_many_clips_weigh_by_the_square_root(library: Path) -> None:
    rng = np.random.default_rng(5)
    drawn = [draw_motion(rng, library, 0.3).source for _ in range(400)]
    shares = {source: drawn.count(source) / 400 for source in set(drawn)}
    # A quarter is scripted; the others are 3 to 1 for 9 clips and one.
    expected = {"scripted": 0.25, "cmu-07": 0.5625, "cmu-13": 0.1875}
    assert shares == pytest.approx(expected, abs=0.08)


@pytest.mark.parametrize("seed", range(6))
def test_excerpts_face_forward_near_the_origin(library: Path, seed: int) -> None:
    motion = draw_motion(np.random.default_rng(seed), library, 0.6)
    # Played at 0.7 to 1.3 of the speed.
    assert 0.6 / 1.3 - 0.05 < motion.duration_s < 0.6 / 0.7 + 0.05
    assert np.linalg.norm(motion.places[:, :2], axis=1).max() <= 0.5 + 1e-5
    assert abs(np.mean(motion.headings_rad())) < np.radians(90.0)
    turned = motion.turns @ np.swapaxes(motion.turns, 2, 3)
    assert np.allclose(turned, np.eye(3), atol=1e-4)


def test_short_clips_are_taken_whole(library: Path) -> None:
    motion = draw_motion(np.random.default_rng(0), library, 60.0)
    assert len(motion) == 30


def test_one_source_alone_is_enough(tmp_path: Path) -> None:
    for source in ("scripted", "cmu-07"):
        folder = tmp_path / source
        folder.mkdir()
        clip("a", source, seconds=1.0).save(folder / "a.npz")
        assert draw_motion(np.random.default_rng(0), folder, 0.5).source == source


def test_a_folder_without_motions_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CardboxError, match=r"has no motions; run python -m learning\.motions"):
        draw_motion(np.random.default_rng(0), tmp_path, 5.0)
