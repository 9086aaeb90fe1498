"""Figures of measured legs: how exact hips, knees and ankles are, and how many are ``tracked``.

    python -m lab.tools.legs SESSION... [--stature M,M]

A session is as for :mod:`.people`, with hips, knees and ankles in its truth. Each camera is tracked
alone; statures and the camera's pitch are given. Of hips, knees and ankles that are ``tracked`` and
not covered, *place* is the mean error, *shape* that after both skeletons are shifted to the middle
of their shoulders, and *legs* after a shift to the middle of the hips, without the hips. The
network is the detector's points in space, which have no metric place. *Knee* is the error of its
bend: the root of the mean square, and the mean. *Upper* is the mean error of shoulders, elbows and
hands. People are numbered from left to right if they come together, and statures are given in this
order.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from cardbox_tracker.commands.tracking_request import points_named
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.image_points import LEG_POINT_NAMES, POINT_INDEX, ImagePoints
from cardbox_tracker.person.legs import LEG_KEYPOINT_NAMES
from cardbox_tracker.person.model import body_from_proportions
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES
from cardbox_tracker.recordings.recording import RecordingRequest, Segmentation
from cardbox_tracker.recordings.silhouettes import TimeSpan
from cardbox_tracker.search.config import default_preset
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.session import Session
from lab.tools.people import joints_of, matched

_HIPS, _REST = [0, 3], [1, 2, 4, 5]
_SHOULDERS = [0, 3]


def main() -> None:
    """Track the sessions, and print a line for each person."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("sessions", type=Path, nargs="+")
    parser.add_argument("--stature", help="by number of the person; default: those of the truth")
    options = parser.parse_args()
    given = [float(one) for one in options.stature.split(",")] if options.stature else None
    print(
        "camera, person, images, tracked, cm: place, shape, legs; network: shape, legs; "
        "upper; knee degrees: rms, too bent by"
    )
    for folder in options.sessions:
        truth = json.loads((folder / "ground_truth.json").read_text())
        for camera in truth.get("cameras", [truth["camera"]]):
            for line in _lines(folder, truth, camera, given):
                print(f"{folder.name} {line}", flush=True)


def _lines(folder: Path, truth: Any, camera: Any, given: list[float] | None) -> Iterator[str]:
    name, people = camera.get("name", "camera"), truth["people"]
    pitch_rad = float(np.radians(camera["pitch_down_deg"]))
    statures = given or [person["height"] for person in people]
    bodies = [body_from_proportions(one, None, camera_pitch_rad=pitch_rad) for one in statures]
    finder = points_named("mediapipe")
    assert isinstance(finder, Detector)
    finder = finder._replace(people=len(people))
    empty = next((one for one in truth["segments"] if one["name"] == "empty"), None)
    scene: Segmentation = finder if empty is None else TimeSpan(empty["start_s"], empty["end_s"])
    names = [name] if len(truth.get("cameras", ())) > 1 else []
    found: dict[int, list[tuple[Estimate, ImagePoints | None]]] = {}
    with RecordingRequest(folder / "bag", scene, names, points=finder).open() as recording:
        tracked = Session(bodies, recording.first.camera, default_preset(), people=len(people))
        for taken in recording.frames():
            there = found.setdefault(taken.stamp_ns, [])
            for number, estimate in enumerate(tracked.track(taken.observations), 1):
                there.append((estimate, tracked.points_of(number)))
    rows: list[list[FloatArray]] = [[] for _ in people]
    for i, frame in enumerate(truth["frames"]):
        seen_people = [joints_of(person["frames"][i], name) for person in people]
        both = {id(one[0]): one for one in found.get(frame["stamp_ns"], [])}
        estimates = [one for one, _ in both.values() if one.legs is not None]
        for k, estimate in matched(seen_people, estimates):
            rows[k].append(_errors(*both[id(estimate)], people[k]["frames"][i]["cameras"][name]))
    for person, row in zip(people, rows, strict=True):
        mean = np.nanmean(np.array(row), axis=0)
        mean[6] = np.sqrt(mean[6])
        cm = 100 * mean
        yield (
            f"{name}, {person['name']}, {len(row)}, {mean[-1]:.0%}, {cm[0]:.1f}, {cm[1]:.1f}, "
            f"{cm[2]:.1f}; {cm[3]:.1f}, {cm[4]:.1f}; {cm[5]:.1f}; {mean[6]:.1f}, {mean[7]:.1f}"
        )


def _errors(estimate: Estimate, points: ImagePoints | None, there: Any) -> FloatArray:
    """Return the errors of one image, m and degrees, and the share that is ``tracked``."""
    legs = estimate.legs
    assert legs is not None and estimate.keypoints_m is not None

    def true_m(names: tuple[str, ...]) -> FloatArray:
        return np.array([there["joints_m"].get(name, [np.nan] * 3) for name in names])

    true, upper = true_m(LEG_KEYPOINT_NAMES), true_m(KEYPOINT_NAMES)
    is_free = np.array([name not in there["covered"] for name in LEG_KEYPOINT_NAMES])
    is_tracked = is_free & np.array([str(state) == "tracked" for state in legs.states])

    def shape_and_legs(points_m: FloatArray, shoulders_m: FloatArray) -> list[float]:
        shape = points_m - shoulders_m.mean(axis=0) - true + upper[_SHOULDERS].mean(axis=0)
        below = points_m - points_m[_HIPS].mean(axis=0) - true + true[_HIPS].mean(axis=0)
        lengths = np.linalg.norm(np.stack([shape, below]), axis=-1)
        lengths[:, ~is_tracked] = np.nan
        return [_mean(lengths[0]), _mean(lengths[1, _REST])]

    place = np.where(is_tracked, np.linalg.norm(legs.points_m - true, axis=1), np.nan)
    found = [_mean(place), *shape_and_legs(legs.points_m, estimate.keypoints_m[_SHOULDERS])]
    of_network = [np.nan, np.nan]
    if points is not None and points.spatial_m is not None and points.legs is not None:
        assert points.legs.spatial_m is not None
        named = {
            **{name: points.spatial_m[at] for name, at in POINT_INDEX.items()},
            **dict(zip(LEG_POINT_NAMES, points.legs.spatial_m, strict=True)),
        }
        shoulders = np.array([named[KEYPOINT_NAMES[at]] for at in _SHOULDERS])
        network = np.array([named[name] for name in LEG_KEYPOINT_NAMES])
        of_network = shape_and_legs(network, shoulders)
    arms = _mean(np.linalg.norm(np.asarray(estimate.keypoints_m) - upper, axis=1))
    bend_deg = _bend_deg(legs.points_m) - _bend_deg(true)
    bend_deg[~is_tracked.reshape(2, 3).all(axis=1)] = np.nan
    bends = [_mean(bend_deg**2), _mean(bend_deg)]
    known = np.isfinite(true).all(axis=1) & is_free
    share = is_tracked[known].mean() if known.any() else np.nan
    return np.array([*found, *of_network, arms, *bends, share])


def _bend_deg(points_m: FloatArray) -> FloatArray:
    """Return the bend of the left and the right knee, (2,), degrees, of points (6, 3)."""
    bones = np.diff(points_m.reshape(2, 3, 3), axis=1)
    bones = bones / np.linalg.norm(bones, axis=-1, keepdims=True)
    return np.asarray(np.degrees(np.arccos(np.clip((bones[:, 0] * bones[:, 1]).sum(-1), -1, 1))))


def _mean(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else float("nan")


if __name__ == "__main__":
    main()
