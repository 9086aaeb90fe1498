"""Collect motions from folders of motion capture into compact files, one per clip.

    python -m learning.motions.collect FOLDER... --output FOLDER [--scripted MINUTES]
                                       [--gestures MINUTES] [--seed 0]

The folders are searched for ``.bvh``, ``.amc`` (with its ``.asf``) and ``.txt`` files; see
learning.motions.readers. Sources are named so that people can be left out: "cmu-13" is subject 13
of the CMU database, "cmu_text-basketball" a kind of motion by people who are not named, "scripted"
and "gesture" contain no capture. Clips that the recorded sessions contain, and copies of one clip,
are left out.
"""

from __future__ import annotations

import argparse
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from learning.motions.capture import to_motion
from learning.motions.figure import hands_in_chest
from learning.motions.gestures import gestures
from learning.motions.motion import Motion
from learning.motions.readers import read
from learning.motions.scripted import scripted
from learning.motions.wrists import has_stiff_wrists, with_wrists
from learning.pose_prior import BROKEN, USED_IN_SESSIONS
from learning.segments import SEGMENTS

FPS = 30.0
CLIP_S = 20.0
SHORTEST_S = 1.0
# Copies of a clip agree in the angles of the elbows, but for constants and single frames.
SAME_CORRELATION, SAME_FRAMES, STILL_DEG = 0.97, 5, 2.0


def named(path: Path) -> tuple[str, str]:
    """Return name and source of the clip of a file."""
    numbered = re.fullmatch(r"0*(\d+)_(\d+)", path.stem)
    if numbered:
        subject, clip = numbered.groups()
        return f"{int(subject):02d}_{clip}", f"cmu-{int(subject):02d}"
    kind = re.sub(r"_\d+$", "", path.stem)
    return f"{path.parts[-3]}_{path.stem}" if len(path.parts) > 2 else path.stem, f"cmu_text-{kind}"


def captured(folders: Iterable[Path]) -> Iterator[tuple[Motion, bool]]:
    """Yield every motion of the folders and whether it may train; excluded ones come first."""
    excluded = {*USED_IN_SESSIONS, *BROKEN}
    found = [
        path
        for folder in folders
        for path in folder.rglob("*")
        if path.suffix in (".bvh", ".amc", ".txt") and path.stat().st_size > 1000
    ]
    keyed = []
    for path in found:
        name, source = named(path)
        trains = name not in excluded and path.stem not in excluded
        # The database itself comes before conversions of it, and those before unnamed people.
        order = (".amc", ".bvh", ".txt").index(path.suffix)
        keyed.append((trains, order, name, source, path))
    for trains, _, name, source, path in sorted(keyed, key=lambda k: (*k[:3], str(k[4]))):
        try:
            capture = read(path)
            motion = to_motion(capture, name, source)
        except ValueError as error:
            print(f"{path} is left out: {error}")
            continue
        trains &= capture.has_true_headings
        yield motion.resampled(FPS) if abs(motion.fps - FPS) > 0.1 else motion, trains


def elbows_deg(motion: Motion) -> NDArray[np.float64]:
    """Return the angles (frames, 2) between upper arm and forearm, deg."""
    angles = []
    for side in ("left", "right"):
        upper, fore = (
            motion.turns[:, SEGMENTS.index(f"{side}_{limb}"), :, 1].astype(float)
            for limb in ("upper_arm", "forearm")
        )
        angles.append(np.degrees(np.arccos(np.clip(np.sum(upper * fore, axis=1), -1, 1))))
    return np.stack(angles, axis=1)


def is_copy(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Return whether angles of elbows (frames, 2) come from the same performance."""
    if abs(len(one) - len(other)) > SAME_FRAMES:
        return False
    length = min(len(one), len(other)) - SAME_FRAMES
    for lag in range(-SAME_FRAMES, SAME_FRAMES + 1):
        a, b = one[max(lag, 0) :][:length], other[max(-lag, 0) :][:length]
        shared = min(len(a), len(b))
        if shared and are_alike(a[:shared], b[:shared]):
            return True
    return False


def are_alike(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Return whether columns (n, k), less their means, are almost proportional and not still."""
    a, b = (angles - angles.mean(axis=0) for angles in (one, other))
    size = np.sqrt(np.mean(a**2)), np.sqrt(np.mean(b**2))
    return bool(min(size) > STILL_DEG and np.mean(a * b) > SAME_CORRELATION * size[0] * size[1])


def without_copies(motions: Iterable[tuple[Motion, bool]]) -> Iterator[Motion]:
    """Yield the motions that may train and whose performance did not come before."""
    seen: list[NDArray[np.float64]] = []
    names: set[tuple[str, str]] = set()
    for motion, trains in motions:
        angles = elbows_deg(motion)
        called = (motion.source, motion.name)
        is_new = called not in names and not any(is_copy(angles, other) for other in seen)
        names.add(called)
        seen.append(angles)
        if trains and is_new and motion.duration_s >= SHORTEST_S:
            yield motion


def report(motions: dict[str, list[Motion]]) -> str:
    """Return a table by source: clips, minutes, shares of hands before and behind shoulders."""
    lines = [f"{'source':32s} clips  minutes  before  behind"]
    for source, clips in sorted(motions.items()):
        forward = np.concatenate([hands_in_chest(clip)[:, :, 0] for clip in clips])
        minutes = sum(clip.duration_s for clip in clips) / 60
        shares = 100 * np.mean(forward > 0), 100 * np.mean(forward < 0)
        lines.append(
            f"{source:32s} {len(clips):5d} {minutes:8.1f} {shares[0]:5.0f} % {shares[1]:5.0f} %"
        )
    return "\n".join(lines)


def main(words: Sequence[str] | None = None) -> None:
    """Collect, write and report."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--scripted", type=float, default=0.0, metavar="MINUTES")
    parser.add_argument("--gestures", type=float, default=0.0, metavar="MINUTES")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args(words)
    args.output.mkdir(parents=True, exist_ok=True)
    by_source: dict[str, list[Motion]] = defaultdict(list)
    rng = np.random.default_rng(args.seed)

    def keep(motion: Motion) -> None:
        motion.save(args.output / f"{motion.source}-{motion.name}.npz")
        by_source[motion.source].append(motion)

    for motion in without_copies(captured(args.folders)):
        keep(with_wrists(motion, rng) if has_stiff_wrists(motion) else motion)
    # The first number is part of the seed, so that motions stay the same.
    kinds: tuple[tuple[int, float, Callable[..., Motion]], ...] = (
        (0, args.scripted, scripted),
        (2, args.gestures, gestures),
    )
    for kind, minutes, draw in kinds:
        for number in range(round(60 * minutes / CLIP_S)):
            chance = np.random.default_rng((args.seed, number, kind))
            keep(draw(f"{number:04d}", CLIP_S, chance))
    print(report(by_source))


if __name__ == "__main__":
    main()
