"""Reads extrinsics from CameraInfo, ``/tf_static`` and files, chooses one, and writes camchains.

The projection matrices of a rectified pair come first, then the transforms on ``/tf_static``, then
a file: a camchain of Kalibr (YAML), a camera group of aniposelib (TOML) or what OpenCV's
stereoCalibrate finds (FileStorage). All sources that are present have to agree.
"""

from __future__ import annotations

import math
import os
import tomllib
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray

from cardbox_tracker.camera.calibration_file import parsed_storage
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.camera_info import info_array
from cardbox_tracker.camera.extrinsics import FARTHEST_M, Extrinsics
from cardbox_tracker.common.errors import CameraError, cut
from cardbox_tracker.common.files import foreign, write_file
from cardbox_tracker.common.small_yaml import read_small_text

# Two sources that differ by more do not belong to the same calibration.
_AGREE_DEG, _AGREE_M = 1.0, 0.02
# Calibrations that were optimized can have more than half a turn, but not a whole one.
_MOST_TURN_RAD = 2 * math.pi


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
    if the cameras ``first`` and ``other`` are at one place or more than 30 m apart.
    """
    there = [extrinsics for extrinsics in found if extrinsics is not None]
    if not there:
        raise CameraError(
            f"the extrinsics of camera {other} relative to {first} are unknown: expected a "
            "rectified pair (P[0,3] of CameraInfo), a rigid transform between their optical frames "
            "on /tf_static, or a file from Kalibr, aniposelib or OpenCV; give --extrinsics FILE, "
            "or the nodes extrinsics_file"
        )
    there[0].check()
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


_EXPECTED = (
    "a camchain of Kalibr (YAML with T_cn_cnm1), a camera group of aniposelib (TOML), or, of two "
    "cameras, R and T of OpenCV's stereoCalibrate (FileStorage)"
)


def load_extrinsics(path: str | os.PathLike[str], cameras: Sequence[str]) -> dict[str, Extrinsics]:
    """Return the extrinsics of each further camera relative to the first one, by its name.

    The file is a camchain of Kalibr, a TOML file of aniposelib, or YAML, XML or JSON of OpenCV's
    FileStorage with R and T, the pose of the second of two cameras. In the first two, a camera is
    found by its name; in a camchain the first part of its ``rostopic`` is a name, too, and counts
    if it is another camera's key. Lengths are metres; a file of aniposelib or OpenCV whose cameras
    would be more than 30 m apart is read as millimetres.

    Raises CameraError if the file cannot be read, lacks a camera, or has no rigid transforms.
    """
    name = os.fspath(path)
    with foreign(path, CameraError, _EXPECTED):
        text = read_small_text(path)
        is_toml = name.lower().endswith(".toml")
        data = tomllib.loads(text) if is_toml else parsed_storage(text)
        entries = data if isinstance(data, Mapping) else {}
        entries = {str(key): entry for key, entry in entries.items() if isinstance(entry, Mapping)}
        if is_toml:
            poses = _metres(_aniposelib(entries, name))
        elif isinstance(data, Mapping) and {"R", "T"} <= data.keys():
            poses = _metres(_stereo(data, name, cameras))
        else:
            poses = _camchain(entries, name)
    missing = [camera for camera in cameras if camera.strip("/") not in poses]
    if missing:
        raise CameraError(
            f"the extrinsics {name} have no camera {', '.join(missing)}; they have "
            f"{cut(', '.join(sorted(poses))) or 'none'}: expected {_EXPECTED} with these names"
        )
    back = poses[cameras[0].strip("/")].inverse()
    return {camera: poses[camera.strip("/")].after(back) for camera in cameras[1:]}


def save_camchain(
    path: str | os.PathLike[str],
    cameras: Mapping[str, Camera],
    extrinsics: Mapping[str, Extrinsics],
) -> None:
    """Write a camchain as Kalibr does, which :func:`load_extrinsics` reads.

    ``cameras`` have no lens distortion and are by namespace, the first one first, as are the
    ``extrinsics`` of the further ones. Raises CardboxError if the file cannot be written.
    """
    chain: dict[str, Any] = {}
    before = Extrinsics(np.eye(3), np.zeros(3))
    for number, (name, camera) in enumerate(cameras.items()):
        entry: dict[str, Any] = {}
        if number:
            step = extrinsics[name].after(before.inverse())
            rows = np.column_stack([step.rotation, step.translation_m])
            matrix = np.vstack([rows, [0.0, 0.0, 0.0, 1.0]])
            entry["T_cn_cnm1"] = [[round(float(v), 9) for v in row] for row in matrix]
            before = extrinsics[name]
        entry |= {
            "camera_model": "pinhole",
            "distortion_coeffs": [0.0, 0.0, 0.0, 0.0],
            "distortion_model": "radtan",
            "intrinsics": [
                round(float(v), 4) for v in (camera.fx, camera.fy, camera.cx, camera.cy)
            ],
            "resolution": [camera.width, camera.height],
            "rostopic": f"/{name.strip('/')}/image_raw",
        }
        chain[f"cam{number}"] = entry
    write_file(path, yaml.safe_dump(chain, default_flow_style=None))


def _camchain(entries: Mapping[str, Mapping[str, Any]], name: str) -> dict[str, Extrinsics]:
    """Return transforms from the chain's first camera into each camera, by key and by topic."""
    poses: dict[str, Extrinsics] = {}
    of_topics: dict[str, Extrinsics] = {}
    # cam0, cam1, ..., cam10
    chain = sorted(entries, key=lambda key: (len(key), key))
    pose = Extrinsics(np.eye(3), np.zeros(3), name)
    for number, key in enumerate(chain):
        entry = entries[key]
        if number:
            if "T_cn_cnm1" not in entry:
                raise CameraError(f"the extrinsics {name}: {key} lacks T_cn_cnm1; give {_EXPECTED}")
            pose = Extrinsics.of(entry["T_cn_cnm1"], f"{name}, {key}").after(pose)
        poses[key] = pose
        topic = str(entry.get("rostopic", "")).strip("/").removesuffix("/compressed")
        of_topics.setdefault(topic.rpartition("/")[0] or key, pose)
    # Kalibr numbers the cameras in the order of the chain, so a namespace may be another's key.
    return poses | of_topics


def _aniposelib(entries: Mapping[str, Mapping[str, Any]], name: str) -> dict[str, Extrinsics]:
    """Return transforms from the world frame of the file into each camera, by name."""
    poses = {}
    for key, entry in entries.items():
        if "rotation" in entry and "translation" in entry:
            place, turn = f"{name}, {key}", entry["rotation"]
            pose = Extrinsics.of_vectors(turn, entry["translation"], place)
            if (turn_rad := float(np.linalg.norm(np.asarray(turn, np.float64)))) > _MOST_TURN_RAD:
                raise CameraError(
                    f"{place}: the rotation vector is {turn_rad:.3g} rad long; expected at most "
                    f"{_MOST_TURN_RAD:.3g}: are these degrees?"
                )
            poses[str(entry.get("name", key))] = pose
    return poses


def _stereo(data: Mapping[str, Any], name: str, cameras: Sequence[str]) -> dict[str, Extrinsics]:
    """Return the poses of two cameras, which the file does not name."""
    if len(cameras) != 2:
        raise CameraError(
            f"the extrinsics {name} have R and T, the pose of one further camera; expected that of "
            f"{len(cameras) - 1}: give {_EXPECTED}"
        )
    values = (data[key] for key in "RT")
    turn, move = (
        np.array(one["data"] if isinstance(one, Mapping) else one, np.float64) for one in values
    )
    matrix = np.column_stack([turn.reshape(3, 3), move.reshape(3)])
    poses = Extrinsics(np.eye(3), np.zeros(3)), Extrinsics.of(matrix, f"{name}, R and T")
    return {camera.strip("/"): pose for camera, pose in zip(cameras, poses, strict=True)}


def _metres(poses: dict[str, Extrinsics]) -> dict[str, Extrinsics]:
    """Return the poses in metres: boards are usually given in millimetres."""
    centres = np.array([pose.centre_m for pose in poses.values()]).reshape(-1, 3)
    scale = 1000.0 if len(poses) and np.ptp(centres, axis=0).max() > FARTHEST_M else 1.0
    return {
        key: Extrinsics(pose.rotation, pose.translation_m / scale, pose.source)
        for key, pose in poses.items()
    }
