"""Markers of a tracked motion: TRC for OpenSim and Pose2Sim, C3D for the rest.

In the laboratory frame X points from the person to the camera, Y up and Z to the right of a person
who faces the camera, as OpenSim and the ISB choose their axes. Its origin is on the floor below the
first camera, or is the camera if the floor is not known.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cardbox_tracker.applications.exporting.motion import (
    Motion,
    floor_below,
    frames_of,
    in_reference,
)
from cardbox_tracker.common.errors import in_cell
from cardbox_tracker.common.extensions import optional
from cardbox_tracker.common.files import atomic_path
from cardbox_tracker.person.isb_angles import LABORATORY
from cardbox_tracker.person.legs import legs_m
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import YAW
from cardbox_tracker.person.proportions import WRIST_SHARE
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import Group

KEYPOINT_MARKERS = ("LShoulder", "LElbow", "LHand", "RShoulder", "RElbow", "RHand")
"""Markers in the order of the keypoints."""
BODY_MARKERS = ("Hip", "Neck")
"""Middle of the hips and of the torso's top, which follow if the body is known."""
LEG_MARKERS = ("LHip", "LKnee", "LAnkle", "RHip", "RKnee", "RAnkle")
"""Markers that follow if legs are measured."""
HAND_MARKERS = ("LWrist", "LPalm", "RWrist", "RPalm")
"""Markers that follow if hands are measured: the wrist, and a point ``PALM_M`` out of the palm."""
PALM_M = 0.05


class Markers(NamedTuple):
    """Names (k), places (n, k, 3), metres in the laboratory frame, and their deviations (n, k), m.

    Places are nan in gaps, and where legs or hands are not seen; deviations are 0 if not known.
    """

    names: tuple[str, ...]
    points_m: FloatArray
    stddev_m: FloatArray


def markers_of(motion: Motion, body: BodyModel | None) -> Markers:
    """Return the markers of a motion; without the body the camera is taken as level."""
    names: tuple[str, ...] = KEYPOINT_MARKERS
    keypoints_m = in_reference(motion.keypoints_m, body)
    points_m = [keypoints_m]
    if body is not None:
        frames = frames_of(motion, body)
        names = (*names, *BODY_MARKERS)
        points_m.append(np.stack([frames.hip, frames.neck], axis=1))
    if motion.has_legs and (body is not None or np.isfinite(motion.leg_points_m).any()):
        names = (*names, *LEG_MARKERS)
        points_m.append(_legs_m(motion, body))
    if motion.has_hands:
        names = (*names, *HAND_MARKERS)
        elbows_m, hands_m = keypoints_m[:, [1, 4]], keypoints_m[:, [2, 5]]
        palms = in_reference(motion.palms, body)
        wrists_m = elbows_m + WRIST_SHARE * (hands_m - elbows_m)
        wrists_m = np.where(np.isfinite(palms), wrists_m, np.nan)
        out_m = (wrists_m + hands_m) / 2 + PALM_M * palms
        points_m += [np.stack([wrists_m[:, i], out_m[:, i]], axis=1) for i in (0, 1)]
    joined_m = (np.concatenate(points_m, axis=1) - floor_below(body)) @ LABORATORY.T
    stddev_m = np.zeros(joined_m.shape[:2])
    if LEG_MARKERS[0] in names:
        first = names.index(LEG_MARKERS[0])
        stddev_m[:, first : first + 6] = np.nan_to_num(motion.leg_stddev_m)
    return Markers(names, np.where(motion.is_seen[:, None, None], joined_m, np.nan), stddev_m)


def _legs_m(motion: Motion, body: BodyModel | None) -> FloatArray:
    """Return the points of the legs (n, 6, 3) in the reference frame; a bag has their angles."""
    points_m = in_reference(motion.leg_points_m, body)
    if body is None or np.isfinite(motion.leg_stddev_m).any():
        return points_m
    return legs_m(
        body, frames_of(motion, body).hip, motion.states[:, YAW], motion.values_of(Group.LEG)
    )


def write_trc(path: Path, motion: Motion, body: BodyModel | None) -> None:
    """Write TRC in metres, a row for each image, gaps empty, or raise CardboxError."""
    names, points_m, _ = markers_of(motion, body)
    rate, count = f"{motion.rate_hz:g}", str(len(points_m))
    numbers = range(1, len(names) + 1)
    header = (
        ("PathFileType", "4", "(X/Y/Z)", in_cell(path.name)),
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

    The residual of a point is its standard deviation, or 0 if there is none; points that are not
    known have -1, which the format defines as invalid. Raises CardboxError if ezc3d is missing, or
    the file cannot be written.
    """
    even = motion.evenly()
    names, points_m, stddev_m = markers_of(even, body)
    points = np.ones((4, len(names), len(points_m)))
    points[:3] = np.moveaxis(np.nan_to_num(points_m) * 1000.0, -1, 0).swapaxes(1, 2)
    is_known = np.isfinite(points_m).all(axis=-1)
    residuals = np.where(is_known, 1000.0 * stddev_m, -1.0).T[None]

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
    """Return the module ezc3d; raise CardboxError if it is not installed."""
    return optional("ezc3d", "C3D needs the library ezc3d", "export", ", or export --to trc")
