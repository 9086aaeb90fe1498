"""Print how well the camera of recorded sessions is found: errors beside deviations.

python -m lab.tools.scene_camera SESSION...
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.measuring.scene_camera import scene_camera
from cardbox_tracker.recordings.measured_scene import watch
from cardbox_tracker.recordings.recording import RecordingRequest


class Row(NamedTuple):
    """One camera of a session; angles in degrees.

    Attributes:
        name: of session and camera.
        is_real: whether people were filmed.
        true_deg: downward pitch.
        found_deg: the same as it is found.
        stddev_deg: its standard deviation.
        height_z: error of the height above the floor in deviations; nan where it is not known.
    """

    name: str
    is_real: bool
    true_deg: float
    found_deg: float
    stddev_deg: float
    height_z: float

    @property
    def z(self) -> float:
        """Error of the pitch in standard deviations."""
        return (self.found_deg - self.true_deg) / self.stddev_deg


def rows(folder: Path, detector: Detector) -> Iterator[Row]:
    """Yield a row for each camera of a session.

    Args:
        folder: the session.
        detector: the installed detector.
    """
    truth = json.loads((folder / "ground_truth.json").read_text(encoding="utf-8"))
    cameras: list[dict[str, Any]] = truth.get("cameras") or [truth["camera"]]
    people = truth.get("people") or [truth["person"]]
    for camera in cameras:
        name = camera["name"] if len(cameras) > 1 else None
        # Nothing says which of several people is who.
        stature_m = people[0].get("height") if len(people) == 1 else None
        finder = detector._replace(people=len(people) if len(people) > 1 else 0)
        names = () if name is None else (name,)
        with RecordingRequest(folder / "bag", finder, names, points=finder).open() as recording:
            watched = watch(recording)
            statures_m = [stature_m] * len(watched.people)
            seen = watched.people, watched.pictures, recording.first.camera, statures_m
            found = scene_camera(*seen).camera
        height, true_m = found.height_m, camera.get("height_m")
        height_z = math.nan
        if height is not None and true_m is not None:
            height_z = (height.mean - true_m) / height.stddev
        yield Row(
            f"{folder.name} {name or ''}".strip(),
            "real" in str(folder.resolve()),
            float(camera.get("pitch_down_deg") or 0.0),
            math.degrees(found.pitch_rad.mean),
            math.degrees(found.pitch_rad.stddev),
            height_z,
        )


def summary(name: str, found: Sequence[Row]) -> str:
    """Return one line on several rows."""
    errors = np.array([row.found_deg - row.true_deg for row in found])
    scores = np.abs([row.z for row in found])
    heights = np.abs([row.height_z for row in found if math.isfinite(row.height_z)])
    text = (
        f"{name}: {len(found)}, error {np.sqrt((errors**2).mean()):.1f} degrees rms, mean "
        f"{errors.mean():.1f}; within one deviation {100 * (scores <= 1).mean():.0f} %, within two "
        f"{100 * (scores <= 2).mean():.0f} %"
    )
    if len(heights):
        text += (
            f"; heights {100 * (heights <= 1).mean():.0f} % and {100 * (heights <= 2).mean():.0f} %"
        )
    return text


def main() -> None:
    """Print a line for each camera, and the summaries."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    options = parser.parse_args()
    detector, every = Detector.installed(), list[Row]()
    for folder in options.sessions:
        try:
            for row in rows(folder, detector):
                every.append(row)
                print(
                    f"{row.name}: true {row.true_deg:.1f}, found {row.found_deg:.1f} +- "
                    f"{row.stddev_deg:.1f}, {row.z:.1f} deviations",
                    flush=True,
                )
        except CardboxError as error:
            print(f"{folder}: {error}")
    for name, is_real in (("real", True), ("rendered", False)):
        if group := [row for row in every if row.is_real is is_real]:
            print(summary(name, group))


if __name__ == "__main__":
    main()
