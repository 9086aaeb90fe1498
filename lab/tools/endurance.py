"""Run the tracker for long and report memory and latency over time.

``python -m lab.tools.endurance day`` tracks a day of images at 30 Hz through the core, without
nodes; ``hour`` runs the background and tracker nodes live at 15 Hz while the person comes and goes
and the light changes; ``eight`` runs trackers in eight namespaces and compares what was sent,
answered and reported. Each writes ``endurance-RUN.json`` while it runs, and at its end, also by Ctrl-C, the page
``endurance.md`` and its picture.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

import numpy as np

from cardbox_tracker.common import interrupts
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.search.config import paper_preset
from cardbox_tracker.tracking.estimate import TRACKING
from cardbox_tracker.tracking.observation import Observation
from cardbox_tracker.tracking.tracker import Tracker
from lab.tools.endurance_record import Record, resources_of, write_page
from lab.tools.fault_scene import Person, S

RATE_HZ = 30
DAY = 24 * 3600 * RATE_HZ
STEP = 20_000
# Eight seconds of motion, five times, and ten seconds of an empty room.
MOVING, ROUND = 8 * RATE_HZ, 50 * RATE_HZ
BACK = RATE_HZ


def day(record: Record, images: int) -> None:
    """Track ``images`` silhouettes of a person who comes and goes, by the preset ``paper``.

    Raises:
        CardboxError: a posture is not finite.
    """
    person = Person()
    seen = [person.silhouette(2.0 + number / RATE_HZ) for number in range(MOVING)]
    nobody = np.zeros_like(seen[0])
    tracker = Tracker(person.body, person.camera, paper_preset(), np.random.default_rng(0))
    took_s, ious, start_s = list[float](), list[float](), time.perf_counter()
    counts = record.counts
    for number in range(images):
        within = number % ROUND
        is_there = within < 5 * MOVING
        shown = seen[within % MOVING] if is_there else nobody
        begin_s = time.perf_counter()
        estimate = tracker.track(Observation(shown, stamp_ns=S + number * S // RATE_HZ))
        took_s.append(time.perf_counter() - begin_s)
        if is_there:
            counts["images with the person"] += 1
            counts["of these `tracking`"] += estimate.state == TRACKING
            ious.append(estimate.iou or 0.0)
            if within == BACK:
                counts["times the person came"] += 1
                counts["times tracked a second later"] += estimate.state == TRACKING
        else:
            counts["images of an empty room"] += 1
            counts["of these with a posture"] += estimate.posture is not None
        if estimate.posture is not None and not np.isfinite(estimate.posture).all():
            raise CardboxError(f"the posture of image {number} is not finite")
        if (number + 1) % STEP == 0 or number + 1 == images:
            passed_s = time.perf_counter() - start_s
            resources = {"core": resources_of(os.getpid())}
            record.add(passed_s, number + 1, took_s, resources, iou=float(np.mean(ious or [0.0])))
            print(f"{number + 1:,} of {images:,} images, {passed_s:.0f} s", flush=True)
            took_s, ious = [], []


ABOUT = {
    "day": "A day at 30 Hz in simulated time, offline: 320x240, preset `paper` (600 particles); "
    "the person waves for 40 s and is away for 10 s.",
    "hour": "The nodes `background` and `tracker` (preset `default`) live at 15 Hz, 320x240; the "
    "person waves for 40 s and is away for 10 s; clouds change the light by 15 % within four "
    "minutes, and a lamp by 8 % every seven.",
    "eight": "Eight namespaces with a node `tracker` each (preset `default`), 15 silhouettes of "
    "320x240 a second each, from one process, on this machine's cores.",
}
SECONDS = {"hour": 3600.0, "eight": 150.0}


def main(arguments: list[str] | None = None) -> int:
    """Run, write the page; an interrupted run is written as well."""
    parser = argparse.ArgumentParser(prog="endurance", description=__doc__)
    parser.add_argument("run", choices=(*ABOUT, "page"), help="'page' writes the page alone")
    parser.add_argument("--images", type=int, default=DAY, help="of 'day'")
    parser.add_argument("--seconds", type=float, help="of 'hour' and 'eight'")
    parser.add_argument("--output", type=Path, default=Path("docs/evaluation"))
    parser.add_argument("--image", type=Path, default=Path("docs/images/endurance.png"))
    given = parser.parse_args(arguments)
    if given.run == "page":
        write_page(given.output, given.image)
        return 0
    path = given.output / f"endurance-{given.run}.json"
    seconds = given.seconds or SECONDS.get(given.run, 0.0)
    wanted, unit = (given.images, "images") if given.run == "day" else (seconds, "s")
    record = Record(path, given.run, ABOUT[given.run], wanted, unit)
    try:
        with interrupts.raised():
            if given.run == "day":
                day(record, given.images)
            else:
                # The core runs without ROS.
                from lab.tools import endurance_live

                getattr(endurance_live, given.run)(record, seconds)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
    if record.samples:
        write_page(given.output, given.image)
    return 0


if __name__ == "__main__":
    sys.exit(main())
