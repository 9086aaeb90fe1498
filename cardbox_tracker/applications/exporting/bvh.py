"""The BVH file of a tracked motion, for Blender and other animation programs.

Its axes are X to the left of a person who faces the camera, Y up, Z to the camera, in metres. At
rest, with all rotations 0, the person is upright with hanging arms, so that the rotations of torso,
neck and elbows are the joint angles of :mod:`cardbox_tracker.person.kinematics`, axis by axis. The
bones from the middle of the chest to the shoulders turn about Z alone and lift the shoulders,
which is within 4 mm of the line on which the tracker lifts them. Legs that are not measured hang.
The origin is on the floor below the camera, or is the camera if the floor is not known.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from cardbox_tracker.applications.exporting.motion import Motion, floor_below, frames_of, held
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import atomic_path
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.proportions import (
    ANKLE_SHARE,
    HIP_SHARE,
    SHANK_SHARE,
    THIGH_SHARE,
    stature_of,
)
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import STATE, head_from_pivot_m, neck_pivot_m

_FINGERS_TO_FOREARM = 0.25
# Length of the clavicles in shoulder breadths: so a shoulder that turns about their inner ends is
# within 4 mm of the line on which the model raises it.
_CLAVICLE = 0.43
_TURN_BOW_BEND = ("Yrotation", "Xrotation", "Zrotation")
_SWING = ("Zrotation", "Xrotation", "Yrotation")
_STRIDE = ("Xrotation", "Zrotation", "Yrotation")
# From the ankle to the toes, as a share of the stature.
_TOES = 0.1
_PLACE = ("Xposition", "Yposition", "Zposition")
# Rotations about the axes X, Y and Z of the joints, and the bones of the joints by the beginning of
# their names.
_CHANNELS = ("Zrotation", "Xrotation", "Yrotation")
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
    """A joint of the skeleton and what hangs on it."""

    name: str  #: name of the joint; empty for the end of a chain
    #: place in the parent's frame at rest, metres in the axes of the file
    offset_m: tuple[float, float, float]
    channels: tuple[str, ...] = ()  #: values per frame in their order
    children: tuple[Bone, ...] = ()  #: the next joints


def skeleton(body: BodyModel) -> Bone:
    """Return the root of the skeleton of a measured person."""
    parts = body_parts(body.sizes)
    clavicle_m = _clavicle_m(body)
    pivot_x, _, pivot_z = neck_pivot_m(parts)
    head_x, _, head_z = head_from_pivot_m(parts)
    chin = 0.0, head_z - parts.head.height_m / 2, head_x
    crown = Bone("", (0.0, parts.head.height_m, 0.0))
    head = Bone("Head", chin, _TURN_BOW_BEND, (crown,))
    neck = Bone("Neck", (0.0, pivot_z - parts.torso.bottom_m, pivot_x), _TURN_BOW_BEND, (head,))
    arms = []
    for side, sign in _SIDES:
        fingers = Bone("", (0.0, -_FINGERS_TO_FOREARM * parts.forearm.height_m, 0.0))
        hand = Bone(f"{side}Hand", (0.0, -parts.forearm.height_m, 0.0), _SWING, (fingers,))
        elbow = 0.0, -parts.upper_arm.height_m, 0.0
        forearm = Bone(f"{side}ForeArm", elbow, _SWING, (hand,))
        arm = Bone(f"{side}Arm", (sign * clavicle_m, 0.0, 0.0), _SWING, (forearm,))
        inner_m = sign * (parts.shoulder_aside_m - clavicle_m)
        inner = inner_m, parts.shoulder_height_m - parts.torso.bottom_m, 0.0
        arms.append(Bone(f"{side}Shoulder", inner, _SWING, (arm,)))
    chest = Bone("Chest", (0.0, parts.torso.bottom_m, 0.0), _TURN_BOW_BEND, (neck, *arms))
    spine = Bone("Spine", (0.0, 0.0, 0.0), _TURN_BOW_BEND, (chest,))
    stature_m = stature_of(parts)
    legs = []
    for side, sign in _SIDES:
        toes = Bone("", (0.0, -ANKLE_SHARE * stature_m, _TOES * stature_m))
        foot = Bone(f"{side}Foot", (0.0, -SHANK_SHARE * stature_m, 0.0), _STRIDE, (toes,))
        shank = Bone(f"{side}Leg", (0.0, -THIGH_SHARE * stature_m, 0.0), _STRIDE, (foot,))
        legs.append(
            Bone(f"{side}UpLeg", (sign * HIP_SHARE * stature_m, 0.0, 0.0), _STRIDE, (shank,))
        )
    return Bone("Hips", (0.0, 0.0, 0.0), (*_PLACE, *_TURN_BOW_BEND), (spine, *legs))


def _clavicle_m(body: BodyModel) -> float:
    return _CLAVICLE * body.size("shoulder_breadth")


def channel_values(motion: Motion, body: BodyModel) -> dict[str, FloatArray]:
    """Return values (n, channels), m and deg, of bones in their order; a gap repeats the last."""
    frames, parts = frames_of(motion, body), body_parts(body.sizes)
    channels = {bone.name: bone.channels for bone in _in_order(skeleton(body))}
    count = len(motion.joints)
    values = {name: np.zeros((count, len(of))) for name, of in channels.items()}
    for joint, angle in zip(STATE, motion.joints.T, strict=True):
        what = joint.name.removeprefix(f"{joint.side}_")
        bone = _BONES.get(what) or _BONES.get(what.partition("_")[0])
        if bone is not None:
            bone = joint.side.capitalize() + bone
            sign, channel = sum(joint.axis), _CHANNELS[np.flatnonzero(joint.axis)[0]]
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
    root = skeleton(body)
    values = channel_values(even, body)
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        file.write("HIERARCHY\n" + "\n".join(_hierarchy(root, 0)) + "\n")
        file.write(f"MOTION\nFrames: {len(even.joints)}\nFrame Time: {1 / even.rate_hz:.10f}\n")
        for row in np.hstack([*values.values()]):
            file.write(" ".join(f"{value:.6f}" for value in row) + "\n")


def _in_order(bone: Bone) -> list[Bone]:
    """Return the joints with channels in the order of the file."""
    return [bone, *(b for c in bone.children for b in _in_order(c))] if bone.name else []


def _hierarchy(bone: Bone, depth: int) -> list[str]:
    indent = "\t" * depth
    title = f"{'JOINT' if depth else 'ROOT'} {bone.name}" if bone.name else "End Site"
    lines = [title, "{", "\tOFFSET " + " ".join(f"{value:.6f}" for value in bone.offset_m)]
    if bone.name:
        lines.append(f"\tCHANNELS {len(bone.channels)} {' '.join(bone.channels)}")
    lines = [indent + line for line in lines]
    for child in bone.children:
        lines += _hierarchy(child, depth + 1)
    return [*lines, indent + "}"]
