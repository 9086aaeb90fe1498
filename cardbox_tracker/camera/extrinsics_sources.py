"""Reads extrinsics from CameraInfo and ``/tf_static`` and chooses between several sources.

The projection matrices of a rectified pair come first, then the transforms on ``/tf_static``, then
a file. All sources that are present have to agree.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera_info import info_array
from cardbox_tracker.camera.extrinsics import FARTHEST_M, Extrinsics
from cardbox_tracker.common.errors import CameraError

# Two sources that differ by more do not belong to the same calibration.
_AGREE_DEG, _AGREE_M = 1.0, 0.02


class FrameTransform(NamedTuple):
    """One transform of ``/tf_static``."""

    parent: str  #: name of the parent frame
    child: str  #: name of the child frame
    to_parent: Extrinsics  #: transform of points from the child frame into the parent frame


def of_rectified_pair(first: Any, other: Any, name: str) -> Extrinsics | None:
    """Return the extrinsics in the projection matrices of two sensor_msgs/CameraInfo.

    The fourth column of P places a camera in the rectified frame: P[0,3] = -fx B for a right camera
    at the baseline B. R relates unrectified images to that frame. None if both columns are zero, so
    that the cameras are no rectified pair; CameraError if R is no rotation.
    """
    at = []
    for info in (first, other):
        p = info_array(info, "p").reshape(3, 4)
        r = info_array(info, "r").reshape(3, 3)
        if not (p[0, 0] > 0 and p[1, 1] > 0):
            return None
        at.append(
            (np.array([p[0, 3] / p[0, 0], p[1, 3] / p[1, 1], 0.0]), r if r.any() else np.eye(3))
        )
    (first_m, first_r), (other_m, other_r) = at
    if not np.any(np.abs(other_m - first_m) > 1e-6):
        return None
    moved = other_r.T @ (other_m - first_m)
    matrix = np.column_stack([other_r.T @ first_r, moved])
    return Extrinsics.of(matrix, f"P and R of {name}'s CameraInfo")


def of_transforms(
    transforms: Iterable[FrameTransform], first_frame: str, other_frame: str
) -> Extrinsics | None:
    """Return the extrinsics between two optical frames; None if nothing connects them."""
    beside: dict[str, list[tuple[str, Extrinsics]]] = {}
    for transform in transforms:
        beside.setdefault(transform.child, []).append((transform.parent, transform.to_parent))
        beside.setdefault(transform.parent, []).append(
            (transform.child, transform.to_parent.inverse())
        )
    source = "/tf_static"
    found = {first_frame: Extrinsics(np.eye(3), np.zeros(3), source)}
    waiting = deque([first_frame])
    while waiting:
        frame = waiting.popleft()
        for neighbour, step in beside.get(frame, ()):
            if neighbour not in found:
                there = step.after(found[frame])
                found[neighbour] = Extrinsics(there.rotation, there.translation_m, source)
                waiting.append(neighbour)
    return found.get(other_frame) if other_frame != first_frame else None


def transforms_of(message: Any) -> list[FrameTransform]:
    """Return the rigid transforms in a tf2_msgs/TFMessage; others are left out, as tf2 does."""
    found = []
    for stamped in message.transforms:
        place, turn = stamped.transform.translation, stamped.transform.rotation
        matrix = np.column_stack([_rotation(turn), [getattr(place, axis) for axis in "xyz"]])
        with suppress(CameraError):
            ends = (stamped.header.frame_id.lstrip("/"), stamped.child_frame_id.lstrip("/"))
            found.append(FrameTransform(*ends, Extrinsics.of(matrix, "/tf_static")))
    return found


def _rotation(quaternion: Any) -> NDArray[np.float64]:
    x, y, z, w = (float(getattr(quaternion, axis)) for axis in "xyzw")
    norm = math.hypot(x, y, z, w)
    # A quaternion that is all zero stands for no rotation at all; its matrix is refused.
    x, y, z, w = (value / norm if norm > 0.0 else math.nan for value in (x, y, z, w))
    return np.array(
        [
            (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
            (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
            (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
        ]
    )


def extrinsics_between(
    infos: Sequence[Any],
    names: Sequence[str],
    transforms: Sequence[FrameTransform],
    of_file: Mapping[str, Extrinsics],
) -> list[Extrinsics]:
    """Return the extrinsics of each further camera relative to the first one.

    The CameraInfo ``infos`` and the ``names`` are of all cameras, the first one first; ``of_file``
    is by name. Raises CameraError if a camera has no extrinsics, or two sources disagree.
    """
    first_frame, *frames = (str(info.header.frame_id).lstrip("/") for info in infos)
    return [
        choose(
            [
                of_rectified_pair(infos[0], info, name),
                of_transforms(transforms, first_frame, frame),
                of_file.get(name),
            ],
            names[0],
            name,
        )
        for info, name, frame in zip(infos[1:], names[1:], frames, strict=True)
    ]


def choose(found: Sequence[Extrinsics | None], first: str, other: str) -> Extrinsics:
    """Return the first extrinsics that are present: from P, from ``/tf_static``, or from a file.

    Raises CameraError if there are none, if two differ by more than a degree or two centimetres, or
    if the cameras ``first`` and ``other`` are more than 30 m apart.
    """
    there = [extrinsics for extrinsics in found if extrinsics is not None]
    if not there:
        raise CameraError(
            f"the extrinsics of camera {other} relative to {first} are unknown: expected a "
            "rectified pair (P[0,3] of CameraInfo), a rigid transform between their optical frames "
            "on /tf_static, or a file from Kalibr or aniposelib; give --extrinsics FILE, or the "
            "nodes extrinsics_file"
        )
    apart_m = float(np.linalg.norm(there[0].centre_m))
    if not apart_m <= FARTHEST_M:
        raise CameraError(
            f"camera {other} stands {apart_m:.3g} m from {first} ({there[0].source}); expected "
            f"metres, at most {FARTHEST_M:g}: are they millimetres?"
        )
    for one in there[1:]:
        angle_rad, distance_m = there[0].difference(one)
        if np.degrees(angle_rad) > _AGREE_DEG or distance_m > _AGREE_M:
            raise CameraError(
                f"two sources disagree about where camera {other} stands against {first}: "
                f"{there[0]}, but {one}; they differ by {np.degrees(angle_rad):.1f} degrees and "
                f"{100 * distance_m:.1f} cm. Remove the wrong one"
            )
    return there[0]
