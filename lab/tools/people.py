"""Figures of sessions with several people: who was found, confused, hidden, and how exactly.

    python -m lab.tools.people SESSION... [--detector mediapipe]

A session has ``bag/`` and a ``ground_truth.json`` of format 2, whose ``people`` are a list. Each of
its cameras is tracked alone. Statures and the camera's pitch are given. In an image, each estimate
belongs to the person whose shoulders it is nearest to, if they are within 0.35 m sideways. Joints
are aligned by a similarity, see ``PA-MPJPE``.
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

from cardbox_tracker.commands.request import points_named
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.person.proportions import body_from_proportions
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES
from cardbox_tracker.recordings.recording import Segmentation, open_recording
from cardbox_tracker.recordings.silhouettes import TimeSpan
from cardbox_tracker.recordings.truth import SHOULDERS
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.tracking.estimate import TRACKING, Estimate
from cardbox_tracker.tracking.people import People
from lab.evaluation.metrics import align, distances_m

_WITHIN_M = 0.35
# Joints that must be seen and known to align the others.
_FEWEST_JOINTS = 4
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
    print("camera, person, images, found, exchanged, aligned cm, cm, hidden said, ms a person")
    for folder in options.sessions:
        truth = json.loads((folder / "ground_truth.json").read_text())
        for camera in truth.get("cameras", [truth["camera"]]):
            for line in _lines(folder, truth, camera, detector, given):
                print(f"{folder.name} {line}", flush=True)


def _lines(
    folder: Path, truth: Any, camera: Any, detector: Any, given: list[float] | None
) -> Iterator[str]:
    name, people = camera.get("name", "camera"), truth["people"]
    pitch_rad = float(np.radians(camera["pitch_down_deg"]))
    # The tracker numbers people as they come, and from left to right if they come together.
    as_numbered = sorted(people, key=lambda person: _comes(person, name))
    statures = given or [person["height"] for person in as_numbered]
    bodies = [body_from_proportions(one, None, camera_pitch_rad=pitch_rad) for one in statures]
    finder = detector._replace(people=len(people)) if isinstance(detector, Detector) else detector
    empty = next((one for one in truth["segments"] if one["name"] == "empty"), None)
    scene: Segmentation = finder if empty is None else TimeSpan(empty["start_s"], empty["end_s"])
    names = [name] if len(truth.get("cameras", ())) > 1 else []
    found: dict[int, list[Estimate]] = {}
    spent_s, images = time.process_time(), 0
    with open_recording(folder / "bag", scene, names, points=finder) as recording:
        tracked = People(bodies, recording.first.camera, default_preset(), count=len(people))
        for taken in recording.frames():
            results = tracked.track(taken.observations[0], taken.people)
            found[taken.stamp_ns] = [estimate for estimate, _ in results]
            images += 1
    ms = 1e3 * (time.process_time() - spent_s) / images / len(people)
    rows: list[list[tuple[int, float, float]]] = [[] for _ in people]
    counts, hidden = [0] * len(people), [[0, 0] for _ in people]
    for i, frame in enumerate(truth["frames"]):
        seen = [joints_of(person["frames"][i], name) for person in people]
        estimates = [one for one in found.get(frame["stamp_ns"], []) if one.posture is not None]
        for k, estimate in matched(seen, estimates):
            there = seen[k]
            assert there is not None and estimate.keypoints_m is not None
            known = np.isfinite(there[0]).all(axis=1)
            errors = np.nan, np.nan
            if known.sum() >= _FEWEST_JOINTS:
                pair = estimate.keypoints_m[known], there[0][known]
                errors = (
                    float(distances_m(align(*pair), pair[1]).mean()),
                    float(distances_m(*pair).mean()),
                )
            rows[k].append((estimate.person or 0, *errors))
            for joint in there[1]:
                states = estimate.keypoint_states
                is_sure = states is None or str(states[joint]) == "tracked"
                hidden[k][0] += 1
                hidden[k][1] += estimate.state != TRACKING or not is_sure
        for k, there in enumerate(seen):
            counts[k] += there is not None
    for k, (person, row) in enumerate(zip(people, rows, strict=True)):
        numbers = [one[0] for one in row]
        exchanged = sum(a != b for a, b in pairwise(numbers))
        aligned, absolute = (100 * float(np.nanmean([one[j] for one in row])) for j in (1, 2))
        yield (
            f"{name}, {person['name']}, {counts[k]}, {len(row)}, {exchanged}, {aligned:.1f}, "
            f"{absolute:.1f}, {hidden[k][1]} of {hidden[k][0]}, {ms:.0f}"
        )


def _comes(person: Any, camera: str) -> tuple[int, float]:
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
