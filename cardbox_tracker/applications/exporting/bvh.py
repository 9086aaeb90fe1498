"""The BVH file of a tracked motion, for Blender and other animation programs.

Its axes are X to the left of a person who faces the camera, Y up, Z to the camera, in metres. At
rest, with all rotations 0, the person is upright with hanging arms, so that the rotations of torso,
neck and elbows are the joint angles of :mod:`cardbox_tracker.person.kinematics`, axis by axis. The
bones from the middle of the chest to the shoulders turn about Z alone and lift the shoulders,
which is within 4 mm of the line on which the tracker lifts them. Legs that are not measured hang.
The origin is on the floor below the camera, or is the camera if the floor is not known.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cardbox_tracker.applications.exporting.motion import Motion, floor_below, frames_of, held
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import atomic_path
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.proportions import ANKLE_SHARE, stature_of
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import SKELETON, STATE

_FINGERS_TO_FOREARM = 0.25
# Length of the clavicles in shoulder breadths: so a shoulder that turns about their inner ends is
# within 4 mm of the line on which the model raises it.
_CLAVICLE = 0.43
_TURN_BOW_BEND = ("Yrotation", "Xrotation", "Zrotation")
# As the axes X, Y and Z of the joints.
_SWING = ("Zrotation", "Xrotation", "Yrotation")
_STRIDE = ("Xrotation", "Zrotation", "Yrotation")
# From the ankle to the toes, as a share of the stature.
_TOES = 0.1
_PLACE = ("Xposition", "Yposition", "Zposition")
# The bones of the joints by the beginning of their names.
_BONES = {
    "torso_yaw": "Hips",
    "torso_pitch": "Spine",
    "torso_roll": "Spine",
    "neck": "Neck",
    "shoulder": "Arm",
    "elbow": "ForeArm",
    "hip": "UpLeg",
    "knee": "Leg",
}
_SIDES = (("Left", 1.0), ("Right", -1.0))


class Bone(NamedTuple):
    """A joint of the skeleton."""

    depth: int  #: number of the joints that carry it
    name: str  #: empty for the end of a chain
    #: place in the parent's frame at rest, metres in the axes of the file
    offset_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    channels: tuple[str, ...] = ()  #: values per frame in their order


def skeleton(body: BodyModel) -> list[Bone]:
    """Return the joints of a measured person, each followed by those that it carries."""
    parts, clavicle_m = body_parts(body.sizes), _clavicle_m(body)
    chest_m, stature_m = parts.torso.bottom_m, stature_of(parts)
    places = {joint.name: joint.offset(parts) for joint in SKELETON}
    at = {name: (y, z, x) for name, (x, y, z) in places.items()}
    _, height_m, ahead_m = at["neck_yaw"]
    _, middle_m, forward_m = at["neck"]
    bones = [
        Bone(0, "Hips", channels=(*_PLACE, *_TURN_BOW_BEND)),
        Bone(1, "Spine", channels=_TURN_BOW_BEND),
        Bone(2, "Chest", (0.0, chest_m, 0.0), _TURN_BOW_BEND),
        Bone(3, "Neck", (0.0, height_m - chest_m, ahead_m), _TURN_BOW_BEND),
        Bone(4, "Head", (0.0, middle_m - parts.head.height_m / 2, forward_m), _TURN_BOW_BEND),
        Bone(5, "", (0.0, parts.head.height_m, 0.0)),
    ]
    for side, sign in _SIDES:
        inner_m = sign * (parts.shoulder_aside_m - clavicle_m)
        shoulder = inner_m, parts.shoulder_height_m - chest_m, 0.0
        bones += [
            Bone(3, f"{side}Shoulder", shoulder, _SWING),
            Bone(4, f"{side}Arm", (sign * clavicle_m, 0.0, 0.0), _SWING),
            Bone(5, f"{side}ForeArm", at[f"{side.lower()}_elbow_abduction"], _SWING),
            Bone(6, f"{side}Hand", at[f"{side.lower()}_wrist"], _SWING),
            Bone(7, "", (0.0, _FINGERS_TO_FOREARM * parts.forearm.bottom_m, 0.0)),
        ]
    for side, _ in _SIDES:
        bones += [
            Bone(1, f"{side}UpLeg", at[f"{side.lower()}_hip_flexion"], _STRIDE),
            Bone(2, f"{side}Leg", at[f"{side.lower()}_knee_flexion"], _STRIDE),
            Bone(3, f"{side}Foot", at[f"{side.lower()}_ankle"], _STRIDE),
            Bone(4, "", (0.0, -ANKLE_SHARE * stature_m, _TOES * stature_m)),
        ]
    return bones


def _clavicle_m(body: BodyModel) -> float:
    return _CLAVICLE * body.size("shoulder_breadth")


def channel_values(motion: Motion, body: BodyModel) -> dict[str, FloatArray]:
    """Return values (n, channels), m and deg, of bones in their order; a gap repeats the last."""
    frames, parts = frames_of(motion, body), body_parts(body.sizes)
    channels = {bone.name: bone.channels for bone in skeleton(body) if bone.name}
    count = len(motion.joints)
    values = {name: np.zeros((count, len(of))) for name, of in channels.items()}
    for joint, angle in zip(STATE, motion.joints.T, strict=True):
        what = joint.name.removeprefix(f"{joint.side}_")
        bone = _BONES.get(what) or _BONES.get(what.partition("_")[0])
        if bone is not None:
            bone = joint.side.capitalize() + bone
            sign, channel = sum(joint.axis), _SWING[np.flatnonzero(joint.axis)[0]]
            values[bone][:, channels[bone].index(channel)] = sign * held(angle[:, None])[:, 0]
    for (name, side), arm in zip(_SIDES, (frames.left, frames.right), strict=True):
        local = np.einsum("nji,nj->ni", frames.torso_rotation, arm.shoulder - frames.hip)
        aside = side * local[:, 1] - (parts.shoulder_aside_m - _clavicle_m(body))
        up = local[:, 2] - parts.shoulder_height_m
        lift = held(side * np.arctan2(up, aside)[:, None])[:, 0]
        values[f"{name}Shoulder"][:, 0] = lift
        values[f"{name}Arm"][:, 0] -= lift
    values = {name: np.degrees(of) for name, of in values.items()}
    values["Hips"][:, :3] = held(frames.hip - floor_below(body))[:, [1, 2, 0]]
    return values


def write_bvh(path: Path, motion: Motion, body: BodyModel | None) -> None:
    """Write skeleton and motion at a constant rate; raise CardboxError without body or file."""
    if body is None:
        raise CardboxError(
            "BVH needs the bones of the person: give --model MODEL.yaml, with which the results "
            "were tracked; OUT.body.yaml beside the table OUT.csv is found, and a bag contains it"
        )
    even = motion.evenly()
    values = channel_values(even, body)
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        file.write("HIERARCHY\n" + "\n".join(_hierarchy(skeleton(body))) + "\n")
        file.write(f"MOTION\nFrames: {len(even.joints)}\nFrame Time: {1 / even.rate_hz:.10f}\n")
        for row in np.hstack([*values.values()]):
            file.write(" ".join(f"{value:.6f}" for value in row) + "\n")


def _hierarchy(bones: Sequence[Bone]) -> Iterator[str]:
    """Yield the lines of the joints; each block ends before the next one that it does not carry."""
    for bone, after in zip(bones, [*(one.depth for one in bones[1:]), 0], strict=True):
        indent = "\t" * bone.depth
        title = f"{'JOINT' if bone.depth else 'ROOT'} {bone.name}" if bone.name else "End Site"
        yield f"{indent}{title}"
        yield f"{indent}{{"
        yield f"{indent}\tOFFSET " + " ".join(f"{value + 0.0:.6f}" for value in bone.offset_m)
        if bone.name:
            yield f"{indent}\tCHANNELS {len(bone.channels)} {' '.join(bone.channels)}"
        for depth in range(bone.depth, after - 1, -1):
            yield "\t" * depth + "}"
