"""Table of shape and place where a given number is wrong (``docs/evaluation/wrong-inputs.md``).

    python -m lab.tools.wrong_inputs SESSION... [--output docs/evaluation/wrong-inputs.md]

Each session is tracked with a detector's points and the first camera alone. Stature, distance and
pitch are given, of which one is wrong. The shape is wrong if a joint is off by more than 30 cm
relative to the middle of the shoulders, and the place if that middle is off by more than 30 cm.
Sessions with reference postures are also tracked with silhouettes alone, from the first one on.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from cardbox_tracker.common.files import write_file
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.person.skeleton import SHOULDERS, KeypointState
from cardbox_tracker.recordings.truth import beside_shoulders
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.search.doubt import FAR_M
from cardbox_tracker.tracking.estimate import TRACKING, Estimate
from cardbox_tracker.tracking.tracker import Tracker
from lab.evaluation.session import RecordedSession, load_session
from lab.evaluation.tracking import InputSelection, person_of, track_session

CASES = {
    "nothing": (1.0, 1.0, 0.0),
    "stature x 0.8": (0.8, 1.0, 0.0),
    "stature x 1.2": (1.2, 1.0, 0.0),
    "distance x 1.25": (1.0, 1.25, 0.0),
    "pitch + 10 degrees": (1.0, 1.0, 10.0),
}
"""What is wrong: factors of stature and distance, and degrees that are added to the pitch."""

OUTLINES = "nothing; outlines alone, also turned aside"
"""With silhouettes alone, three seeds, and the reference postures, in which somebody turns."""

HEADER = """# Wrong inputs

`make wrong-inputs DATA=FOLDER` makes this table: one camera, a detector's points, stature, distance
and pitch given, of which one is wrong. Shares in % of the images with truth. The *shape* is wrong
if a joint is off by more than 30 cm relative to the middle of the shoulders, the *place* if that
middle is off by more than 30 cm. [Place](../conventions.md#place) says what the states rest on.
*Told after*: seconds until a contradiction is reported; empty: never. The limits of the comparison
were chosen on these recordings, except `cmu_gestures`, so these are figures of a development set.
Recordings with reference postures have a row of silhouettes alone, from the front posture on, in
which the person turns aside. The man of `cmu_gestures` has long arms: by his points he is nearer
than he is, so a stature that is too large agrees with his distance.

| recording | wrong | `tracking` | of these shape wrong | place `tracked` | of these wrong \
| place wrong in all | mean chance of it | told after s |
|---|---|---|---|---|---|---|---|---|"""


def row_of(session: RecordedSession, wrong: str, detector: Detector | None) -> str:
    """Return a row of the table; without a detector, it is that of the silhouettes alone."""
    truth, body = session.truth, person_of(session.truth, *CASES.get(wrong, ()))
    seeds = (0, 1, 2) if detector is None else (0,)
    true_m = dict(zip(session.stamps_ns.tolist(), session.keypoints_m, strict=True))
    rows: list[tuple[bool, bool, bool, bool, float]] = []
    began_ns: list[int] = []
    told: list[float] = []

    def see(_: int, stamp_ns: int, found: Estimate, tracker: Tracker) -> None:
        if found.place is not None:
            began_ns.append(stamp_ns)
            if found.place.contradiction and not told:
                told.append((stamp_ns - began_ns[0]) / 1e9)
        if stamp_ns not in true_m or found.keypoints_m is None or found.place is None:
            return
        error_m = found.keypoints_m - true_m[stamp_ns]
        shape_m = np.linalg.norm(beside_shoulders(error_m[None])[0], axis=1).max()
        place_m = float(np.linalg.norm(error_m[list(SHOULDERS)].mean(axis=0)))
        is_sure = found.place.state is KeypointState.TRACKED
        wrongs = bool(shape_m > FAR_M), place_m > FAR_M
        rows.append((found.state == TRACKING, wrongs[0], is_sure, wrongs[1], found.place.chance))

    only = truth.cameras[0] if truth.cameras and len(truth.cameras) > 1 else None
    inputs = InputSelection(only, points=detector)
    track_session(session, default_preset(), seeds, inputs, see, body)
    tracking, shape, sure, place, chance = np.array(rows).T
    shares = [
        tracking.mean(),
        shape[tracking > 0].mean() if tracking.any() else np.nan,
        sure.mean(),
        place[sure > 0].mean() if sure.any() else np.nan,
        place.mean(),
        chance.mean(),
    ]
    cells = ["" if np.isnan(share) else f"{100 * share:.0f}" for share in shares]
    after = f"{told[0]:.1f}" if told else ""
    return f"| {session.name} | {wrong} | {' | '.join(cells)} | {after} |"


def rows(folders: list[Path]) -> Iterator[str]:
    """Yield the rows of sessions whose stature is known."""
    detector = Detector.installed()
    for folder in folders:
        session = load_session(folder)
        if session.truth.stature_m is not None:
            for wrong in CASES:
                yield row_of(session, wrong, detector)
        if session.truth.stature_m is not None and session.has_references:
            yield row_of(load_session(folder, postures=True), OUTLINES, None)


def main() -> None:
    """Print the table, and write it if asked to."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("sessions", nargs="+", type=Path)
    parser.add_argument("--output", type=Path)
    given = parser.parse_args()
    print(HEADER)
    lines = [HEADER]
    for row in rows(given.sessions):
        print(row, flush=True)
        lines.append(row)
    if given.output is not None:
        write_file(given.output, "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
