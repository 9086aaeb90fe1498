"""Reader of Acclaim's motion capture: a skeleton (ASF) and its motions (AMC)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from learning.motions.capture import Capture
from learning.motions.rotations import FloatArray, about_axis, swing

FPS = 30.0
"""Frames a second that the readers keep, as nearly as whole steps allow."""
CMU_FPS = 120.0
"""Frames a second of the CMU database; its AMC files do not say it."""
UPRIGHT_PITCH_DEG = {"lowerneck": -16.0, "head": 16.0}
DOWN = (0.0, -1.0, 0.0)


@dataclass(frozen=True)
class Bone:
    """A bone of a skeleton.

    Args:
        along: from its start to its end (3,), in the skeleton's unit, when every angle is zero.
        axes: rotation (3, 3) of the axes about which the angles turn.
        channels: names of the numbers of a frame, such as "rx".
        parent: name of the bone before it; empty for the root.
    """

    along: FloatArray
    axes: FloatArray
    channels: tuple[str, ...]
    parent: str


def stride(fps: float) -> int:
    """Return the step in frames that comes nearest to :data:`FPS`."""
    return max(1, round(fps / FPS))


def turned_xyz(angles_deg: FloatArray) -> FloatArray:
    """Return rotations (..., 3, 3) about the fixed axes x, then y, then z, by (..., 3), deg."""
    x, y, z = (about_axis(k, np.radians(angles_deg[..., k])) for k in range(3))
    return np.asarray(z @ y @ x)


def read_asf(path: Path) -> dict[str, Bone]:
    """Return the bones of an ASF file by name, parents first.

    Raises:
        OSError: if the file cannot be read.
        ValueError: if it has no hierarchy.
    """
    head, found, tail = path.read_text().partition(":hierarchy")
    if not found:
        raise ValueError(f"{path} has no hierarchy.")
    described: dict[str, dict[str, list[str]]] = {}
    for block in head.partition(":bonedata")[2].split("begin")[1:]:
        words = {line.split()[0]: line.split()[1:] for line in block.splitlines() if line.split()}
        described[words["name"][0]] = words
    root = Bone(np.zeros(3), np.eye(3), ("tx", "ty", "tz", "rx", "ry", "rz"), "")
    bones = {"root": root}
    for parent, *children in (line.split() for line in tail.splitlines() if line.split()):
        for child in children if parent in bones else ():
            words = described[child]
            direction = np.array(words["direction"][:3], dtype=float)
            bones[child] = Bone(
                along=direction * float(words["length"][0]),
                axes=turned_xyz(np.array(words["axis"][:3], dtype=float)),
                channels=tuple(words.get("dof", ())),
                parent=parent,
            )
    return bones


def read_amc(path: Path) -> Capture:
    """Return the capture of an AMC file, whose ASF file has the subject's name beside it.

    Raises:
        OSError: if one of the files cannot be read.
        ValueError: if one is not of its form.
    """
    bones = read_asf(path.with_name(f"{path.stem.split('_')[0]}.asf"))
    names = tuple(bones)
    frames = read_frames(path)[:: stride(CMU_FPS)]
    turns = np.tile(np.eye(3), (len(frames), len(names), 1, 1))
    for joint, (name, bone) in enumerate(bones.items()):
        angles = np.zeros((len(frames), 3))
        for column, channel in enumerate(bone.channels):
            if channel.startswith("r"):
                angles[:, "xyz".index(channel[1])] = [frame[name][column] for frame in frames]
        turns[:, joint] = bone.axes @ turned_xyz(angles) @ bone.axes.T
    return Capture(
        names=names,
        parents=tuple(names.index(b.parent) if b.parent else -1 for b in bones.values()),
        offsets=np.array([bones[b.parent or "root"].along for b in bones.values()]),
        rest=t_pose(bones),
        turns=turns,
        root=np.array([frame["root"][:3] for frame in frames]),
        fps=CMU_FPS / stride(CMU_FPS),
    )


def read_frames(path: Path) -> list[dict[str, list[float]]]:
    """Return the numbers of every bone in every frame of an AMC file.

    Raises:
        ValueError: if there is no frame.
    """
    frames: list[dict[str, list[float]]] = []
    for words in (line.split() for line in path.read_text().splitlines()):
        if words and words[0].isdigit():
            frames.append({})
        elif frames and words:
            frames[-1][words[0]] = [float(word) for word in words[1:]]
    if not frames:
        raise ValueError(f"{path} has no frames.")
    return frames


def t_pose(bones: dict[str, Bone]) -> FloatArray:
    """Return world rotations (bones, 3, 3) of a T-pose.

    Zero angles would splay the legs, pull the neck back and let the face look down.
    """
    rest = np.tile(np.eye(3), (len(bones), 1, 1))
    for joint, name in enumerate(bones):
        if name[1:] in ("femur", "tibia", "foot", "toes"):
            rest[joint] = swing(bones[f"{name[0]}femur"].along, DOWN)
        elif name in UPRIGHT_PITCH_DEG:
            rest[joint] = about_axis(0, np.radians(UPRIGHT_PITCH_DEG[name]))
    return rest
