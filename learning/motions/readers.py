"""Readers of motion capture: BVH, ASF with AMC, and text files of exponential maps.

The sources that these readers know, all made from the CMU Graphics Lab Motion Capture Database
(mocap.cs.cmu.edu, created with funding from NSF EIA-0196217; free for all uses):

* BVH of B. Hahne (cgspeed), whose first frame is a T-pose;
* BVH of iClone's characters, whose bones point along y and whose frames contain no T-pose;
* the ASF and AMC files of the database itself;
* text files of 117 numbers a line: place and exponential maps of 38 joints of Hahne's conversion.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from learning.motions.acclaim import CMU_FPS, read_amc, stride
from learning.motions.capture import Capture
from learning.motions.rotations import FloatArray, about_axis, about_vector

# Hahne's files go smoothly from the T-pose to the motion; its arms slope down by some degrees.
AFTER_T_POSE, SLOPE_DEG = 3, 8.0
# The skeleton of the text files, with the offsets that matter, in its own unit.
TEXT_NAMES = tuple(
    "Hips LHipJoint LeftUpLeg LeftLeg LeftFoot LeftToeBase LeftToeEnd RHipJoint RightUpLeg "  # noqa: SIM905
    "RightLeg RightFoot RightToeBase RightToeEnd LowerBack Spine Spine1 Neck Neck1 Head HeadEnd "
    "LeftShoulder LeftArm LeftForeArm LeftHand LeftFingerBase LFingers LFingersEnd LThumb "
    "LThumbEnd RightShoulder RightArm RightForeArm RightHand RightFingerBase RFingers "
    "RFingersEnd RThumb RThumbEnd".split()
)
TEXT_PARENTS = (
    *(-1, 0, 1, 2, 3, 4, 5, 0, 7, 8, 9, 10, 11, 0, 13, 14, 15, 16, 17, 18, 15, 20, 21, 22, 23),
    *(24, 25, 23, 27, 15, 29, 30, 31, 32, 33, 34, 32, 36),
)
TEXT_OFFSETS = {
    "LeftUpLeg": (1.65674, -1.80282, 0.62477), "RightUpLeg": (-1.6107, -1.80282, 0.62476),
    "LeftLeg": (2.5972, -7.13576, 0), "RightLeg": (-2.59502, -7.12977, 0),
    "LeftFoot": (2.49236, -6.8477, 0), "RightFoot": (-2.4678, -6.78024, 0),
    "Spine": (0.01961, 2.0545, -0.14112), "Spine1": (0.01021, 2.06436, -0.05921),
    "LeftArm": (3.54205, 0.90436, -0.17364), "RightArm": (-3.49802, 0.75994, -0.32616),
    "LeftForeArm": (4.86513, 0, 0), "RightForeArm": (-5.02649, 0, 0),
    "LeftHand": (3.35554, 0, 0), "RightHand": (-3.36431, 0, 0),
    "LFingers": (0.66117, 0, 0), "RFingers": (-0.73041, 0, 0),
}  # fmt: skip
# Slopes of iClone's bones at rest, which match its clips with those of the database itself.
ICLONE_PITCH_DEG = {"Pelvis": 11.8, "Spine01": -5.0, "Spine02": -10.3, "NeckTwist01": -4.7,
                    "Head": 16.0}  # fmt: skip
ICLONE_COLLAR_DEG = 15.0
# Rest of iClone's bones, the axes x, y, z of each in columns: left, up, forward.
ICLONE_TOE_RAD = np.radians(14.0)
ICLONE_REST = {
    "L_arm": np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "R_arm": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "leg": np.diag([-1.0, -1.0, 1.0]),
    "foot": np.array([
        [-1.0, 0.0, 0.0],
        [0.0, -np.sin(ICLONE_TOE_RAD), np.cos(ICLONE_TOE_RAD)],
        [0.0, np.cos(ICLONE_TOE_RAD), np.sin(ICLONE_TOE_RAD)],
    ]),
}  # fmt: skip


def read(path: Path) -> Capture:
    """Return the capture of a ``.bvh``, ``.amc`` or ``.txt`` file at about 30 frames a second.

    Raises:
        OSError: if the file cannot be read.
        ValueError: if it is not of a known form.
    """
    readers = {".bvh": read_bvh, ".amc": read_amc, ".txt": read_text}
    if path.suffix not in readers:
        raise ValueError(f"{path} is no file of motion capture.")
    return readers[path.suffix](path)


def read_bvh(path: Path) -> Capture:
    """Return the capture of a BVH file; see :func:`read`."""
    lines = path.read_text().splitlines()
    start = next((i for i, line in enumerate(lines) if line.startswith("MOTION")), -1)
    if start < 0:
        raise ValueError(f"{path} has no MOTION.")
    names, parents, offsets, channels = hierarchy(lines[:start])
    fps = 1 / float(lines[start + 2].split()[2])
    rows = [line for line in lines[start + 3 :] if line.strip()]
    is_iclone = any(name.startswith("CC_Base") for name in names)
    kept = rows[:: stride(fps)] if is_iclone else [rows[0], *rows[1 :: stride(fps)]]
    frames = np.array([row.split() for row in kept], dtype=float)
    turns = np.tile(np.eye(3), (len(frames), len(names), 1, 1))
    root = np.tile(offsets[0] if is_iclone else np.zeros(3), (len(frames), 1))
    column = 0
    for joint, of_joint in enumerate(channels):
        for channel in of_joint:
            axis, values = "XYZ".index(channel[0]), frames[:, column]
            column += 1
            if channel.endswith("rotation"):
                turns[:, joint] = turns[:, joint] @ about_axis(axis, np.radians(values))
            elif joint == 0:
                root[:, axis] += values
    rest = iclone_rest(names) if is_iclone else first_frame(turns, parents)
    if not is_iclone:
        rest = with_sloping_arms(rest, names)
    moving = slice(0 if is_iclone else 1 + AFTER_T_POSE, None)
    if len(turns[moving]) == 0:
        raise ValueError(f"{path} has no frames after its T-pose.")
    return Capture(
        names, parents, offsets, rest, turns[moving], root[moving], fps / stride(fps), is_iclone
    )


def hierarchy(
    lines: list[str],
) -> tuple[tuple[str, ...], tuple[int, ...], FloatArray, list[list[str]]]:
    """Return names, parents, offsets (joints, 3) and channels of the joints of a BVH file."""
    names: list[str] = []
    parents: list[int] = []
    offsets: list[list[float]] = []
    channels: list[list[str]] = []
    open_joints: list[int] = []
    for words in (line.split() for line in lines if line.strip()):
        if words[0] in ("ROOT", "JOINT", "End"):
            parents.append(open_joints[-1] if open_joints else -1)
            open_joints.append(len(names))
            names.append(words[1] if words[0] != "End" else f"end of {names[parents[-1]]}")
            channels.append([])
        elif words[0] == "OFFSET":
            offsets.append([float(word) for word in words[1:4]])
        elif words[0] == "CHANNELS":
            channels[-1] = words[2:]
        elif words[0] == "}":
            open_joints.pop()
    return tuple(names), tuple(parents), np.array(offsets), channels


def with_sloping_arms(rest: FloatArray, names: tuple[str, ...]) -> FloatArray:
    """Return rotations at rest (joints, 3, 3) that say that the arms of the T-pose slope down."""
    result = rest.copy()
    for joint, name in enumerate(names):
        if name[1:] in ("Shldr", "ForeArm", "Hand"):
            slope = np.radians(SLOPE_DEG if name[0] == "l" else -SLOPE_DEG)
            result[joint] = about_axis(2, slope) @ rest[joint]
    return result


def first_frame(turns: FloatArray, parents: tuple[int, ...]) -> FloatArray:
    """Return the world rotations (joints, 3, 3) of the first frame."""
    world: FloatArray = turns[0].copy()
    for joint, parent in enumerate(parents):
        if parent >= 0:
            world[joint] = world[parent] @ world[joint]
    return world


def iclone_rest(names: tuple[str, ...]) -> FloatArray:
    """Return the world rotations (joints, 3, 3) of iClone's bones in the T-pose."""
    rest: FloatArray = np.tile(np.eye(3), (len(names), 1, 1))
    for joint, name in enumerate(names):
        bone = name.removeprefix("CC_Base_")
        side, _, limb = bone.partition("_")
        if bone in ICLONE_PITCH_DEG:
            rest[joint] = about_axis(0, np.radians(ICLONE_PITCH_DEG[bone]))
        elif side in ("L", "R") and limb.startswith(("Thigh", "Calf", "Knee")):
            rest[joint] = ICLONE_REST["leg"]
        elif side in ("L", "R") and limb.startswith(("Foot", "Toe")):
            rest[joint] = ICLONE_REST["foot"]
        elif side in ("L", "R"):
            rest[joint] = ICLONE_REST[f"{side}_arm"]
        if limb == "Clavicle":
            slope = ICLONE_COLLAR_DEG if side == "L" else -ICLONE_COLLAR_DEG
            rest[joint] = about_axis(1, np.radians(slope)) @ rest[joint]
    return rest


def read_text(path: Path) -> Capture:
    """Return the capture of a text file of exponential maps; see :func:`read`."""
    rows = np.loadtxt(path, delimiter=",", ndmin=2)
    if rows.shape[1] != 3 + 3 * len(TEXT_NAMES):
        raise ValueError(f"{path} has {rows.shape[1]} numbers a line.")
    rows = np.concatenate([rows[:1], rows[1 :: stride(CMU_FPS)]])
    turns = about_vector(-rows[:, 3:].reshape(len(rows), -1, 3))
    offsets = np.array([TEXT_OFFSETS.get(name, (0.0, 0.0, 0.0)) for name in TEXT_NAMES])
    turns[:, 0], is_certain = in_right_order(turns[:, 0])
    rest = first_frame(turns, TEXT_PARENTS)
    fps = CMU_FPS / stride(CMU_FPS)
    return Capture(
        names=TEXT_NAMES,
        parents=TEXT_PARENTS,
        offsets=offsets,
        rest=rest,
        turns=turns[1:],
        root=rows[1:, :3],
        fps=fps,
        has_true_headings=is_certain,
    )


def in_right_order(turns: FloatArray) -> tuple[FloatArray, bool]:
    """Return the captured rotations (n, 3, 3) of the hips of a text file, and if they are certain.

    The text files put the angles of the hips together as Rz Rx Ry, and the capture as Rz Ry Rx.
    Where a person turns by more than 90 degrees, two answers are possible.
    """
    x = np.arcsin(np.clip(turns[:, 2, 1], -1, 1))
    y = np.arctan2(-turns[:, 2, 0], turns[:, 2, 2])
    z = np.arctan2(-turns[:, 0, 1], turns[:, 1, 1])
    ordered = about_axis(2, z) @ about_axis(1, y) @ about_axis(0, x)
    return ordered, bool(np.all(np.abs(y) < np.pi / 2))
