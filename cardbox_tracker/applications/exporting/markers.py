"""Markers of a tracked motion: TRC for OpenSim and Pose2Sim, C3D for the rest.

In the laboratory frame X points from the person to the camera, Y up and Z to the right of a person
who faces the camera, as OpenSim and the ISB choose their axes. Its origin is the first camera.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cardbox_tracker.applications.exporting.motion import Motion
from cardbox_tracker.applications.exporting.placed import frames_of, keypoints_in_reference
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import atomic_path
from cardbox_tracker.person.isb_angles import LABORATORY
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray

KEYPOINT_MARKERS = ("LShoulder", "LElbow", "LHand", "RShoulder", "RElbow", "RHand")
"""Markers in the order of the keypoints."""
BODY_MARKERS = ("Hip", "Neck")
"""Middle of the hips and of the torso's top, which follow if the body is known."""


class Markers(NamedTuple):
    """Names (k) and places (n, k, 3), metres in the laboratory frame; nan in gaps."""

    names: tuple[str, ...]
    points_m: FloatArray


def markers_of(motion: Motion, body: BodyModel | None) -> Markers:
    """Return the markers of a motion.

    Args:
        motion: the results.
        body: the person that was tracked; without it the camera is taken as level.
    """
    names: tuple[str, ...] = KEYPOINT_MARKERS
    points_m = keypoints_in_reference(motion, body)
    if body is not None:
        frames = frames_of(motion, body)
        names = (*names, *BODY_MARKERS)
        points_m = np.concatenate([points_m, np.stack([frames.hip, frames.neck], axis=1)], axis=1)
    return Markers(names, np.where(motion.is_seen[:, None, None], points_m @ LABORATORY.T, np.nan))


def write_trc(path: Path, motion: Motion, body: BodyModel | None) -> None:
    """Write the markers as TRC in metres, with a row for each image; gaps are empty.

    Raises:
        CardboxError: the file cannot be written.
    """
    names, points_m = markers_of(motion, body)
    rate, count = f"{motion.rate_hz:g}", str(len(points_m))
    numbers = range(1, len(names) + 1)
    header = (
        ("PathFileType", "4", "(X/Y/Z)", path.name),
        (
            *("DataRate", "CameraRate", "NumFrames", "NumMarkers", "Units"),
            *("OrigDataRate", "OrigDataStartFrame", "OrigNumFrames"),
        ),
        (rate, rate, count, str(len(names)), "m", rate, "1", count),
        ("Frame#", "Time", *(cell for name in names for cell in (name, "", ""))),
        ("", "", *(f"{axis}{number}" for number in numbers for axis in "XYZ"), ""),
        (),
    )
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        file.writelines("\t".join(cells) + "\n" for cells in header)
        for number, (time_s, row) in enumerate(zip(motion.time_s, points_m, strict=True), 1):
            places = ("" if np.isnan(value) else f"{value:.6f}" for value in row.ravel())
            # OpenSim drops an empty cell at the end of a row, which therefore ends in a tab.
            file.write("\t".join((str(number), f"{time_s:.6f}", *places, "")) + "\n")


def write_c3d(path: Path, motion: Motion, body: BodyModel | None) -> None:
    """Write the markers as C3D in millimetres at a constant rate.

    Points in gaps have the residual -1, which the format defines as invalid.

    Raises:
        CardboxError: ezc3d is missing, or the file cannot be written.
    """
    even = motion.evenly()
    names, points_m = markers_of(even, body)
    is_gap = ~even.is_seen
    points = np.ones((4, len(names), len(points_m)))
    points[:3] = np.moveaxis(np.nan_to_num(points_m) * 1000.0, -1, 0).swapaxes(1, 2)
    residuals = np.zeros((1, len(names), len(points_m)))
    residuals[..., is_gap] = -1.0

    file = ezc3d_or_error().c3d()
    values = file["parameters"]["POINT"]
    values["UNITS"]["value"] = ["mm"]
    values["RATE"]["value"] = [even.rate_hz]
    values["LABELS"]["value"] = list(names)
    # These name the axes of a view from the person's side: forwards, then up.
    file.add_parameter("POINT", "X_SCREEN", ["+X"])
    file.add_parameter("POINT", "Y_SCREEN", ["+Y"])
    file["data"]["points"] = points
    file["data"]["meta_points"]["residuals"] = residuals
    with atomic_path(path) as temporary:
        file.write(str(temporary))


def ezc3d_or_error() -> Any:
    """Return the module ezc3d.

    Raises:
        CardboxError: it is not installed.
    """
    try:
        import ezc3d
    except ImportError as error:
        raise CardboxError(
            f"C3D needs the library ezc3d ({error}); install it with "
            "pip install '.[export]' in the checkout, or export --to trc"
        ) from None
    return ezc3d
