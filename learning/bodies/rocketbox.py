"""Bodies of the Microsoft Rocketbox avatar library: 115 clothed adults and children.

The library is at https://github.com/microsoft/Microsoft-Rocketbox; its authors released it under
the MIT licence in November 2020, and copies from before carry other terms. There are four
skeletons, of men, women, boys and girls (four women have that of the men); the meshes differ.

``python -m learning.bodies.rocketbox FOLDER_OF_FBX OUTPUT_FOLDER`` converts the avatars. It calls
``FBX2glTF``, which ``npm install fbx2gltf`` brings.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from learning.bodies.glb import SkinnedMesh, read_glb
from learning.bodies.rigged import INDEX, FloatArray, RiggedBody, strongest
from learning.bodies.t_pose import turns_to_t_pose, yaw_forward
from learning.segments import SEGMENTS

FAMILY = "rocketbox"

_TO_OUR_AXES = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
"""Their x is our y, their y our z, their z our x."""

_SKULL_ABOVE_EYES = 0.067
"""Height of a bald skull above the eyes, divided by the height of the eyes above the floor:
the lowest of the library (caps of hair, no hat) are 0.11 m in adults whose eyes are at 1.6 m."""

_TRUNK = {
    "Pelvis": ("hips",),
    "Spine": ("spine",),
    "Spine1": ("spine", "chest"),
    "Spine2": ("chest",),
    "Neck": ("neck",),
}
_LIMBS = {
    "Clavicle": "collar",
    "UpperArm": "upper_arm",
    "Forearm": "forearm",
    "Hand": "hand",
    "Finger": "hand",
    "Thigh": "thigh",
    "Calf": "shin",
    "Foot": "foot",
    "Toe": "foot",
}
_JOINTS = {"hips": "Pelvis", "spine": "Spine", "neck": "Neck", "head": "Head"}


def body_of(mesh: SkinnedMesh, name: str) -> RiggedBody:
    """Return the body of an avatar's mesh.

    Raises:
        ValueError: the mesh lacks a bone of a biped.
    """
    places = {_plain(bone): _TO_OUR_AXES @ place for bone, place in mesh.places.items()}
    try:
        joints, knuckles, across = _skeleton(places)
        eyes = (places["LEye"] + places["REye"]) / 2
    except KeyError as error:
        raise ValueError(f"{name} has no bone {error}") from error
    vertices, faces, weights = _welded(mesh)
    to_t_pose = turns_to_t_pose(joints, knuckles, across)
    for side in ("left", "right"):
        foot = INDEX[f"{side}_foot"]
        to_t_pose[foot] = yaw_forward(places[f"{side[0].upper()} Toe0"], joints[foot])
    head = joints[INDEX["head"]]
    crown = eyes[2] * (1 + _SKULL_ABOVE_EYES)
    centre = np.array([(head[0] + eyes[0]) / 2, 0.0, (head[2] + crown) / 2])
    bones, shares = strongest(weights)
    return RiggedBody(
        name=name,
        family=FAMILY,
        sex="female" if "Female" in name else "male",
        vertices=vertices.astype(np.float32),
        faces=faces.astype(np.int32),
        bones=bones,
        shares=shares,
        joints=joints.astype(np.float32),
        knuckles=knuckles.astype(np.float32),
        head_centre=centre.astype(np.float32),
        to_t_pose=to_t_pose,
        colours=np.full((len(vertices), 3), 128, np.uint8),
    )


def _plain(bone: str) -> str:
    """Return the name of a bone without the number of its biped, as in "Bip01 L Hand"."""
    return bone.partition(" ")[2] if bone.startswith("Bip") else bone


def _skeleton(
    places: dict[str, NDArray[np.float64]],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return joints (segments, 3), knuckles (2, 3), and from index to little finger (2, 3)."""
    joints = np.zeros((len(SEGMENTS), 3), np.float32)
    for segment, bone in _JOINTS.items():
        joints[INDEX[segment]] = places[bone]
    joints[INDEX["chest"]] = (places["Spine1"] + places["Spine2"]) / 2
    knuckles, across = np.zeros((2, 3), np.float32), np.zeros((2, 3), np.float32)
    for row, (side, letter) in enumerate((("left", "L"), ("right", "R"))):
        for bone, part in _LIMBS.items():
            # Fingers and toes move with the hand and the foot.
            if bone not in ("Finger", "Toe"):
                joints[INDEX[f"{side}_{part}"]] = places[f"{letter} {bone}"]
        fingers = [places[f"{letter} Finger{finger}"] for finger in (1, 2, 3, 4)]
        knuckles[row] = np.mean(fingers, axis=0)
        across[row] = fingers[3] - fingers[0]
    joints[0] = (joints[INDEX["left_thigh"]] + joints[INDEX["right_thigh"]]) / 2
    return joints, knuckles, across


def _segments_of(bone: str) -> tuple[str, ...]:
    """Return the segments that share the weights of a bone; bones of the face move the head."""
    letter, _, limb = _plain(bone).partition(" ")
    if limb:
        stem = limb.rstrip("0123456789")
        return (f"{'left' if letter == 'L' else 'right'}_{_LIMBS[stem]}",)
    return _TRUNK.get(letter, ("head",))


def _welded(
    mesh: SkinnedMesh,
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    """Return vertices in our axes without the copies at seams, faces, and weights of segments."""
    weights = np.zeros((len(mesh.vertices), len(SEGMENTS)))
    for column, bone in enumerate(mesh.joints):
        names = _segments_of(bone)
        for name in names:
            weights[:, INDEX[name]] += mesh.weights[:, column] / len(names)
    keys = np.round(mesh.vertices * 1e5).astype(np.int64)
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    faces = inverse.reshape(-1)[mesh.faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    return mesh.vertices[first] @ _TO_OUR_AXES.T, faces, weights[first]


def converted(fbx: Path, program: str) -> RiggedBody:
    """Return the avatar of an FBX file.

    Args:
        fbx: the file.
        program: path of the program FBX2glTF.

    Raises:
        subprocess.CalledProcessError: the program failed.
        ValueError: the file is no avatar.
    """
    with tempfile.TemporaryDirectory() as folder:
        glb = Path(folder) / "avatar.glb"
        command = [program, "--binary", "--input", str(fbx), "--output", str(glb)]
        subprocess.run(command, check=True, capture_output=True)
        return body_of(read_glb(glb, "hipoly"), fbx.stem)


def main() -> None:
    """Convert all avatars of a folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("avatars", type=Path, help="folder that contains the FBX files")
    parser.add_argument("output", type=Path, help="folder for one file (.npz) per avatar")
    parser.add_argument("--fbx2gltf", default="FBX2glTF", help="path of the program FBX2glTF")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    # Later versions of the library hold each avatar a second time, with blend shapes.
    files = [p for p in sorted(arguments.avatars.rglob("*.fbx")) if "_facial" not in p.stem]
    for fbx in files:
        body = converted(fbx, arguments.fbx2gltf)
        body.saved(arguments.output / f"{body.name}.npz")
    print(f"{len(files)} avatars are in {arguments.output}")


if __name__ == "__main__":
    main()
