"""Two cameras of a session as two films that nobody synchronized or calibrated.

    python -m lab.tools.film_pairs SESSION:CAMERA,CAMERA... [--poses]

The second film begins 0.37 s later. Both are turned until the optical axis is in the middle of the
image, and lose their stamps. The lines have the errors of offset, rotation and place of the second
camera beside the deviations that are stated, and of sessions of one person the mean error of
shoulders, elbows and hands, cm, of tracking both films, once with what is found and once with the
true offset and poses; *aligned* is beside the middle of the shoulders. ``--poses`` does not track.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import cv2
import numpy as np

from cardbox_tracker.applications.drawing.video import video_file
from cardbox_tracker.camera.extrinsics import Extrinsics
from cardbox_tracker.camera.extrinsics_files import load_extrinsics, save_camchain
from cardbox_tracker.commands.request import Request
from cardbox_tracker.commands.tracking_request import tracking_request
from cardbox_tracker.common.errors import CameraError
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.recordings.open_images import open_images
from lab.evaluation.films import Film, tracked_figures
from lab.evaluation.session import load_session

LATER_S = 0.37


class Half(NamedTuple):
    """One film of a pair: its field of view, stamps in the session, and rotation of its frame."""

    path: Path
    fov_deg: float
    stamps_ns: tuple[int, ...]
    turn: FloatArray


def main() -> None:
    """Make the films, and print a line for each pair."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("pairs", nargs="+", metavar="SESSION:CAMERA,CAMERA")
    parser.add_argument("--poses", action="store_true", help="do not track")
    options = parser.parse_args()
    for pair in options.pairs:
        folder, _, cameras = pair.rpartition(":")
        for line in _lines(Path(folder), cameras.split(","), not options.poses):
            print(f"{Path(folder).name} {cameras}: {line}", flush=True)


def _lines(folder: Path, cameras: list[str], tracks: bool) -> Iterator[str]:
    truth = json.loads((folder / "ground_truth.json").read_text())
    people = truth.get("people", [truth.get("person")])
    # The tracker numbers people from left to right.
    joints = "left_shoulder"
    if len(people) > 1:
        people.sort(key=lambda one: one["frames"][0]["cameras"][cameras[0]]["joints_px"][joints][0])
    neutral = [one["end_s"] for one in truth["segments"] if one["name"] == "neutral"]
    with TemporaryDirectory() as made:
        begins_ns = None
        halves = list[Half]()
        for name in cameras:
            half = _film(folder, name, begins_ns, neutral[0] if neutral else 0.0, Path(made))
            begins_ns = half.stamps_ns[0] + round(1e9 * LATER_S)
            halves.append(half)
        one, two = halves
        there = load_extrinsics(folder / "extrinsics.yaml", cameras)[cameras[1]]
        pose = Extrinsics(two.turn @ there.rotation @ one.turn.T, two.turn @ there.translation_m)
        offset_s = (two.stamps_ns[0] - one.stamps_ns[0]) / 1e9
        asked = Request(
            one.path,
            films=(two.path,),
            fov_deg=(one.fov_deg, two.fov_deg),
            stature_m=tuple(person["height"] for person in people),
            people=len(people) if len(people) > 1 else None,
            detector="mediapipe",
        )
        period_s = float(np.median(np.diff(two.stamps_ns))) / 1e9
        try:
            with tracking_request(asked).recording.open() as recording:
                found = recording.films[0].camera
                cameras_px = [source.camera for source in recording.sources]
                names = recording.names
        except CameraError as error:
            yield str(error)
            return
        angle_rad, away_m = found.extrinsics.difference(pose)
        far_m = float(np.linalg.norm(pose.centre_m))
        yield (
            f"offset {1000 * (found.offset_s - offset_s):+.0f} +- "
            f"{1000 * found.offset_stddev_s:.0f} ms ({(found.offset_s - offset_s) / period_s:+.2f} "
            f"images), rotation {np.degrees(angle_rad):.1f} +- "
            f"{np.degrees(found.turn_stddev_rad):.1f} degrees, place {100 * away_m / far_m:.1f} +- "
            f"{100 * found.place_stddev_m / far_m:.1f} % of {far_m:.2f} m, halves "
            f"{np.degrees(found.halves[0]):.1f} degrees and {100 * found.halves[1] / far_m:.0f} %"
        )
        if not tracks or len(people) > 1:
            return
        rigs = {"films" if len(names) > 1 else "first film alone": asked}
        if len(names) > 1:
            camchain = Path(made) / "true.yaml"
            save_camchain(camchain, dict(zip(names, cameras_px, strict=True)), {names[1]: pose})
            rigs["true rig"] = replace(asked, offset_s=(offset_s,), extrinsics=camchain)
        for what, request in rigs.items():
            figures = _figures(folder, cameras[0], one, request)
            yield f"{what}: aligned {figures['aligned']:.1f}, absolute {figures['absolute']:.1f} cm"


def _film(folder: Path, name: str, begins_ns: int | None, start_s: float, made: Path) -> Half:
    with open_images(folder) as bag:
        lens = bag.calibration(name)
        images = list(bag.images(bag.image_topic(name)))
        if begins_ns is None:
            begins_ns = images[0].stamp_ns + round(1e9 * start_s)
        images = [image for image in images if image.stamp_ns >= begins_ns]
        size = width, height = lens.width // 2 * 2, lens.height // 2 * 2
        k = lens.k.copy()
        k[:2, 2] = (width - 1) / 2, (height - 1) / 2
        ahead = np.linalg.solve(lens.k, [(lens.width - 1) / 2, (lens.height - 1) / 2, 1.0])
        ahead /= np.linalg.norm(ahead)
        axis = np.cross(ahead, [0.0, 0.0, 1.0])
        sine = float(np.linalg.norm(axis))
        turn = np.asarray(cv2.Rodrigues(axis * np.arcsin(sine) / max(sine, 1e-9))[0])
        maps = cv2.initUndistortRectifyMap(lens.k, lens.distortion, turn, k, size, cv2.CV_32FC1)
        stamps_ns = tuple(image.stamp_ns for image in images)
        path = made / f"{name}.mp4"
        with video_file(path, round(1e9 / float(np.median(np.diff(stamps_ns))), 2)) as add:
            for image in images:
                add(cv2.remap(image.as_sent, *maps, cv2.INTER_LINEAR).astype(np.uint8))
    return Half(path, float(np.degrees(2 * np.arctan(width / 2 / k[0, 0]))), stamps_ns, turn)


def _figures(folder: Path, camera: str, half: Half, asked: Request) -> dict[str, Any]:
    session = load_session(folder, (camera,))
    hips_m = session.hips_m
    session = replace(
        session,
        keypoints_m=session.keypoints_m @ half.turn.T,
        hips_m=None if hips_m is None else hips_m @ half.turn.T,
    )
    film = Film(session, "across", half.path, half.fov_deg, half.stamps_ns)
    return tracked_figures(film, asked)


if __name__ == "__main__":
    main()
