"""``cardbox calibrate-extrinsics``: estimates the extrinsics of a recording's cameras."""

from __future__ import annotations

import math
from dataclasses import MISSING, dataclass
from pathlib import Path

from cardbox_tracker.commands.arguments import check_outputs, option, span
from cardbox_tracker.commands.initialize import References, measuring_config
from cardbox_tracker.recordings.silhouettes import TimeSpan


@dataclass(frozen=True, kw_only=True)
class Arguments(References):
    """A recording of the reference postures, and of a motion, by several cameras.

    Attributes:
        recording: rosbag2 folder or file of all cameras
        background: seconds during which nobody is in view
        cameras: cameras of the recording that see the person, such as cam0 cam1, the one that the
            person faced first
        motion: seconds in which the person moves, at first standing as for --front; 10 s or more in
            which the arms are raised and the person turns and steps about
        distance_m: from the first camera to the person, metres along the floor; distances between
            the cameras are proportional to it
        seed: random seed of the hypotheses and the filter
        output: camchain as of Kalibr to write, for --extrinsics
    """

    recording: Path = option("BAG", default=MISSING)
    background: TimeSpan = option("T0:T1", span, required=True)
    cameras: tuple[str, ...] = option("NAMESPACE", tuple, type=str, nargs="+", required=True)
    motion: TimeSpan = option("T0:T1", span, required=True)
    distance_m: float = option("M", flag="--distance", required=True)
    camera_pitch_deg: float = option("P", default=0.0)
    output: Path = option("EXTRINSICS.yaml", required=True)


def run(given: Arguments) -> None:
    """Estimate the extrinsics, write them and print their uncertainty."""
    from cardbox_tracker.camera.extrinsics_files import save_camchain
    from cardbox_tracker.common.progress import progress_bar
    from cardbox_tracker.recordings.calibrate import calibrate_recording

    check_outputs((given.output,), given.force, inputs=(given.recording,))
    pitch_rad = math.radians(given.camera_pitch_deg)
    config = measuring_config(given, given.distance_m, pitch_rad)
    with progress_bar("calibrate") as show:
        result = calibrate_recording(
            given.recording,
            given.cameras,
            given.background,
            given.spans,
            given.motion,
            config,
            show,
        )
    found = {name: camera.extrinsics for name, camera in result.found.items()}
    save_camchain(given.output, result.cameras, found)
    for name, camera in result.found.items():
        print(f"{name}: {camera}")
    print(f"wrote {given.output}")
