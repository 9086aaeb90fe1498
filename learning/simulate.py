"""Simulate recordings and write what the learned parts see in them.

python -m learning.simulate OUTPUT --count N --motions FOLDER [--rocketbox FOLDER]
                            [--makehuman FOLDER] [--first K] [--measured SHARE]
                            [--points SHARE] [--corrected] [--jobs N]

Each recording has a random body of one of the families, a random excerpt of a motion, a random
camera, and random faults of its silhouettes; see docs/research/learning.md. Recording K is the same
for the same folders, whatever ``--first`` and ``--count`` are.
"""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from learning.bodies import FAMILIES, draw
from learning.command_line import run
from learning.motions.library import draw_motion
from learning.recording import POINTS, simulate

SEED = 28
# Length of a recording, s.
SECONDS = 8.0, 18.0


@dataclass(frozen=True)
class Folders:
    """Folders of the motions, and of the families of bodies by name."""

    motions: Path
    bodies: dict[str, Path]


@dataclass(frozen=True)
class Ways:
    """How people are tracked: shares of measured ones and of those with points, and a corrector."""

    measured: float = 0.6
    points: float = POINTS
    is_corrected: bool = False


def write(number: int, folders: Folders, output: Path, ways: Ways) -> str:
    """Simulate a recording, write its samples, and return a line about it."""
    rng = np.random.default_rng((SEED, number))
    body = draw(rng, list(folders.bodies), folders.bodies)
    motion = draw_motion(rng, folders.motions, float(rng.uniform(*SECONDS)))
    is_measured = bool(rng.random() < ways.measured)
    samples = simulate(body, motion, rng, is_measured, ways.is_corrected, ways.points)
    if samples is None:
        return f"{number} {body.name} {motion.name}: seldom tracked, left out"
    samples.save(output / f"{number:05d}.npz")
    off_m = samples.found_m - samples.true_m
    aligned_m = off_m - off_m[:, [0, 3]].mean(axis=1, keepdims=True)
    errors = (100.0 * float(np.linalg.norm(one, axis=2).mean()) for one in (off_m, aligned_m))
    return "{} {} {} {:.1f} {:.1f}".format(number, body.name, motion.name, *errors)


def main(args: list[str] | None = None) -> int:
    """Simulate all recordings."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", type=Path)
    parser.add_argument("--count", type=int, required=True)
    parser.add_argument("--first", type=int, default=0, help="number of the first recording")
    parser.add_argument("--motions", type=Path, required=True)
    for family in FAMILIES:
        parser.add_argument(f"--{family}", type=Path, help="folder of this family of bodies")
    parser.add_argument(
        "--measured", type=float, default=0.6, help="share of measured people (default: 0.6)"
    )
    parser.add_argument(
        "--points",
        type=float,
        default=POINTS,
        help=f"share of measured people with points of a detector (default: {POINTS})",
    )
    parser.add_argument("--corrected", action="store_true", help="use the package's corrector")
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args(args)
    bodies = {name: path for name in FAMILIES if (path := getattr(given, name)) is not None}
    if not bodies:
        parser.error(f"give a folder of bodies: {' or '.join(f'--{name}' for name in FAMILIES)}")
    folders = Folders(given.motions, bodies)
    given.output.mkdir(parents=True, exist_ok=True)
    numbers = range(given.first, given.first + given.count)
    with ProcessPoolExecutor(given.jobs) as pool:
        task = partial(
            write,
            folders=folders,
            output=given.output,
            ways=Ways(given.measured, given.points, given.corrected),
        )
        for line in pool.map(task, numbers):
            print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(run(main))
