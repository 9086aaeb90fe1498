from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from learning.bodies.glb import SkinnedMesh, read_glb
from learning.bodies.rigged import INDEX
from learning.bodies.rocketbox import body_of

TO_THEIRS = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]])


def write_glb(path: Path) -> None:
    """A triangle of one joint, 1 m up, below a node that turns x to y."""
    places = np.float32([[0, 0, 0], [1, 0, 0], [0, 0, 1]]).tobytes()
    joints = np.uint16([[0, 0, 0, 0]] * 3).tobytes()
    weights = np.float32([[1, 0, 0, 0]] * 3).tobytes()
    faces = np.uint16([0, 1, 2, 0]).tobytes()
    parts, views, start = (places, joints, weights, faces), [], 0
    for part in parts:
        views.append({"buffer": 0, "byteOffset": start, "byteLength": len(part)})
        start += len(part)
    kinds = ((5126, "VEC3", 3), (5123, "VEC4", 3), (5126, "VEC4", 3), (5123, "SCALAR", 3))
    accessors = [
        {"bufferView": n, "componentType": kind, "type": shape, "count": count}
        for n, (kind, shape, count) in enumerate(kinds)
    ]
    half = np.sqrt(0.5)
    attributes = {"POSITION": 0, "JOINTS_0": 1, "WEIGHTS_0": 2}
    document = {
        "scenes": [{"nodes": [0, 2]}],
        "nodes": [
            {"name": "root", "translation": [0, 1, 0], "children": [1]},
            {"name": "bone", "translation": [0, 0, 2]},
            {"name": "a_hipoly", "rotation": [0, 0, half, half], "mesh": 0, "skin": 0},
        ],
        "skins": [{"joints": [1]}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 3}]}],
        "accessors": accessors,
        "bufferViews": views,
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    data = b"".join(parts)
    head = struct.pack("<4sIIII", b"glTF", 2, 28 + len(text) + len(data), len(text), 0x4E4F534A)
    path.write_bytes(head + text + struct.pack("<II", len(data), 0x004E4942) + data)


def test_a_mesh_is_read_in_the_axes_of_the_scene(tmp_path: Path) -> None:
    write_glb(tmp_path / "a.glb")
    mesh = read_glb(tmp_path / "a.glb", "hipoly")
    assert mesh.vertices == pytest.approx(np.array([[0, 0, 0], [0, 1, 0], [0, 0, 1]]), abs=1e-6)
    assert mesh.faces.tolist() == [[0, 1, 2]]
    assert mesh.joints == ["bone"]
    assert mesh.weights.tolist() == [[1], [1], [1]]
    assert mesh.places["bone"] == pytest.approx([0, 1, 2])


def test_other_files_are_refused(tmp_path: Path) -> None:
    write_glb(tmp_path / "a.glb")
    with pytest.raises(ValueError, match="lowpoly"):
        read_glb(tmp_path / "a.glb", "lowpoly")
    (tmp_path / "b.glb").write_bytes(b"FBX" * 20)
    with pytest.raises(ValueError, match="binary glTF"):
        read_glb(tmp_path / "b.glb", "hipoly")


def avatar() -> SkinnedMesh:
    """A biped in our axes, turned to theirs; its seam has two copies of one vertex."""
    places = {
        "Pelvis": (0, 0, 0.9),
        "Spine": (0, 0, 1.0),
        "Spine1": (0, 0, 1.1),
        "Spine2": (0, 0, 1.3),
        "Neck": (0, 0, 1.45),
        "Head": (0, 0, 1.5),
    }
    for letter, out in (("L", 1), ("R", -1)):
        places |= {
            f"{letter}Eye": (0.08, 0.03 * out, 1.6),
            f"{letter} Clavicle": (-0.03, 0.05 * out, 1.4),
            f"{letter} UpperArm": (-0.03, 0.2 * out, 1.4),
            f"{letter} Forearm": (-0.03, 0.4 * out, 1.2),
            f"{letter} Hand": (0.05, 0.55 * out, 1.05),
            f"{letter} Thigh": (0, 0.1 * out, 0.9),
            f"{letter} Calf": (0, 0.1 * out, 0.5),
            f"{letter} Foot": (0, 0.1 * out, 0.1),
            f"{letter} Toe0": (0.1, 0.15 * out, 0.0),
        }
        for finger in range(1, 5):
            across = 0.02 * (2.5 - finger)
            places[f"{letter} Finger{finger}"] = (0.05 + across, 0.62 * out, 0.98)
    theirs = {f"Bip02 {name}": TO_THEIRS @ np.array(place) for name, place in places.items()}
    soles = [(0, 0.1, 0), (0.1, 0.1, 0), (0, 0.15, 0), (0, 0.15, 0), (0.1, 0.1, 0), (0.1, 0.2, 0)]
    joints = ["Bip02 L Foot", "Bip02 Spine1"]
    weights = np.array([[0.5, 0.5]] * len(soles))
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    return SkinnedMesh(np.array(soles) @ TO_THEIRS.T, faces, weights, joints, theirs)


def test_an_avatar_becomes_a_body() -> None:
    body = body_of(avatar(), "Female_Adult_99")
    assert (body.name, body.sex, len(body.vertices)) == ("Female_Adult_99", "female", 4)
    posed = body.in_t_pose()
    upper, fore = 0.2 * np.sqrt(2), np.sqrt(0.08**2 + 2 * 0.15**2)
    arm = posed.keypoints[:3]
    assert arm[0] == pytest.approx([-0.03, 0.2, 1.4], abs=1e-5)
    assert arm[1] == pytest.approx([-0.03, 0.2 + upper, 1.4], abs=1e-5)
    assert arm[2] == pytest.approx([-0.03, 0.2 + upper + fore + 0.07 * np.sqrt(2), 1.4], abs=1e-5)
    # The skin is a foot by half, and trunk by half: a quarter for spine, a quarter for chest.
    assert body.weights[:, INDEX["left_foot"]] == pytest.approx(np.full(4, 0.5))
    assert body.weights[:, INDEX["chest"]] == pytest.approx(np.full(4, 0.25))


def test_a_mesh_without_a_biped_is_refused() -> None:
    mesh = avatar()
    mesh.places.pop("Bip02 R Forearm")
    with pytest.raises(ValueError, match="R Forearm"):
        body_of(mesh, "Male_Adult_99")
