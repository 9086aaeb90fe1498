"""Track recorded sessions with ground truth and write what the corrector sees in them.

python -m learning.sessions OUTPUT SESSION... [--detector] [--corrected] [--seeds N] [--jobs N]

The files are like those of simulated recordings, so that networks are checked on sessions without
tracking them again. The family is ``real`` for films of people, and ``kit`` for rendered sessions.
"""

from __future__ import annotations

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np

from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.estimation.filtering.whole_body import WholeBodyFilter
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.evaluation.recorded.session import load_session
from cardbox_tracker.evaluation.recorded.tracking import InputSelection, track_session
from cardbox_tracker.recordings.detector import Detector
from learning.command_line import run
from learning.recorder import Recorder, recording_config
from learning.samples import Image, Origin, Samples


def samples_of(folder: Path, seed: int, detector: Detector | None, is_corrected: bool) -> Samples:
    """Track the first camera of a session with one seed."""
    session = load_session(folder)
    truth = zip(session.keypoints_m, session.torso_rad, strict=True)
    wanted = dict(zip(session.stamps_ns.tolist(), truth, strict=True))
    unknown = np.full((6, 3), np.nan), np.full(3, np.nan)
    images: list[Image] = []

    def keep(_: int, stamp_ns: int, __: Estimate, tracker: Tracker) -> None:
        assert isinstance(tracker.filter, WholeBodyFilter)
        recorder = tracker.filter.refine.corrector
        assert isinstance(recorder, Recorder)
        seen = recorder.take()
        if seen is not None:
            true_m, torso_rad = wanted.get(stamp_ns, unknown)
            images.append(Image(seen, true_m, torso_rad, stamp_ns))

    cameras = session.truth.cameras
    inputs = InputSelection(only=cameras[0] if len(cameras) > 1 else None, points=detector)
    track_session(session, recording_config(False, is_corrected), (seed,), inputs, keep)
    if not images:
        raise SystemExit(f"{folder}: nobody was tracked")
    family = "kit" if session.has_references else "real"
    fps = 1e9 / float(np.median(np.diff([one.stamp_ns for one in images])))
    origin = Origin(
        *(family, session.name, session.name, session.name, session.has_references),
        *(True, detector is not None, False, fps),
    )
    return Samples.of(origin, images, float(np.radians(session.truth.pitch_deg)))


def write(
    task: tuple[Path, int], output: Path, detector: Detector | None, is_corrected: bool
) -> str:
    """Track a session with a seed, write the samples, and return the name of the file."""
    folder, seed = task
    points = "" if detector is None else "_points"
    path = output / f"{folder.name}{points}_{seed}.npz"
    samples_of(folder, seed, detector, is_corrected).save(path)
    return path.name


def main(args: list[str] | None = None) -> int:
    """Track all sessions."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("output", type=Path)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    parser.add_argument("--detector", action="store_true", help="give the tracker points, too")
    parser.add_argument("--corrected", action="store_true", help="use the package's corrector")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args(args)
    given.output.mkdir(parents=True, exist_ok=True)
    detector = Detector.installed() if given.detector else None
    tasks = [(folder, seed) for folder in given.sessions for seed in range(given.seeds)]
    with ProcessPoolExecutor(given.jobs) as pool:
        task = partial(write, output=given.output, detector=detector, is_corrected=given.corrected)
        for name in pool.map(task, tasks):
            print(name, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(run(main))
