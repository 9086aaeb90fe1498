"""Processor time of each step of ``cardbox track FILM``.

``python -m lab.benchmarks.film`` measures it and replaces it in ``docs/benchmarks.json`` and
``docs/benchmarks.md``.

Every step counts the time of its thread, without that of the steps which it calls. Libraries get no
threads of their own, so that their time counts for the step that calls them.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import wraps
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import local
from typing import Any
from unittest.mock import patch

import cardbox_tracker.start  # noqa: F401  # sets threads as for the programs, before numpy comes

# isort: split
import cv2
import numpy as np

from cardbox_tracker.applications import demo
from cardbox_tracker.applications.drawing import video
from cardbox_tracker.commands import scene
from cardbox_tracker.commands.main import main as cardbox
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.detector import KeptDetections
from cardbox_tracker.detectors.hand_network import HandNetwork
from cardbox_tracker.detectors.pose_network import Network, PoseNetwork
from cardbox_tracker.recordings import result_table, video_reader
from cardbox_tracker.recordings.other_silhouettes import DetectorSilhouetteSource
from cardbox_tracker.recordings.track import Quality
from cardbox_tracker.search.doubt import Doubt
from cardbox_tracker.search.whole_body import WholeBodyFilter
from cardbox_tracker.segmentation.silhouettes import SilhouettePipeline
from cardbox_tracker.tracking.hands import HandReader
from cardbox_tracker.tracking.head import HeadTracker
from cardbox_tracker.tracking.legs import LegReader
from cardbox_tracker.tracking.session import Session
from cardbox_tracker.tracking.tracked_camera import TrackedCamera
from cardbox_tracker.tracking.tracker import Tracker
from lab.benchmarks.report import replace_part
from lab.evaluation.results import commit

STEPS: Mapping[str, Sequence[tuple[Any, str]]] = {
    "decoding": [(video_reader, "_next")],
    "resizing": [(SilhouettePipeline, "prepare")],
    "search for people, beside the network": [(PoseNetwork, "detected")],
    "points and mask, beside the network": [(PoseNetwork, "located")],
    "networks of people": [(Network, "__call__")],
    "identity of the person": [(PoseNetwork, "__call__")],
    "detections kept and read": [(KeptDetections, "__call__")],
    "silhouette": [(DetectorSilhouetteSource, "frames")],
    "what is kept of the images": [(scene, "watch")],
    "camera of the scene": [(scene, "found_camera")],
    "bodies of the scene": [(scene, "seen_person"), (scene, "seen_people")],
    "assignment of people": [(Session, "track")],
    "frame": [(TrackedCamera, "frame")],
    "search": [(WholeBodyFilter, "look"), (WholeBodyFilter, "follow")],
    "refiner": [(WholeBodyFilter, "_refined")],
    "doubt": [(Doubt, "judge")],
    "place, faults, identity": [(Tracker, "track")],
    "head": [(HeadTracker, "see")],
    "legs": [(LegReader, "see")],
    "squares and angles of hands": [(HandReader, "see")],
    "network of hands": [(HandNetwork, "__call__")],
    "table": [(result_table, "row_of"), (result_table, "_text")],
    "summary": [(Quality, "__call__")],
    "drawing": [(video, "draw_overlay")],
    "encoding": [(video, "_encoder")],
}
"""Functions, generators and contexts that yield a function, of each step: owner and name."""
# Of these steps, all that they call is part.
_WHOLE = ("camera of the scene", "bodies of the scene", "drawing", "network of hands")
REST = "everything else"
RUNS: Mapping[str, tuple[int, Sequence[str]]] = {
    "one person": (1, ()),
    "with `--hands --video`": (1, ("--hands", "--video", "MP4")),
    "two people": (2, ("--people", "2")),
}
"""People in the film, and options of each run."""
GIVEN = ("--fov", "60", "--stature", "1.72", "--detector", "mediapipe")
"""Options of all runs."""


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


def measure_films() -> dict[str, Any]:
    """Return the steps of each of ``RUNS``, ms an image, and images a second of the whole run.

    The film is that of ``cardbox demo``, enlarged to the size of usual films; two people are the
    same film twice, side by side.
    """
    cv2.setNumThreads(1)
    os.environ["OPENCV_FFMPEG_CAPTURE_OPTIONS"] = "threads;1"
    video._H264["threads"] = "1"
    found: dict[str, Any] = {"commit": commit()}
    with TemporaryDirectory() as folder:
        for name, (people, options) in RUNS.items():
            film, overlay = Path(folder, f"{people}.mp4"), str(Path(folder, "overlay.mp4"))
            images = _enlarged(Path(demo.__file__).with_name("film.mp4"), film, people)
            given = ["track", str(film), *GIVEN, *(overlay if o == "MP4" else o for o in options)]
            given += ["--force", "--csv", str(Path(folder, "table.csv"))]
            spent_s, whole_s = _measured(given)
            steps = {step: 1e3 * value_s / images for step, value_s in spent_s.items()}
            found[name] = {"hz": images / whole_s, "steps_ms": steps}
    return found | {"load": os.getloadavg()[1]}


def _enlarged(source: Path, film: Path, people: int) -> int:
    """Write the film, and return its number of images."""
    capture, images = cv2.VideoCapture(str(source)), 0
    # Cameras compress better than overlays are, so their films take longer to decode.
    with patch.dict(video._H264, preset="superfast"), video.video_file(film, 30.0) as add:
        while (read := capture.read())[0]:
            wide = np.hstack([read[1]] * people)
            large = cv2.resize(wide, (1280, 960 // people), interpolation=cv2.INTER_CUBIC)
            add(np.asarray(large, np.uint8))
            images += 1
    return images


def _measured(arguments: Sequence[str]) -> tuple[dict[str, float], float]:
    """Return the processor time of each step of a command, and the time that it takes, s.

    The second of two runs counts, since the first one loads compiled code.
    """
    for _ in range(2):
        clock, begun_s, from_s = Clock(), time.process_time(), time.monotonic()
        with _timed(clock):
            if cardbox(arguments):
                raise CardboxError(f"cardbox {' '.join(arguments)} failed")
    whole_s, spent_s = time.monotonic() - from_s, time.process_time() - begun_s
    return {**clock.spent_s, REST: spent_s - sum(clock.spent_s.values())}, whole_s


if __name__ == "__main__":
    replace_part("film", measure_films, __doc__)
