"""What a camera that is covered, or silent, costs: ``python -m tools.covered_camera SESSION``.

A recorded session of several cameras is tracked as it is, and with one camera after the other
covered for some seconds in the middle: its image is black and everything in it foreground, or it is
silent. Printed are the images after which nobody was tracked, and the mean error of the keypoints
while that lasts and after it, in brackets that of the undisturbed run.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cardbox_tracker.estimation.config import default_preset
from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.evaluation.recorded.session import RecordedSession, load_session
from cardbox_tracker.evaluation.recorded.tracking import measured_body
from cardbox_tracker.recordings.recording import FrameSet, open_recording

KINDS = ("covered", "silent")
_SPANS = {"during": (None, 0.0), "1 s after": (0.0, 1.0), "1 to 4 s after": (1.0, 4.0)}


class Row(NamedTuple):
    """One camera disturbed in one way, means over the seeds.

    Attributes:
        camera: its name.
        kind: of ``KINDS``.
        lost: images after which the person was lost or nobody was there.
        errors_cm: disturbed and undisturbed error by span.
    """

    camera: str
    kind: str
    lost: int
    errors_cm: dict[str, tuple[float, float]]


def rows_of(folder: Path, lasts_s: float, seeds: int) -> Iterator[Row]:
    """Track a session disturbed in each way.

    Raises:
        CardboxError: it is no session of several cameras.
    """
    session = load_session(folder)
    truth = dict(zip(session.stamps_ns.tolist(), session.keypoints_m, strict=True))
    with open_recording(
        session.bag, session.spans["empty"], session.truth.cameras, session.extrinsics
    ) as source:
        bodies = [measured_body(session, source.first, seed) for seed in range(seeds)]
        offset_s = (session.truth.start_ns - source.first.start_ns) / 1e9
        frames = list(source.frames(session.start_s + offset_s))
        begin_s = (frames[0].time_s + frames[-1].time_s - lasts_s) / 2
        end_s = begin_s + lasts_s

        def errors(camera: int | None, kind: str, seed: int) -> tuple[dict[str, float], int]:
            tracker = Tracker(
                bodies[seed],
                source.first.camera,
                default_preset(),
                np.random.default_rng(seed),
                others=source.others,
            )
            off: dict[str, list[float]] = {span: [] for span in _SPANS}
            lost = 0
            for frame in frames:
                inside = camera is not None and begin_s <= frame.time_s < end_s
                estimate = _track(tracker, frame, camera if inside else None, kind)
                lost += estimate.keypoints_m is None
                for span, (first_s, last_s) in _SPANS.items():
                    after = begin_s if first_s is None else end_s + first_s
                    if (
                        after <= frame.time_s < end_s + last_s
                        and estimate.keypoints_m is not None
                        and frame.stamp_ns in truth
                    ):
                        away = estimate.keypoints_m - truth[frame.stamp_ns]
                        off[span].append(100 * float(np.linalg.norm(away, axis=1).mean()))
            return {span: float(np.mean(values)) for span, values in off.items()}, lost

        before = [errors(None, "", seed)[0] for seed in range(seeds)]
        for number, name in enumerate(source.names):
            for kind in KINDS:
                found = [errors(number, kind, seed) for seed in range(seeds)]
                yield Row(
                    name,
                    kind,
                    sum(lost for _, lost in found),
                    {
                        span: (
                            float(np.mean([one[span] for one, _ in found])),
                            float(np.mean([one[span] for one in before])),
                        )
                        for span in _SPANS
                    },
                )


def _track(tracker: Tracker, frame: FrameSet, camera: int | None, kind: str) -> Estimate:
    observations = frame.observations
    if camera is not None:
        one = observations[camera]
        silhouette = image = None
        if kind == "covered" and one.silhouette is not None and one.image is not None:
            silhouette, image = np.full_like(one.silhouette, 255), np.zeros_like(one.image)
        observations[camera] = replace(one, silhouette=silhouette, image=image)
    return tracker.track(observations)


def table(session: RecordedSession, rows: Iterator[Row]) -> str:
    """Return the rows as a table, cm with the undisturbed ones in brackets."""
    lines = [f"| `{session.name}` | lost images | " + " | ".join(_SPANS) + " |", "|---" * 5 + "|"]
    for row in rows:
        cells = [f"{off:.1f} ({was:.1f})" for off, was in row.errors_cm.values()]
        lines.append(f"| `{row.camera}` {row.kind} | {row.lost} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("session", type=Path, help="folder with bag/ and ground_truth.json")
    parser.add_argument("--seconds", type=float, default=5.0, help="how long it is covered")
    parser.add_argument("--seeds", type=int, default=3, help="runs")
    options = parser.parse_args()
    rows = rows_of(options.session, options.seconds, options.seeds)
    print(table(load_session(options.session), rows))


if __name__ == "__main__":
    main()
