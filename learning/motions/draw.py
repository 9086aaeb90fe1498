"""Draw stick figures of motions, to see that left, right and the directions are as named.

    python -m learning.motions.draw FILE... --output PICTURE

Every row shows one motion (a ``.npz`` file of learning.motions.collect): above from the front, so
that the person's left (red) is on the right of the picture, below from the person's left side, so
that the person looks to the left. Times go from left to right.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from learning.motions.figure import ends, figures
from learning.motions.motion import Motion, load
from learning.segments import PARENTS, SEGMENTS

Image = NDArray[np.uint8]
SCALE_PX, WIDTH_PX, HEIGHT_PX = 62.0, 130, 145
COLOURS = {"left": (30, 30, 210), "right": (200, 110, 20)}


def drawn(motion: Motion, times: int = 10) -> Image:
    """Return a picture (height, width, 3), BGR, of a motion at evenly spaced times."""
    chosen = np.linspace(0, len(motion) - 1, times).round().astype(int)
    at, tips = figures(motion), ends(motion)
    strip = np.full((2 * HEIGHT_PX, times * WIDTH_PX, 3), 255, dtype=np.uint8)
    for column, frame in enumerate(chosen):
        lines = [
            (SEGMENTS[i], at[frame, parent], at[frame, i])
            for i, parent in enumerate(PARENTS)
            if parent >= 0
        ]
        lines += [(name, at[frame, SEGMENTS.index(name)], tip[frame]) for name, tip in tips.items()]
        for row, axis in enumerate((1, 0)):
            sign = 1 if axis == 1 else -1
            for name, *line in lines:
                places = np.array(line) - np.array([*motion.places[frame, :2], 0])
                x = (column + 0.5) * WIDTH_PX + sign * SCALE_PX * places[:, axis]
                y = (row + 0.97) * HEIGHT_PX - SCALE_PX * places[:, 2]
                start, end = np.stack([x, y], axis=1).round().astype(int).tolist()
                colour = COLOURS.get(name.partition("_")[0], (60, 60, 60))
                cv2.line(strip, start, end, colour, 2, cv2.LINE_AA)
    label = f"{motion.source} {motion.name} {motion.duration_s:.0f} s"
    cv2.putText(strip, label, (4, 12), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (0, 0, 0), 1, cv2.LINE_AA)
    return strip


def main(words: Sequence[str] | None = None) -> None:
    """Draw the motions of the files that the command names."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--times", type=int, default=10, help="figures of each motion")
    args = parser.parse_args(words)
    rows = [drawn(load(path), args.times) for path in args.files]
    cv2.imwrite(str(args.output), np.concatenate(rows))


if __name__ == "__main__":
    main()
