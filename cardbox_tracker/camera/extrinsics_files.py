"""Reads and writes extrinsics: camchains of Kalibr (YAML), camera groups of aniposelib (TOML)."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import yaml

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.extrinsics import FARTHEST_M, Extrinsics
from cardbox_tracker.common.errors import CameraError, cut
from cardbox_tracker.common.files import atomic_path, foreign
from cardbox_tracker.common.small_yaml import parse_small_yaml, read_small_text

_EXPECTED = "a camchain of Kalibr (YAML with T_cn_cnm1) or a camera group of aniposelib (TOML)"


def load_extrinsics(path: str | os.PathLike[str], cameras: Sequence[str]) -> dict[str, Extrinsics]:
    """Return the extrinsics of each further camera relative to the first one, by its name.

    The file is a camchain of Kalibr or a TOML file of aniposelib. A camera is found by its name in
    it; in a camchain the first part of its ``rostopic`` is a name, too, and counts if it is another
    camera's key. Lengths are metres; a TOML file whose cameras would be more than 30 m apart is
    read as millimetres.

    Raises CameraError if the file cannot be read, lacks a camera, or has no rigid transforms.
    """
    name = os.fspath(path)
    with foreign(path, CameraError, _EXPECTED):
        text = read_small_text(path)
        data = tomllib.loads(text) if name.endswith(".toml") else parse_small_yaml(text)
        entries = data if isinstance(data, Mapping) else {}
        entries = {str(key): entry for key, entry in entries.items() if isinstance(entry, Mapping)}
        poses = _aniposelib(entries, name) if name.endswith(".toml") else _camchain(entries, name)
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
    with atomic_path(path) as temporary:
        temporary.write_text(yaml.safe_dump(chain, default_flow_style=None), encoding="utf-8")


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
    poses = {
        str(entry.get("name", key)): Extrinsics.of_vectors(
            entry["rotation"], entry["translation"], f"{name}, {key}"
        )
        for key, entry in entries.items()
        if "rotation" in entry and "translation" in entry
    }
    centres = np.array([pose.centre_m for pose in poses.values()]).reshape(-1, 3)
    # aniposelib uses the unit of its board, usually millimetres.
    if len(centres) and np.ptp(centres, axis=0).max() > FARTHEST_M:
        return {
            key: Extrinsics(pose.rotation, pose.translation_m / 1000.0, pose.source)
            for key, pose in poses.items()
        }
    return poses
