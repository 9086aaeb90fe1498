"""Motion capture as it was recorded, and its conversion to the shared segments.

The axes of all captures here are x to the left, y up and z forward in the T-pose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from learning.motions.figure import ANKLE, figures
from learning.motions.motion import Motion
from learning.motions.rotations import FloatArray, swing
from learning.segments import SEGMENTS

TO_OURS = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rotation from the axes of captures to ours."""
FLOOR_PERCENTILE = 5.0
CENTRE = ("hips", "spine", "chest", "neck", "head")
LIMBS = ("collar", "upper_arm", "forearm", "hand", "thigh", "shin", "foot", "fingers")
# The names of joints by the skeleton's own words: the trunk, then the limbs of left and right.
SKELETONS = {
    "poser": (
        "hip abdomen chest neck head",
        "lCollar lShldr lForeArm lHand lThigh lShin lFoot lMid1",
        "rCollar rShldr rForeArm rHand rThigh rShin rFoot rMid1",
    ),
    "motion builder": (
        "Hips Spine Spine1 Neck Head",
        "LeftShoulder LeftArm LeftForeArm LeftHand LeftUpLeg LeftLeg LeftFoot LFingers",
        "RightShoulder RightArm RightForeArm RightHand RightUpLeg RightLeg RightFoot RFingers",
    ),
    "acclaim": (
        "root upperback thorax lowerneck head",
        "lclavicle lhumerus lradius lhand lfemur ltibia lfoot lfingers",
        "rclavicle rhumerus rradius rhand rfemur rtibia rfoot rfingers",
    ),
    "iclone": (
        "CC_Base_Pelvis CC_Base_Spine01 CC_Base_Spine02 CC_Base_NeckTwist01 CC_Base_Head",
        "CC_Base_L_Clavicle CC_Base_L_Upperarm CC_Base_L_Forearm CC_Base_L_Hand "
        "CC_Base_L_Thigh CC_Base_L_Calf CC_Base_L_Foot CC_Base_L_Mid1",
        "CC_Base_R_Clavicle CC_Base_R_Upperarm CC_Base_R_Forearm CC_Base_R_Hand "
        "CC_Base_R_Thigh CC_Base_R_Calf CC_Base_R_Foot CC_Base_R_Mid1",
    ),
}
# The next joint along each limb, and the direction of the limb in the T-pose.
NEXT = {"upper_arm": "forearm", "forearm": "hand", "hand": "fingers", "thigh": "shin",
        "shin": "foot"}  # fmt: skip
SIDES = ("left", "right")
DOWN, LEFT = np.array([0.0, -1.0, 0.0]), np.array([1.0, 0.0, 0.0])
# The ankle is about as high above the floor, in lengths of thigh and shin.
FOOT_SHARE = 0.09


@dataclass(frozen=True)
class Capture:
    """A clip of motion capture: a skeleton and its turns.

    Args:
        names: of the joints, parents first.
        parents: index of each joint's parent; -1 for the first.
        offsets: of each joint in the axes of its parent (joints, 3), in any unit.
        rest: world rotations of the joints in the T-pose (joints, 3, 3).
        turns: rotations of the joints against their parents (frames, joints, 3, 3).
        root: place of the first joint (frames, 3).
        fps: frames a second.
        has_true_limbs: whether the offsets at rest show the directions of the limbs. Otherwise
            the limbs of ``rest`` stand for those of our T-pose.
        has_true_headings: whether the rotations of the first joint are certain.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: FloatArray
    rest: FloatArray
    turns: FloatArray
    root: FloatArray
    fps: float
    has_true_limbs: bool = True
    has_true_headings: bool = True

    def world(self) -> tuple[FloatArray, FloatArray]:
        """Return world rotations (frames, joints, 3, 3) and places (frames, joints, 3)."""
        turns, places = self.turns.copy(), np.zeros((*self.turns.shape[:2], 3))
        places[:, 0] = self.root
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                turns[:, joint] = turns[:, parent] @ self.turns[:, joint]
                places[:, joint] = places[:, parent] + turns[:, parent] @ self.offsets[joint]
        return turns, places


def joints_of(names: tuple[str, ...]) -> dict[str, int]:
    """Return the index of the joint of every segment, and of the fingers of both hands.

    Raises:
        ValueError: if the skeleton is none of those that are known.
    """
    for centre, left, right in SKELETONS.values():
        known = dict(zip(CENTRE, centre.split(), strict=True))
        for side, words in (("left", left), ("right", right)):
            known |= {f"{side}_{limb}": w for limb, w in zip(LIMBS, words.split(), strict=True)}
        if set(known.values()) <= set(names):
            return {segment: names.index(word) for segment, word in known.items()}
    raise ValueError(f"No known skeleton has the joints {', '.join(names[:8])} ...")


def to_motion(capture: Capture, name: str, source: str) -> Motion:
    """Return the motion of a capture, which faces +x on average and stands on the floor."""
    joints = joints_of(capture.names)
    world, at = capture.world()
    turns = np.empty((len(world), len(SEGMENTS), 3, 3), dtype=np.float32)
    for index, segment in enumerate(SEGMENTS):
        joint = joints[segment]
        from_rest = world[:, joint] @ capture.rest[joint].T @ straightening(capture, segment)
        turns[:, index] = TO_OURS @ from_rest @ TO_OURS.T
    hips = (at[:, joints["left_thigh"]] + at[:, joints["right_thigh"]]) / 2
    below = (capture.offsets[joints[f"left_{limb}"]] for limb in ("shin", "foot"))
    leg = (1 + FOOT_SHARE) * sum(float(np.linalg.norm(offset)) for offset in below)
    places = (hips @ TO_OURS.T / leg).astype(np.float32)
    return on_the_floor(Motion(name, source, capture.fps, turns, places)).facing_forward()


def straightening(capture: Capture, segment: str) -> FloatArray:
    """Return the rotation (3, 3) from our T-pose of a segment to that of the capture."""
    side, _, limb = segment.partition("_")
    if limb not in NEXT or not capture.has_true_limbs:
        return np.eye(3)
    joints = joints_of(capture.names)
    along = capture.rest[joints[segment]] @ offset_between(
        capture, joints[segment], joints[f"{side}_{NEXT[limb]}"]
    )
    outwards = LEFT if side == "left" else -LEFT
    return swing(DOWN if limb in ("thigh", "shin") else outwards, along)


def offset_between(capture: Capture, joint: int, later: int) -> FloatArray:
    """Return the offset (3,) of a later joint in a joint's axes, all between being at rest."""
    offset = np.zeros(3)
    while later != joint:
        parent = capture.parents[later]
        offset += capture.rest[joint].T @ capture.rest[parent] @ capture.offsets[later]
        later = parent
    return offset


def on_the_floor(motion: Motion) -> Motion:
    """Return the motion at the height at which the feet mostly touch the floor."""
    lowest = np.minimum(*(figures(motion)[:, SEGMENTS.index(f"{s}_foot"), 2] for s in SIDES))
    rise = ANKLE - float(np.percentile(lowest, FLOOR_PERCENTILE))
    places = (motion.places + np.array([0.0, 0.0, rise])).astype(np.float32)
    return Motion(motion.name, motion.source, motion.fps, motion.turns, places)
