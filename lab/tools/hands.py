"""Figures of labelled hands: open against closed, and neither, at several sizes.

    python -m lab.tools.hands FOLDER

The folder has images and a ``hands.json`` with the boxes of hands and their open fingers. Images
are made smaller until the longer side of the box has the size. Around the box lies the square that
the network gets. A hand is open above 0.75, closed below 0.25, and neither between.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from cardbox_tracker.detectors.hand_network import HandNetwork
from cardbox_tracker.detectors.model_files import installed_hands
from cardbox_tracker.detectors.pose_network import Square
from cardbox_tracker.tracking.estimate import CLOSED, OPEN
from cardbox_tracker.tracking.hands import opened

SIZES_PX = (1000, 100, 60, 50, 40, 30, 25, 20, 17, 14, 10)
_SQUARE = 1.35
_ALL_OPEN = 5


def main() -> None:
    """Print a line for each size."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    network = HandNetwork(installed_hands())
    print("size px, hands, known, right of known open and closed, neither told, taken for open")
    for size_px in SIZES_PX:
        found = np.array(list(_hands(network, folder, size_px)))
        fingers, value = found.T
        known = np.isfinite(value)
        sure = known & np.isin(fingers, (0, _ALL_OPEN))
        some = known & ~np.isin(fingers, (0, _ALL_OPEN))
        right = (value > 0.5) == (fingers == _ALL_OPEN)
        neither = (value >= CLOSED) & (value <= OPEN)
        print(
            f"{size_px}, {len(found)}, {known.mean():.3f}, {_share(right[sure])}, "
            f"{_share(neither[some])}, {_share(value[some] > OPEN)}",
            flush=True,
        )


def _share(chosen: np.ndarray) -> str:
    return f"{chosen.mean():.3f}" if len(chosen) else "-"


def _hands(network: HandNetwork, folder: Path, size_px: float) -> Iterator[tuple[int, float]]:
    """Yield the number of open fingers of each hand, and how open it is found, or nan."""
    for image in json.loads((folder / "hands.json").read_text())["images"]:
        picture = np.asarray(cv2.imread(str(folder / image["file"])), np.uint8)
        for hand in image["hands"]:
            left, top, right, bottom = hand["box_px"]
            side = max(right - left, bottom - top)
            scale = min(1.0, size_px / side)
            smaller = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
            small = np.asarray(smaller, np.uint8)
            middle = scale * (left + right) / 2, scale * (top + bottom) / 2
            found = network(small, Square(*middle, _SQUARE * scale * side, 0.0))
            value = None if found is None else opened(found)
            yield hand["open_fingers"], np.nan if value is None else value


if __name__ == "__main__":
    main()
