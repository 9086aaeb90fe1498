"""``cardbox demo``: tracks a real person, or with ``--live`` runs the nodes on a synthetic one."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from cardbox_tracker.commands.arguments import add_camera_count, add_preset, add_seed
from cardbox_tracker.common.errors import CardboxError, RosMissingError
from cardbox_tracker.common.files import make_folder, write_file

_PRESET = "default"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``cardbox demo``."""
    parser.add_argument(
        "--output", type=Path, default=Path("demo_output"), metavar="DIR", help="folder of results"
    )
    parser.add_argument(
        "--live",
        action="store_true",
        help="with ROS 2: run the whole chain through the nodes, on a synthetic recording",
    )
    add_preset(parser)
    add_camera_count(parser, "with --live; several see the person together, with default")
    add_seed(parser, "the recording and the filters")


def run(options: argparse.Namespace) -> None:
    """Track the film, or run the nodes; write the results."""
    if options.live:
        try:
            from cardbox_tracker.ros.demo.run import run_demo
        except ImportError as error:
            raise RosMissingError(error) from None
        run_demo(options.output, options.preset, options.seed, options.cameras)
    elif options.cameras > 1 or options.preset != _PRESET:
        raise CardboxError("--cameras and --preset are for the nodes: give --live, too")
    else:
        _track_film(options.output, options.seed)


def _track_film(output: Path, seed: int) -> None:
    import numpy as np

    from cardbox_tracker.applications.demo.film import SOURCE, DemoFilm
    from cardbox_tracker.applications.exporting.markers import write_trc
    from cardbox_tracker.applications.exporting.motion import Motion
    from cardbox_tracker.applications.reporting.page import space_view
    from cardbox_tracker.commands.request import (
        PersonRequest,
        TrackFiles,
        TrackingRequest,
    )
    from cardbox_tracker.commands.tracking import track
    from cardbox_tracker.person.model import body_from_proportions
    from cardbox_tracker.recordings.given_camera import GivenCamera
    from cardbox_tracker.recordings.recording import RecordingRequest
    from cardbox_tracker.recordings.result_reader import read_results
    from cardbox_tracker.search.config import PRESETS
    from cardbox_tracker.tracking.precompile import compile_for_films

    make_folder(output)
    film = DemoFilm.load()
    print(f"film: {SOURCE}", flush=True)
    compile_for_films()
    detector, camera = film.detector, GivenCamera(film.fov_deg)
    recording = RecordingRequest(film.path, detector, points=detector, camera=camera)
    body = body_from_proportions(film.stature_m)
    table = output / "angles.csv"
    files = TrackFiles(table, output / "overlay.mp4", body=output / "angles.body.yaml")
    person = PersonRequest(body, None, 0.0, False, film.stature_m)
    config = PRESETS[_PRESET]()
    track(TrackingRequest(recording, person, _PRESET, config, seed, (), files=files))

    results = read_results(table)
    motion = Motion.of(results)
    write_trc(output / "markers.trc", motion, results.body)
    ours_m, theirs_m = film.errors_m(motion.keypoints_m), film.errors_m(film.mediapipe_m())
    pictures = {
        "space.png": space_view(motion, results.body, film.true_m),
        "error.png": film.error_plot(motion.time_s, ours_m, theirs_m),
    }
    for name, png in pictures.items():
        write_file(output / name, png)
    compared = np.isfinite(ours_m) & np.isfinite(theirs_m)
    placed_m = film.errors_m(motion.keypoints_m, is_placed=True)
    pitch_rad = 0.0 if results.body is None else results.body.camera_pose.pitch_rad
    turned_m = film.errors_m(film.mediapipe_m(pitch_rad))
    figures = {
        "images": len(compared),
        "images_compared": int(compared.sum()),
        "shape_error_m": float(ours_m[compared].mean()),
        "mediapipe_shape_error_m": float(theirs_m[compared].mean()),
        "mediapipe_turned_error_m": float(turned_m[compared].mean()),
        "place_error_m": float(placed_m[compared].mean()),
    }
    write_file(output / "report.json", json.dumps(figures, indent=1) + "\n")
    shape_cm, theirs_cm, turned_cm, place_cm = (100 * value for value in [*figures.values()][2:])
    print(
        f"error of shoulders, elbows and hands in {compared.sum()} images with a reference: "
        f"{shape_cm:.1f} cm beside the middle of the shoulders, {place_cm:.1f} cm with the place; "
        f"MediaPipe Pose beside the shoulders: {theirs_cm:.1f} cm, or {turned_cm:.1f} cm if its "
        "points are turned by the camera's pitch that was found here"
    )
    print(f"see {output}/overlay.mp4, space.png and error.png; angles.csv and markers.trc are data")
