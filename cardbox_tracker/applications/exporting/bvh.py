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
from cardbox_tracker.person.legs import ANKLE_SHARE, HIP_SHARE, SHANK_SHARE, THIGH_SHARE, stature_of
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.posture import (
    ELBOW_ABDUCTION,
    ELBOW_FLEXION,
    FIRST_ANGLES,
    PITCH,
    ROLL,
    SHOULDER_ABDUCTION,
    SHOULDER_FLEXION,
    YAW,
)
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import head_from_pivot_m, neck_pivot_m

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
    """Return values (n, channels), m and deg, of joints that move; a gap repeats the last."""
    frames = frames_of(motion, body)
    parts = body_parts(body.sizes)
    states, hip = held(motion.states), held(frames.hip - floor_below(body))
    zero = np.zeros(len(states))
    angles = {
        "Hips": (states[:, YAW], zero, zero),
        "Spine": (zero, states[:, PITCH], states[:, ROLL]),
        "Neck": (*held(motion.neck).T, zero),
    }
    for (name, side), arm, first in zip(
        _SIDES, (frames.left, frames.right), FIRST_ANGLES, strict=True
    ):
        local = np.einsum("nji,nj->ni", frames.torso_rotation, arm.shoulder - frames.hip)
        aside = side * local[:, 1] - (parts.shoulder_aside_m - _clavicle_m(body))
        up = local[:, 2] - parts.shoulder_height_m
        lift = held(side * np.arctan2(up, aside)[:, None])[:, 0]
        turned = states[:, first : first + 4]
        raised = side * turned[:, SHOULDER_ABDUCTION] - lift
        angles[f"{name}Shoulder"] = (lift, zero, zero)
        angles[f"{name}Arm"] = (raised, -turned[:, SHOULDER_FLEXION], zero)
        bent = side * turned[:, ELBOW_ABDUCTION]
        angles[f"{name}ForeArm"] = (bent, -turned[:, ELBOW_FLEXION], zero)
    for number, (name, side) in enumerate(_SIDES):
        flexion, abduction, rotation, bend = held(
            motion.legs[:, 4 * number : 4 * number + 4]
        ).T * np.array([[-1.0], [side], [-side], [1.0]])
        angles[f"{name}UpLeg"] = (flexion, abduction, rotation)
        angles[f"{name}Leg"] = (bend, zero, zero)
    values = {name: np.degrees(np.stack(three, axis=1)) for name, three in angles.items()}
    place_m = np.stack([hip[:, 1], hip[:, 2], hip[:, 0]], axis=1)
    return values | {"Hips": np.hstack([place_m, values["Hips"]])}


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
    columns = [
        values.get(bone.name, np.zeros((len(even.states), len(bone.channels))))
        for bone in _in_order(root)
    ]
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        file.write("HIERARCHY\n" + "\n".join(_hierarchy(root, 0)) + "\n")
        file.write(f"MOTION\nFrames: {len(even.states)}\nFrame Time: {1 / even.rate_hz:.10f}\n")
        for row in np.hstack(columns):
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
