"""Whether wrong extrinsics are told: ``python -m tools.turned_cameras SESSION``.

A recorded session of two cameras is tracked with the extrinsics of the second one turned about each
of that camera's axes, both ways. Printed is by how many degrees ``Tracker.agreement`` says that it
is turned, aside and about its own axis, and whether that is told.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from cardbox_tracker.estimation.camera_pose import N_POSE, moved_by
from cardbox_tracker.estimation.config import default_preset
from cardbox_tracker.estimation.cost.view import OtherCamera
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.evaluation.recorded.session import load_session
from cardbox_tracker.evaluation.recorded.tracking import measured_body
from cardbox_tracker.recordings.recording import open_recording

_AXES = ("up or down", "about the vertical", "about its own axis")


def found_of(folder: Path, degrees: float, seed: int) -> Iterator[tuple[str, float, float, bool]]:
    """Yield how the camera is turned, what is found in degrees, its roll, and whether it is told.

    Raises:
        CardboxError: it is no session of several cameras.
    """
    session = load_session(folder)
    names, empty = session.truth.cameras[:2], session.spans["empty"]
    with open_recording(session.bag, empty, names, session.extrinsics) as source:
        body = measured_body(session, source.first, seed)
        offset_s = (session.truth.start_ns - source.first.start_ns) / 1e9
        frames = list(source.frames(session.start_s + offset_s))
        other = source.others[0]
        for axis, name in enumerate(_AXES):
            for sign in (1.0, -1.0) if degrees else (1.0,):
                change = np.zeros(N_POSE)
                change[axis] = sign * np.radians(degrees)
                turned = OtherCamera(other.camera, moved_by(other.extrinsics, change))
                rng = np.random.default_rng(seed)
                tracker = Tracker(body, source.first.camera, default_preset(), rng, others=[turned])
                agreement = tracker.agreement
                assert agreement is not None
                for frame in frames:
                    tracker.track(frame.observations)
                    if agreement.is_due:
                        agreement.check()
                agreement.check(is_last=True)
                found, rolled = agreement.turned_deg[0], agreement.rolled_deg[0]
                yield (
                    f"{sign * degrees:+g} degrees {name}",
                    np.nan if found is None else found,
                    np.nan if rolled is None else rolled,
                    bool(agreement.remarks(["it"])),
                )
            if not degrees:
                return


def main() -> None:
    """Print a line for each turn."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("session", type=Path, help="folder with bag/ and ground_truth.json")
    parser.add_argument("--degrees", type=float, nargs="+", default=[0.0, 1.0, 2.0, 4.0])
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    for degrees in options.degrees:
        for turn, found, rolled, is_told in found_of(options.session, degrees, options.seed):
            told = "told" if is_told else "not told"
            print(f"{turn}: {found:.2f} degrees, rolled {rolled:.2f}, {told}", flush=True)


if __name__ == "__main__":
    main()
