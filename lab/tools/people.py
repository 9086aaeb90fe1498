"""Figures of sessions with several people: who was found, confused, hidden, and how exactly.

    python -m lab.tools.people SESSION... [--detector mediapipe]

A session has ``bag/`` and a ``ground_truth.json`` of format 2, whose ``people`` are a list. Each of
its cameras is tracked alone, and then all together, in the first one's frame. Statures and the
camera's pitch are given. In an image, each estimate belongs to the person whose shoulders it is
nearest to, if they are within 0.35 m sideways.
*Aligned*: the mean error of shoulders, elbows, and hands beside the middle of the shoulders. *Seen*
counts only joints that nobody covers. *More* is the processor time that each further person adds to
an image of one, network included.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from itertools import pairwise, permutations
from pathlib import Path
from typing import Any

import numpy as np

from cardbox_tracker.commands.tracking_request import points_named
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.person.model import body_from_proportions
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES, SHOULDERS
from cardbox_tracker.recordings.recording import RecordingRequest, Segmentation
from cardbox_tracker.recordings.silhouettes import TimeSpan
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.tracking.estimate import TRACKING, Estimate
from cardbox_tracker.tracking.session import Session
from cardbox_tracker.tracking.smoother import Smoother
from lab.evaluation.metrics import distances_m

_WITHIN_M = 0.35
# Area of a silhouette, of the whole one, from which a person counts as seen, px.
_LEAST_PX = 2000


def main() -> None:
    """Track the sessions, and print a line for each person."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("sessions", type=Path, nargs="+")
    parser.add_argument("--detector", default="mediapipe", help="mediapipe or none")
    parser.add_argument("--stature", help="by number of the person; default: those of the truth")
    options = parser.parse_args()
    detector = None if options.detector == "none" else points_named(options.detector)
    given = [float(one) for one in options.stature.split(",")] if options.stature else None
    print(
        "camera, person, images, found, all found %, exchanged, aligned cm, of seen cm, cm, ",
        end="",
    )
    print("uncertain %, hidden said, ms of one, ms more")
    for folder in options.sessions:
        truth = json.loads((folder / "ground_truth.json").read_text())
        cameras = truth.get("cameras", [truth["camera"]])
        for chosen in [[one] for one in cameras] + ([cameras] if len(cameras) > 1 else []):
            for line in _lines(folder, truth, chosen, detector, given):
                print(f"{folder.name} {line}", flush=True)


def _lines(
    folder: Path, truth: Any, cameras: list[Any], detector: Any, given: list[float] | None
) -> Iterator[str]:
    camera, people = cameras[0], truth["people"]
    name = camera.get("name", "camera")
    pitch_rad = float(np.radians(camera["pitch_down_deg"]))
    # The tracker numbers people as they come, and from left to right if they come together.
    as_numbered = sorted(people, key=lambda person: comes(person, name))
    statures = given or [person["height"] for person in as_numbered]
    bodies = [body_from_proportions(one, None, camera_pitch_rad=pitch_rad) for one in statures]
    empty = next((one for one in truth["segments"] if one["name"] == "empty"), None)
    names = [one["name"] for one in cameras if len(truth.get("cameras", ())) > 1]
    poses = folder / "extrinsics.yaml" if len(names) > 1 else None

    def tracked(count: int) -> tuple[dict[int, list[Estimate]], float]:
        """Return the estimates by stamp, and the time of an image, ms."""
        finder = detector._replace(people=count) if isinstance(detector, Detector) else detector
        scene: Segmentation = (
            finder if empty is None else TimeSpan(empty["start_s"], empty["end_s"])
        )
        spent_s, found = time.process_time(), dict[int, list[Estimate]]()
        with RecordingRequest(
            folder / "bag", scene, names, poses, points=finder
        ).open() as recording:
            others = recording.others
            session = Session(
                bodies, recording.first.camera, default_preset(), others=others, people=count
            )
            smoother = Smoother[int]()
            for taken in recording.frames():
                estimates = session.track(taken.observations)
                of = (tracker.body for tracker in session.trackers)
                found |= smoother.add(taken.stamp_ns, taken.stamp_ns, estimates, of)
            found |= smoother.finish()
        return found, 1e3 * (time.process_time() - spent_s) / len(found)

    (_, one_ms), (found, ms) = tracked(1), tracked(len(people))
    more_ms = (ms - one_ms) / max(len(people) - 1, 1)
    rows: list[list[tuple[int, float, float, float, bool]]] = [[] for _ in people]
    counts, hidden, all_seen, all_found = [0] * len(people), [[0, 0] for _ in people], 0, 0
    for i, frame in enumerate(truth["frames"]):
        seen = [joints_of(person["frames"][i], name) for person in people]
        estimates = [one for one in found.get(frame["stamp_ns"], []) if one.posture is not None]
        pairs = dict(matched(seen, estimates))
        all_seen += None not in seen
        all_found += None not in seen and len(pairs) == len(people)
        for k, there in enumerate(seen):
            if there is None:
                continue
            counts[k] += 1
            joints, covered = there
            hidden[k][0] += len(covered)
            if k not in pairs:
                continue
            estimate = pairs[k]
            assert estimate.keypoints_m is not None
            pair = estimate.keypoints_m, joints
            beside = [points - points[list(SHOULDERS)].mean(axis=0) for points in pair]
            is_clear = np.isin(np.arange(len(joints)), covered, invert=True)
            errors_m = distances_m(beside[0], beside[1])
            rows[k].append(
                (
                    estimate.person or 0,
                    _mean(errors_m),
                    _mean(errors_m[is_clear]),
                    _mean(distances_m(*pair)),
                    estimate.state != TRACKING,
                )
            )
            for joint in covered:
                states = estimate.keypoint_states
                is_sure = states is None or str(states[joint]) == "tracked"
                hidden[k][1] += estimate.state != TRACKING or not is_sure
    for k, (person, row) in enumerate(zip(people, rows, strict=True)):
        exchanged = sum(a[0] != b[0] for a, b in pairwise(row))
        cm = [f"{100 * float(np.nanmean([one[j] for one in row])):.1f}" for j in (1, 2, 3)]
        yield (
            f"{'+'.join(names) or name}, {person['name']}, {counts[k]}, {len(row)}, "
            f"{100 * all_found / max(all_seen, 1):.0f}, {exchanged}, {', '.join(cm)}, "
            f"{100 * np.mean([one[4] for one in row]):.0f}, {hidden[k][1]} of {hidden[k][0]}, "
            f"{one_ms:.0f}, {more_ms:.0f}"
        )


def _mean(errors_m: FloatArray) -> float:
    """Return the mean of the known errors; NaN if there are none."""
    known = errors_m[np.isfinite(errors_m)]
    return float(known.mean()) if len(known) else np.nan


def comes(person: Any, camera: str) -> tuple[int, float]:
    """Return the image in which a person first is in sight, and where; last if in none."""
    for number, frame in enumerate(person["frames"]):
        seen = joints_of(frame, camera)
        if seen is not None:
            x, _, z = np.nanmean(seen[0], axis=0).tolist()
            return number, x / z
    return len(person["frames"]), 0.0


def joints_of(frame: Any, camera: str) -> tuple[FloatArray, list[int]] | None:
    """Return the joints (6, 3), and which are covered; None if the person is not in sight."""
    there = frame.get("cameras", {}).get(camera)
    if there is None or there.get("full_mask_px", there["mask_px"]) < _LEAST_PX:
        return None
    unknown = [np.nan] * 3
    joints = np.array([there["joints_m"].get(name, unknown) for name in KEYPOINT_NAMES])
    covered = [i for i, name in enumerate(KEYPOINT_NAMES) if name in there["covered"]]
    return joints, covered


def matched(
    seen: list[tuple[FloatArray, list[int]] | None], estimates: list[Estimate]
) -> Iterator[tuple[int, Estimate]]:
    """Yield the people, by index, with the estimates that are nearest to them together."""
    there = [(k, one[0]) for k, one in enumerate(seen) if one is not None]
    if not there or not estimates:
        return

    def away_m(joints: FloatArray, estimate: Estimate) -> float:
        points = estimate.keypoints_m
        assert points is not None
        known = np.isfinite(joints).all(axis=1)
        rays = [one[:, :2] / one[:, 2:] for one in (points[known], joints[known])]
        return float(np.linalg.norm(rays[0] - rays[1], axis=1).mean() * joints[known, 2].mean())

    count = min(len(there), len(estimates))
    pairs = [
        list(zip(chosen, order, strict=True))
        for chosen in permutations(there, count)
        for order in permutations(estimates, count)
    ]
    best = min(pairs, key=lambda pair: sum(away_m(one[1], other) for one, other in pair))
    for (k, joints), estimate in best:
        middles = [
            np.nanmean(points[list(SHOULDERS)], axis=0)
            for points in (np.asarray(estimate.keypoints_m), joints)
        ]
        sideways = middles[0][:2] / middles[0][2] - middles[1][:2] / middles[1][2]
        if float(np.linalg.norm(sideways)) * middles[1][2] < _WITHIN_M:
            yield k, estimate


if __name__ == "__main__":
    main()
