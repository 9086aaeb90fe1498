"""What a frame of several cameras costs: ``python -m tools.two_camera_cost SESSION``.

A recorded session is tracked by its first camera alone and by all of them, in turn for some images.
Printed are the processor times, without and with cutting out the silhouettes, and their ratios.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import TypeVar

import numpy as np

from cardbox_tracker.estimation.config import default_preset
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.evaluation.recorded.session import load_session
from cardbox_tracker.evaluation.recorded.tracking import measured_body
from cardbox_tracker.recordings.recording import open_recording
from cardbox_tracker.vision.silhouettes import SilhouettePipeline

Result = TypeVar("Result")

# Images of a turn: enough that caches are warm for either.
_BLOCK = 20


def timed(spent: list[float], function: Callable[..., Result]) -> Callable[..., Result]:
    """Return the function, whose processor time in ms is appended to ``spent`` at each call."""

    def call(*given: object) -> Result:
        begin = time.process_time()
        result = function(*given)
        spent.append(1e3 * (time.process_time() - begin))
        return result

    return call


def costs_of(folder: Path, count: int) -> tuple[float, float, float]:
    """Return ms of a silhouette, of tracking with the first camera and with all of them.

    Raises:
        CardboxError: it is no session of several cameras.
    """
    session = load_session(folder)
    names, empty = session.truth.cameras, session.spans["empty"]
    cut: list[float] = []
    with open_recording(session.bag, empty, names, session.extrinsics) as source:
        body = measured_body(session, source.first, 0)
        offset_s = (session.truth.start_ns - source.first.start_ns) / 1e9
        spent: tuple[list[float], list[float]] = [], []
        one, several = (
            timed(to, Tracker(body, source.first.camera, default_preset(), others=o).track)
            for to, o in zip(spent, ((), source.others), strict=True)
        )
        plain = SilhouettePipeline.silhouette
        SilhouettePipeline.silhouette = timed(cut, plain)  # type: ignore[method-assign]
        try:
            frames = list(islice(source.frames(session.start_s + offset_s), count))
        finally:
            SilhouettePipeline.silhouette = plain  # type: ignore[method-assign]
    for begin in range(0, len(frames), _BLOCK):
        for track, cameras in ((one, 1), (several, len(names))):
            for frame in frames[begin : begin + _BLOCK]:
                track(frame.observations[:cameras])
    return float(np.median(cut)), float(np.median(spent[0])), float(np.median(spent[1]))


def main() -> None:
    """Print the times and their ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("session", type=Path, help="folder with bag/ and ground_truth.json")
    parser.add_argument("--images", type=int, default=200, help="how many of each camera")
    options = parser.parse_args()
    cameras = len(load_session(options.session).truth.cameras)
    cut, one, several = costs_of(options.session, options.images)
    print(f"silhouette {cut:.1f} ms, posture {one:.1f} ms, of {cameras} cameras {several:.1f} ms")
    whole = (cameras * cut + several) / (cut + one)
    print(
        f"from the image to the posture {whole:.2f} times, without silhouettes {several / one:.2f}"
    )


if __name__ == "__main__":
    main()
