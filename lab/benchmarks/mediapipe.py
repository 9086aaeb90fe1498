"""Time of ``cardbox track FILM`` beside that of MediaPipe Pose for the same images.

``python -m lab.benchmarks.mediapipe --python OTHER/bin/python`` prints the ratios; ``OTHER`` is an
environment with ``pip install mediapipe==0.10.21``, whose versions of packages are not those of
this one. MediaPipe's time is that of ``process`` on each decoded image with its default network;
that of ``cardbox track`` is all in all: decoding, tracking and writing, with compiled code loaded.
Both may use all cores, and take turns, so that other load on the machine changes the ratios little.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import cardbox_tracker.start  # noqa: F401  # sets threads as for the programs, before numpy comes

# isort: split
import cv2
import numpy as np

from cardbox_tracker.applications import demo
from cardbox_tracker.applications.drawing import video
from cardbox_tracker.commands.main import main as cardbox
from cardbox_tracker.common.errors import CardboxError
from lab.benchmarks.film import GIVEN

RUNS = {"one person": (), "with overlay and hands": ("--hands", "--video")}
"""Options of each run."""

_PROCESS = """
import json, sys, time
import cv2, mediapipe
capture, images = cv2.VideoCapture(sys.argv[1]), []
while (read := capture.read())[0]:
    images.append(cv2.cvtColor(read[1], cv2.COLOR_BGR2RGB))
with mediapipe.solutions.pose.Pose() as pose:
    pose.process(images[0])
    begun_s, spent_s = time.monotonic(), time.process_time()
    for image in images:
        pose.process(image)
    print(json.dumps([time.monotonic() - begun_s, time.process_time() - spent_s, len(images)]))
"""


def enlarged(path: Path) -> None:
    """Write the film of ``cardbox demo`` in 1280x720, with its borders repeated at the sides."""
    capture = cv2.VideoCapture(str(Path(demo.__file__).with_name("film.mp4")))
    with video.video_file(path, 30.0) as add:
        while (read := capture.read())[0]:
            height, width = read[1].shape[:2]
            size = round(720 * width / height / 2) * 2, 720
            large = cv2.resize(read[1], size, interpolation=cv2.INTER_CUBIC)
            aside = (1280 - size[0]) // 2
            large = cv2.copyMakeBorder(large, 0, 0, aside, aside, cv2.BORDER_REPLICATE)
            add(np.asarray(large, np.uint8))


def of_mediapipe(python: str, film: Path) -> tuple[float, float, int]:
    """Return the time and the processor time of MediaPipe for a film, s, and its images."""
    done = subprocess.run([python, "-c", _PROCESS, str(film)], capture_output=True, text=True)
    if done.returncode:
        raise CardboxError(f"{python} has no MediaPipe that runs: {done.stderr.strip()[-300:]}")
    wall_s, spent_s, images = json.loads(done.stdout.splitlines()[-1])
    return wall_s, spent_s, images


def of_cardbox(arguments: Sequence[str]) -> tuple[float, float]:
    """Return the time and the processor time of a command, s."""
    begun_s, from_s = time.monotonic(), time.process_time()
    if cardbox(arguments):
        raise CardboxError(f"cardbox {' '.join(arguments)} failed")
    return time.monotonic() - begun_s, time.process_time() - from_s


def main() -> None:
    """Measure and print the ratios."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("film", type=Path, nargs="?", help="by default that of 'cardbox demo'")
    parser.add_argument("--python", default=sys.executable, help="interpreter with mediapipe")
    parser.add_argument("--turns", type=int, default=3)
    given = parser.parse_args()
    with TemporaryDirectory() as folder:
        film = given.film or Path(folder, "film.mp4")
        if given.film is None:
            enlarged(film)
        track = ["track", str(film), *GIVEN, "--csv", str(Path(folder, "film.csv")), "--force"]
        overlay = str(Path(folder, "overlay.mp4"))
        commands = {
            name: [*track, *options, *([overlay] if options else [])]
            for name, options in RUNS.items()
        }
        for command in commands.values():
            of_cardbox(command)
        ours, theirs = dict[str, list[tuple[float, float]]](), list[tuple[float, float]]()
        images = 0
        for _ in range(given.turns):
            *spent, images = of_mediapipe(given.python, film)
            theirs.append((spent[0], spent[1]))
            for name, command in commands.items():
                ours.setdefault(name, []).append(of_cardbox(command))
    peer = np.array(theirs)
    wall_ms, spent_ms = 1e3 * np.median(peer, axis=0) / images
    print(f"MediaPipe, process: {wall_ms:.1f} ms an image, {spent_ms:.1f} ms of processor time")
    for name, each in ours.items():
        wall_ms, spent_ms = 1e3 * np.median(each, axis=0) / images
        ratios = np.array(each) / peer
        print(
            f"cardbox track, {name}: {wall_ms:.1f} ms an image, {spent_ms:.1f} ms of processor "
            f"time; ratios {np.median(ratios[:, 0]):.2f} ({ratios[:, 0].min():.2f} to "
            f"{ratios[:, 0].max():.2f}) and {np.median(ratios[:, 1]):.2f}"
        )


if __name__ == "__main__":
    main()
