"""Two cameras beside OpenCV's triangulation of the same points (``docs/evaluation/ways.md``).

    python -m lab.tools.triangulated SESSION... [--output docs/evaluation/ways.md]

The first two cameras of each session are tracked as :mod:`.ways` tracks their bag. The points are
those of the same detector at the same working resolution; of several people, who is found counts
for the nearest true person in each image, so that the triangulation confuses nobody. Its hand is
5.55 % of the stature beyond the wrist towards the middle of the knuckles of index and little
finger, as in the references. The table becomes the last part of the page.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import write_file
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.image_points import POINT_INDEX, ImagePoints
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.recordings.recording import RecordingRequest
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.recordings.result_table import POINT_COLUMNS
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from lab.tools.way_cases import Case, Person, cases_of
from lab.tools.ways import FURTHER, of_bag, parts_of, shape_and_place_cm

HAND = 0.0555
"""Distance of a hand from the wrist, by the stature."""
_SIDES = "left", "right"
_ARM = [POINT_INDEX[f"{side}_{joint}"] for side in _SIDES for joint in ("shoulder", "elbow")]
_ARM_KEYPOINTS = [0, 1, 3, 4]
_HEADER = f"""{FURTHER}

`python -m lab.tools.triangulated SESSION... --output docs/evaluation/ways.md` makes this table:
shape and place as above, cm, of this package and of `cv2.triangulatePoints` with the same
detector's points and the same poses of the cameras, in the images in which both have all joints.
Of several people, who is found counts for the nearest one of the reference, so OpenCV confuses
nobody. Its hand is {100 * HAND:.2f} % of the stature beyond the wrist towards the knuckles, as in
the references.

| recording | images | shape | OpenCV's | place | OpenCV's |
|---|---|---|---|---|---|"""


def triangulated(
    pixels: Sequence[FloatArray], cameras: Sequence[Camera], pose: FloatArray
) -> FloatArray:
    """Return the points (n, 3), m, in the first camera's frame, nan where a pixel is unknown.

    Args:
        pixels: columns and rows (n, 2) in both cameras, px, without distortion.
        cameras: both cameras.
        pose: rotation and translation (3, 4) from the first camera's frame into the second's.
    """
    centres = [np.array([camera.cx, camera.cy]) for camera in cameras]
    focal = [np.array([camera.fx, camera.fy]) for camera in cameras]
    rays = [(px - c) / f for px, c, f in zip(pixels, centres, focal, strict=True)]
    known = np.isfinite(np.hstack(rays)).all(axis=1)
    found = np.full((len(known), 3), np.nan)
    if known.any():
        seen = (np.ascontiguousarray(one[known].T) for one in rays)
        points = cv2.triangulatePoints(np.eye(3, 4), pose, *seen)
        found[known] = (points[:3] / points[3]).T
    return found


def keypoints_of(points_m: FloatArray, stature_m: float) -> FloatArray:
    """Return shoulder, elbow and hand of both sides (6, 3) from a detector's points (17, 3), m."""
    found = []
    for side in _SIDES:
        shoulder, elbow, wrist, index, little = (
            points_m[POINT_INDEX[f"{side}_{name}"]]
            for name in ("shoulder", "elbow", "wrist", "index", "little_finger")
        )
        ahead = (index + little) / 2.0 - wrist
        found += [shoulder, elbow, wrist + HAND * stature_m * ahead / np.linalg.norm(ahead)]
    return np.array(found)


def nearest(
    people: Sequence[ImagePoints], joints_m: Sequence[FloatArray], camera: Camera, pose: FloatArray
) -> list[FloatArray]:
    """Return the pixels (17, 2) of each true person (6, 3) in an image; nan for who is not found.

    Who is found counts for the true person who is nearest. ``pose`` (3, 4) is from the frame of
    ``joints_m`` into that of ``camera``.
    """
    found = [np.full((len(POINT_INDEX), 2), np.nan)] * len(joints_m)
    least_px = np.full(len(joints_m), np.inf)
    there_m = np.array(joints_m)[:, _ARM_KEYPOINTS] @ pose[:, :3].T + pose[:, 3]
    true_px = there_m[..., :2] / there_m[..., 2:] * [camera.fx, camera.fy] + [camera.cx, camera.cy]
    for one in people:
        away = np.linalg.norm(one.px[_ARM] - true_px, axis=2)
        known = np.isfinite(away)
        away_px = np.where(known, away, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
        away_px[~known.any(axis=1)] = np.inf
        k = int(away_px.argmin())
        if away_px[k] < least_px[k]:
            found[k], least_px[k] = one.px, away_px[k]
    return found


def of_opencv(case: Case) -> list[dict[int, FloatArray]]:
    """Return the keypoints (6, 3) of each person by stamp, m in the first camera's frame."""
    count = len(case.people) if len(case.people) > 1 else 0
    finder = Detector.installed()._replace(people=count)
    found: list[dict[int, FloatArray]] = [{} for _ in case.people]
    scene = case.empty or finder
    request = RecordingRequest(case.bag, scene, case.cameras, case.extrinsics, points=finder)
    with request.open() as recording:
        other = recording.others[0]
        there = np.column_stack([other.extrinsics.rotation, other.extrinsics.translation_m])
        cameras, poses = [recording.first.camera, other.camera], [np.eye(3, 4), there]
        for taken in recording.frames(case.start_s):
            stamp = taken.stamp_ns
            there_are = [k for k, one in enumerate(case.people) if stamp in one.joints_m]
            if not there_are:
                continue
            true_m = [case.people[k].joints_m[stamp] for k in there_are]
            views = [
                nearest(_people_in(frame), true_m, camera, pose)
                for frame, camera, pose in zip(taken.frames, cameras, poses, strict=True)
            ]
            for k, *pixels in zip(there_are, *views, strict=True):
                points_m = triangulated(pixels, cameras, there)
                found[k][stamp] = keypoints_of(points_m, case.people[k].stature_m)
    return found


def _people_in(frame: RecordedFrame | None) -> Sequence[ImagePoints]:
    if frame is None:
        return ()
    alone = () if frame.points is None else (frame.points,)
    return alone if frame.people is None else frame.people


def row_of(name: str, person: Person, results: Results, opencv_m: Mapping[int, FloatArray]) -> str:
    """Return the row of a person of a recording."""
    points_m = results.of(POINT_COLUMNS).reshape(-1, 6, 3)
    ours_m = dict(zip(results.stamp_ns.tolist(), points_m, strict=True))
    off: tuple[list[FloatArray], list[FloatArray]] = [], []
    for stamp, true_m in person.joints_m.items():
        both = [found[stamp] - true_m for found in (ours_m, opencv_m) if stamp in found]
        # A joint without a reference is nan in both.
        known = np.isfinite(true_m)
        if len(both) == 2 and all(np.isfinite(one[known]).all() for one in both):
            off[0].append(both[0])
            off[1].append(both[1])
    ours, theirs = (shape_and_place_cm(np.array(one).reshape(-1, 6, 3)) for one in off)
    cells = f"{ours[0]:.1f} | {theirs[0]:.1f} | {ours[1]:.1f} | {theirs[1]:.1f}"
    return f"| {f'{name}, {person.name}'.rstrip(', ')} | {len(off[0])} | {cells} |"


def rows_of(case: Case) -> Iterator[str]:
    """Yield the row of each person, or one with the error."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            opencv_m = of_opencv(case)
            for person, results, own_m in zip(
                case.people, of_bag(case, Path(folder)), opencv_m, strict=True
            ):
                yield row_of(case.name, person, results, own_m)
        except CardboxError as error:
            yield f"| {case.name}: {' '.join(str(error).split())} | | | | | |"


def main() -> None:
    """Print the table, and write it to the page."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("sessions", type=Path, nargs="+")
    parser.add_argument("--output", type=Path, help="the page, of which this is the last part")
    options = parser.parse_args()
    os.environ.setdefault("PYTHONPATH", str(Path(__file__).parents[2]))
    lines = [_HEADER]
    for case in (one for folder in options.sessions for one in cases_of(folder)):
        if len(case.cameras) == 2:
            for line in rows_of(case):
                print(line, flush=True)
                lines.append(line)
    if options.output is not None:
        text = "\n".join([parts_of(options.output)[0].rstrip(), "", *lines]).lstrip()
        write_file(options.output, text + "\n")


if __name__ == "__main__":
    main()
