"""Processor time of each step of ``cardbox track FILM``: ``python -m lab.benchmarks.film FILM``.

Every step counts the time of its thread, without that of the steps which it calls. Libraries get no
threads of their own, so that their time counts for the step that calls them.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import wraps
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import local
from typing import Any

import cv2

from cardbox_tracker.applications.drawing import video
from cardbox_tracker.commands import tracking
from cardbox_tracker.commands.main import main as cardbox
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.hand_network import HandNetwork
from cardbox_tracker.detectors.pose_network import Network, PoseNetwork
from cardbox_tracker.recordings import (
    detector_silhouettes,
    kept_detections,
    measured_scene,
    quality,
    result_table,
    video_reader,
)
from cardbox_tracker.search.doubt import Doubt
from cardbox_tracker.search.whole_body import WholeBodyFilter
from cardbox_tracker.segmentation.silhouettes import SilhouettePipeline
from cardbox_tracker.tracking.hands import HandReader
from cardbox_tracker.tracking.head import HeadTracker
from cardbox_tracker.tracking.legs import LegReader
from cardbox_tracker.tracking.session import Session
from cardbox_tracker.tracking.tracker import Tracker

STEPS: Mapping[str, Sequence[tuple[Any, str]]] = {
    "decoding": [(video_reader, "_next")],
    "resizing": [(SilhouettePipeline, "prepare")],
    "search for people, beside the network": [(PoseNetwork, "detected")],
    "points and mask, beside the network": [(PoseNetwork, "located")],
    "networks of people": [(Network, "__call__")],
    "identity of the person": [(PoseNetwork, "__call__")],
    "detections kept and read": [(kept_detections.KeptDetections, "__call__")],
    "silhouette and brightness": [(detector_silhouettes.DetectorSilhouetteSource, "frames")],
    "what is kept of the images": [(measured_scene, "watch")],
    "camera of the scene": [(tracking, "found_camera")],
    "bodies of the scene": [(measured_scene, "seen_person"), (measured_scene, "seen_people")],
    "assignment of people": [(Session, "track")],
    "frame": [(Tracker, "_frames_of")],
    "search": [(WholeBodyFilter, "look"), (WholeBodyFilter, "follow")],
    "refiner": [(WholeBodyFilter, "_refined")],
    "doubt": [(Doubt, "judge")],
    "place, faults, identity": [(Tracker, "track")],
    "head": [(HeadTracker, "see")],
    "legs": [(LegReader, "see")],
    "squares and angles of hands": [(HandReader, "see")],
    "network of hands": [(HandNetwork, "__call__")],
    "table": [(result_table, "row_of"), (result_table, "_text")],
    "summary": [(quality.Quality, "__call__")],
    "drawing": [(video, "draw_overlay")],
    "encoding": [(video, "_encoder")],
}
"""Functions, generators and contexts of a function of each step, with their owner and name."""
# Of these steps, all that they call is part.
_WHOLE = ("camera of the scene", "bodies of the scene", "drawing")
REST = "everything else"


class Clock:
    """Sums of the time of each step, s; a thread that waits takes no time."""

    def __init__(self) -> None:
        """Begin at 0."""
        self.spent_s = dict.fromkeys(STEPS, 0.0)
        self._thread = local()

    @contextmanager
    def of(self, step: str) -> Iterator[None]:
        """Context whose time, without that of inner contexts, belongs to a step."""
        outer = getattr(self._thread, "inner_s", [0.0])
        if outer is None:
            yield
            return
        inner = None if step in _WHOLE else [0.0]
        self._thread.inner_s = inner
        begun_s = time.thread_time()
        try:
            yield
        finally:
            spent_s = time.thread_time() - begun_s
            self.spent_s[step] += spent_s - (inner[0] if inner else 0.0)
            outer[0] += spent_s
            self._thread.inner_s = outer

    def timing(self, step: str, call: Callable[..., Any]) -> Callable[..., Any]:
        """Return ``call``, what it yields, or the function of its context, with the time taken."""

        @wraps(call)
        def timed(*given: Any, **named: Any) -> Any:
            with self.of(step):
                result = call(*given, **named)
            if isinstance(result, AbstractContextManager):
                return self._entered(step, result)
            return self._each(step, result) if isinstance(result, Iterator) else result

        return timed

    @contextmanager
    def _entered(self, step: str, context: AbstractContextManager[Any]) -> Iterator[Any]:
        with context as call:
            yield self.timing(step, call)

    def _each(self, step: str, items: Iterator[Any]) -> Iterator[Any]:
        while True:
            with self.of(step):
                item = next(items, self)
            if item is self:
                return
            yield item


@contextmanager
def _timed(clock: Clock) -> Iterator[None]:
    before = [(step, *one, getattr(*one)) for step, places in STEPS.items() for one in places]
    for step, owner, name, call in before:
        setattr(owner, name, clock.timing(step, call))
    try:
        yield
    finally:
        for _, owner, name, call in before:
            setattr(owner, name, call)


def measure_film(arguments: Sequence[str]) -> dict[str, float]:
    """Return the processor time of each step of ``cardbox track ARGUMENTS``, s.

    The second of two runs counts, since the first one loads compiled code.

    Raises:
        CardboxError: the command fails.
    """
    with TemporaryDirectory() as folder:
        cv2.setNumThreads(1)
        os.environ["OPENCV_FFMPEG_CAPTURE_OPTIONS"] = "threads;1"
        video._H264["threads"] = "1"
        given = ["track", *arguments, "--force", "--csv", str(Path(folder, "table.csv"))]
        for _ in range(2):
            clock, begun_s = Clock(), time.process_time()
            with _timed(clock):
                if cardbox(given):
                    raise CardboxError(f"cardbox {' '.join(given)} failed")
    spent_s = time.process_time() - begun_s
    return {**clock.spent_s, REST: spent_s - sum(clock.spent_s.values())}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("images", type=int, help="number of images of the film")
    given, arguments = parser.parse_known_args()
    spent_s = measure_film(arguments)
    total_s = sum(spent_s.values())
    for name, value_s in spent_s.items():
        print(f"{name:40} {1e3 * value_s / given.images:7.2f} ms {value_s / total_s:6.1%}")
    print(f"{'all':40} {1e3 * total_s / given.images:7.2f} ms")


if __name__ == "__main__":
    main()
