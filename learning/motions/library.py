"""Draws random excerpts of the collected motions, so that no source outweighs the others."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from cardbox_tracker.errors import CardboxError
from learning.motions.motion import Motion, load
from learning.motions.reference import with_slouch
from learning.motions.wrists import has_stiff_wrists, with_wrists
from learning.segments import SEGMENTS

SCRIPTED = "scripted"
# Share of random key postures beside motion capture.
_SCRIPTED_SHARE = 0.25
# Speeds at which clips are played, and largest constant turn of a person, rad.
_SPEEDS, _TURN_RAD = (0.7, 1.3), np.radians(35.0)
_FARTHEST = 0.5


def draw_motion(rng: np.random.Generator, folder: Path, seconds: float) -> Motion:
    """Return a random excerpt, mirrored, turned, and played faster or slower at random.

    Args:
        rng: source of chance.
        folder: files that ``learning.motions.collect`` has written.
        seconds: duration before the speed changes; shorter clips are taken whole.

    Raises:
        CardboxError: the folder has no motions.
    """
    groups = _groups(folder)
    if not groups:
        raise CardboxError(f"{folder} has no motions; run python -m learning.motions.collect")
    names = sorted(groups)
    # The square root is between one weight for each source and one for each clip.
    weights = np.array([0.0 if name == SCRIPTED else len(groups[name]) ** 0.5 for name in names])
    weights *= (1.0 - _SCRIPTED_SHARE * (SCRIPTED in groups)) / max(weights.sum(), 1e-9)
    if SCRIPTED in groups:
        weights[names.index(SCRIPTED)] = 1.0 - weights.sum()
    files = groups[names[rng.choice(len(names), p=weights / weights.sum())]]
    motion = load(files[int(rng.integers(len(files)))])
    start_s = rng.uniform(0.0, max(motion.duration_s - seconds, 0.0))
    motion = motion.segment(start_s, start_s + seconds)
    if rng.random() < 0.5:
        motion = mirrored(motion)
    motion = replace(motion, fps=motion.fps * rng.uniform(*_SPEEDS))
    motion = with_slouch(motion.facing_forward(), rng).turned(rng.normal(0.0, 0.4 * _TURN_RAD))
    if has_stiff_wrists(motion):
        motion = with_wrists(motion, rng)
    if np.linalg.norm(motion.places[:, :2], axis=1).max() > _FARTHEST:
        motion = motion.on_the_spot(_FARTHEST)
    return motion


def mirrored(motion: Motion) -> Motion:
    """Return the motion in a mirror: left and right are exchanged."""
    flip = np.diag([1.0, -1.0, 1.0]).astype(np.float32)
    order = [SEGMENTS.index(_other(name)) for name in SEGMENTS]
    turns = (flip @ motion.turns[:, order] @ flip).astype(np.float32)
    return replace(motion, turns=turns, places=motion.places @ flip)


def _other(name: str) -> str:
    side, _, rest = name.partition("_")
    return {"left": f"right_{rest}", "right": f"left_{rest}"}.get(side, name)


@lru_cache(maxsize=4)
def _groups(folder: Path) -> dict[str, list[Path]]:
    """Return the files of each source."""
    groups: dict[str, list[Path]] = defaultdict(list)
    for path in sorted(folder.glob("*.npz")):
        with np.load(path) as file:
            groups[str(file["source"])].append(path)
    return dict(groups)
