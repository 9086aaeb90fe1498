"""A reader of the parts of binary glTF 2.0 that a skinned mesh needs."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_TYPES = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


@dataclass(frozen=True)
class SkinnedMesh:
    """One skinned mesh in the axes of its file.

    ``vertices`` (v, 3) are at rest, ``faces`` (f, 3) index them, ``weights`` (v, joints) belong to
    the nodes ``joints``; ``places`` gives the position (3,) of every node by its name.
    """

    vertices: FloatArray
    faces: NDArray[np.int64]
    weights: FloatArray
    joints: list[str]
    places: dict[str, FloatArray]


def read_glb(path: str | Path, wanted: str) -> SkinnedMesh:
    """Return the first mesh whose node's name contains ``wanted``.

    Raises:
        ValueError: the file is not binary glTF, or has no such mesh.
    """
    document, data = _chunks(Path(path).read_bytes())
    worlds = _worlds(document)
    nodes = document["nodes"]
    found = [n for n, node in enumerate(nodes) if "skin" in node and wanted in node["name"]]
    if not found:
        raise ValueError(f"{path} has no skinned mesh with {wanted!r} in its name")
    node = nodes[found[0]]
    joints = document["skins"][node["skin"]]["joints"]
    vertices, faces, weights, first = [], [], [], 0
    for primitive in document["meshes"][node["mesh"]]["primitives"]:
        names = primitive["attributes"]
        place = _array(document, data, names["POSITION"]).astype(np.float64)
        dense = np.zeros((len(place), len(joints)))
        used = _array(document, data, names["JOINTS_0"]).astype(np.int64)
        shares = _array(document, data, names["WEIGHTS_0"])
        np.add.at(dense, (np.arange(len(place))[:, None], used), shares)
        vertices.append(place)
        weights.append(dense)
        faces.append(first + _array(document, data, primitive["indices"]).reshape(-1, 3))
        first += len(place)
    world = worlds[found[0]]
    return SkinnedMesh(
        np.concatenate(vertices) @ world[:3, :3].T + world[:3, 3],
        np.concatenate(faces).astype(np.int64),
        np.concatenate(weights),
        [nodes[joint]["name"] for joint in joints],
        {node["name"]: worlds[n][:3, 3] for n, node in enumerate(nodes)},
    )


def _chunks(content: bytes) -> tuple[dict[str, Any], bytes]:
    if content[:4] != b"glTF":
        raise ValueError("the file is not binary glTF")
    (length,) = struct.unpack_from("<I", content, 12)
    return json.loads(content[20 : 20 + length]), content[28 + length :]


def _array(document: dict[str, Any], data: bytes, index: int) -> NDArray[Any]:
    """Return the values of an accessor, (n, width)."""
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    kind, width = np.dtype(_TYPES[accessor["componentType"]]), _WIDTHS[accessor["type"]]
    step = view.get("byteStride", kind.itemsize * width)
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    shape, strides = (accessor["count"], width), (step, kind.itemsize)
    return np.ndarray(shape, kind, data, start, strides).copy()


def _worlds(document: dict[str, Any]) -> dict[int, FloatArray]:
    """Return the transform (4, 4) of each node of the scene."""
    worlds: dict[int, FloatArray] = {}
    waiting = [(root, np.eye(4)) for root in document["scenes"][document.get("scene", 0)]["nodes"]]
    while waiting:
        index, parent = waiting.pop()
        node = document["nodes"][index]
        worlds[index] = parent @ _local(node)
        waiting += [(child, worlds[index]) for child in node.get("children", [])]
    return worlds


def _local(node: dict[str, Any]) -> FloatArray:
    if "matrix" in node:
        return np.array(node["matrix"]).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    local = np.eye(4)
    local[:3, :3] = np.eye(3) + 2 * w * cross + 2 * cross @ cross
    local[:3, :3] *= np.array(node.get("scale", (1, 1, 1)))
    local[:3, 3] = node.get("translation", (0, 0, 0))
    return local
