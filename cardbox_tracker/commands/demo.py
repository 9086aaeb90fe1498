"""``cardbox demo``: tracks a real person, or with ``--live`` runs the nodes on a synthetic one."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from cardbox_tracker.commands.arguments import Options, at_least, camera_count, choice, option
from cardbox_tracker.common.errors import CardboxError, RosMissingError
from cardbox_tracker.common.files import make_folder, write_file
from cardbox_tracker.search.config import PRESETS

_PRESET = "default"


@dataclass(frozen=True)
class Arguments(Options):
    """The film, or the nodes.

    Attributes:
        output: folder of results
        live: with ROS 2: run the whole chain through the nodes, on a synthetic recording
        preset: tracker settings: paper is Table I of the paper, default tracks best
        cameras: 1 to 4; with --live; several see the person together, with default
        seed: random seed of the recording and the filters
    """

    output: Path = option("DIR", default=Path("demo_output"))
    live: bool = option(default=False)
    preset: str = choice(PRESETS, default=_PRESET)
    cameras: int = option("N", camera_count, default=1)
    seed: int = option(read=at_least(0), default=0)


def run(given: Arguments) -> None:
    """Track the film, or run the nodes; write the results."""
    if given.live:
        try:
            from cardbox_tracker.ros.demo.run import run_demo
        except ImportError as error:
            raise RosMissingError(error) from None
        run_demo(given.output, given.preset, given.seed, given.cameras)
    elif given.cameras > 1 or given.preset != _PRESET:
        raise CardboxError("--cameras and --preset are for the nodes: give --live, too")
    else:
        _track_film(given.output, given.seed)


def _track_film(output: Path, seed: int) -> None:
    import numpy as np

    from cardbox_tracker.applications.demo.film import SOURCE, DemoFilm
    from cardbox_tracker.applications.exporting.motion import Motion
    from cardbox_tracker.applications.reporting.page import space_view
    from cardbox_tracker.commands.request import Request
    from cardbox_tracker.commands.track import track_one

    make_folder(output)
    film = DemoFilm.load()
    print(f"film: {SOURCE}", flush=True)
    asked = Request(
        film.path,
        detector=film.detector,
        fov_deg=film.fov_deg,
        stature_m=film.stature_m,
        seed=seed,
        csv=output / "angles.csv",
        video=output / "overlay.mp4",
        export="trc",
        force=True,
    )
    summary, people = track_one(asked)
    pitch = None if summary.scene is None else summary.scene.camera.pitch_rad
    results = people[1]
    motion = Motion.of(results)
    ours_m, theirs_m = film.errors_m(motion.keypoints_m), film.errors_m(film.mediapipe_m())
    pictures = {
        "space.png": space_view(motion, results.body, film.true_m, pitch),
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
    print(f"see {output}/overlay.mp4, space.png and error.png; angles.csv and angles.trc are data")
