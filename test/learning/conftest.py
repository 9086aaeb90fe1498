"""Small bodies and recordings.

``stick`` is a person of 1.6 m whose bones are lines, in the rest posture of a rig: arms 45 degrees
down. ``boxes`` is a person of 1.7 m who consists of boxes, in the T-pose.
"""

from __future__ import annotations

from itertools import product
from typing import Any, Protocol

import numpy as np
import pytest

from cardbox_tracker.body.posture import reference_posture
from learning.bodies.rigged import INDEX, RiggedBody, strongest
from learning.bodies.t_pose import turns_to_t_pose
from learning.samples import Origin, Samples
from learning.segments import SEGMENTS

SLANT = np.sqrt(0.5)
CENTRE = {"hips": 0.8, "spine": 0.9, "chest": 1.1, "neck": 1.35, "head": 1.4}


def stick_joints() -> np.ndarray:
    joints = np.zeros((len(SEGMENTS), 3), np.float32)
    for name, height in CENTRE.items():
        joints[INDEX[name]] = (0, 0, height)
    for side, out in (("left", 1), ("right", -1)):
        places = {
            "collar": (0, 0.05, 1.3),
            "upper_arm": (-0.02, 0.2, 1.3),
            "forearm": (-0.02, 0.2 + 0.3 * SLANT, 1.3 - 0.3 * SLANT),
            "hand": (-0.02, 0.2 + 0.5 * SLANT, 1.3 - 0.5 * SLANT),
            "thigh": (0, 0.1, 0.8),
            "shin": (0, 0.1, 0.4),
            "foot": (0, 0.1, 0.1),
        }
        for part, (x, y, z) in places.items():
            joints[INDEX[f"{side}_{part}"]] = (x, out * y, z)
    return joints


def stick_knuckles() -> np.ndarray:
    """Knuckles 0.1 m beyond the wrists."""
    y, z = 0.2 + 0.6 * SLANT, 1.3 - 0.6 * SLANT
    return np.array([[-0.02, y, z], [-0.02, -y, z]], np.float32)


@pytest.fixture
def stick() -> RiggedBody:
    """One triangle at each joint, 1 cm wide, and one at each sole, knuckle, and the crown."""
    joints, knuckles = stick_joints(), stick_knuckles()
    soles = joints[[INDEX["left_foot"], INDEX["right_foot"]]] * np.float32([1, 1, 0])
    places = [*joints, *soles, *knuckles, (0, 0, 1.6)]
    owners = [*SEGMENTS, "left_foot", "right_foot", "left_hand", "right_hand", "head"]
    corners = np.float32([[0, 0, 0], [0.01, 0, 0], [0, 0.01, 0]])
    vertices = np.concatenate([place + corners for place in places]).astype(np.float32)
    weights = np.zeros((len(vertices), len(SEGMENTS)))
    weights[np.arange(len(vertices)), np.repeat([INDEX[name] for name in owners], 3)] = 1
    bones, shares = strongest(weights)
    across = np.float32([[-0.06, 0, 0], [-0.06, 0, 0]])
    return RiggedBody(
        name="stick",
        family="test",
        sex="male",
        vertices=vertices,
        faces=np.arange(len(vertices), dtype=np.int32).reshape(-1, 3),
        bones=bones,
        shares=shares,
        joints=joints,
        knuckles=knuckles,
        head_centre=np.float32([0, 0, 1.5]),
        to_t_pose=turns_to_t_pose(joints, knuckles, across),
        colours=np.full((len(vertices), 3), 128, np.uint8),
    )


# From and to, metres, in the T-pose; of the left side.
BOXES = {
    "hips": ((-0.10, -0.17, 0.82), (0.10, 0.17, 1.00)),
    "spine": ((-0.09, -0.15, 1.00), (0.09, 0.15, 1.15)),
    "chest": ((-0.10, -0.17, 1.15), (0.10, 0.17, 1.43)),
    "neck": ((-0.05, -0.05, 1.42), (0.05, 0.05, 1.54)),
    "head": ((-0.09, -0.075, 1.50), (0.09, 0.075, 1.70)),
    "left_collar": ((-0.05, 0.03, 1.36), (0.05, 0.20, 1.43)),
    "left_upper_arm": ((-0.045, 0.16, 1.355), (0.045, 0.48, 1.445)),
    "left_forearm": ((-0.035, 0.46, 1.365), (0.035, 0.73, 1.435)),
    "left_hand": ((-0.04, 0.71, 1.385), (0.04, 0.90, 1.415)),
    "left_thigh": ((-0.07, 0.02, 0.45), (0.07, 0.16, 0.90)),
    "left_shin": ((-0.05, 0.04, 0.06), (0.05, 0.14, 0.50)),
    "left_foot": ((-0.06, 0.04, 0.00), (0.18, 0.14, 0.08)),
}
JOINTS = {
    "hips": (0.0, 0.0, 0.90),
    "spine": (0.0, 0.0, 1.00),
    "chest": (0.0, 0.0, 1.15),
    "neck": (0.0, 0.0, 1.45),
    "head": (0.0, 0.0, 1.52),
    "left_collar": (0.0, 0.03, 1.40),
    "left_upper_arm": (0.0, 0.18, 1.40),
    "left_forearm": (0.0, 0.47, 1.40),
    "left_hand": (0.0, 0.72, 1.40),
    "left_thigh": (0.0, 0.09, 0.90),
    "left_shin": (0.0, 0.09, 0.48),
    "left_foot": (0.0, 0.09, 0.08),
}
KNUCKLES = (0.0, 0.81, 1.40)
MIRROR = np.array([1.0, -1.0, 1.0])


@pytest.fixture
def boxes() -> RiggedBody:
    """One box for each segment; arms of 29 cm and 34 cm to the knuckles, legs of 90 cm."""
    vertices, faces, colours, joints = [], [], [], []
    # Corners are numbered by bits; each side has two triangles with one diagonal in common.
    sides = [
        (begin, one, other)
        for one, other in ((1, 2), (1, 4), (2, 4))
        for begin in (0, 7 - one - other)
    ]
    triangles = [
        (begin, begin + step, begin + one + other)
        for begin, one, other in sides
        for step in (one, other)
    ]
    for name in SEGMENTS:
        sign = MIRROR if name.startswith("right") else np.ones(3)
        left = name.replace("right", "left")
        faces += [np.array(one) + 8 * len(vertices) for one in triangles]
        vertices.append(sign * list(product(*zip(*BOXES[left], strict=True))))
        joints.append(sign * JOINTS[left])
        shirt = not left.endswith(("head", "neck", "hand", "thigh", "shin", "foot"))
        colours.append(np.tile((60, 90, 160) if shirt else (200, 150, 120), (8, 1)))
    weights = np.repeat(np.eye(len(SEGMENTS)), 8, axis=0)
    bones, shares = strongest(weights)
    return RiggedBody(
        name="boxes",
        family="test",
        sex="female",
        vertices=np.concatenate(vertices).astype(np.float32),
        faces=np.array(faces, np.int32),
        bones=bones,
        shares=shares,
        joints=np.array(joints, np.float32),
        knuckles=np.array([KNUCKLES, KNUCKLES * MIRROR], np.float32),
        head_centre=np.float32([0, 0, 1.61]),
        to_t_pose=np.tile(np.eye(3, dtype=np.float32), (len(SEGMENTS), 1, 1)),
        colours=np.concatenate(colours).astype(np.uint8),
    )


class MakeSamples(Protocol):
    """Makes samples of a recording whose results are right; arrays and origin may be given."""

    def __call__(self, images: int = 4, *, seed: int = 0, **given: Any) -> Samples: ...


@pytest.fixture
def make_samples() -> MakeSamples:
    def make(images: int = 4, *, seed: int = 0, **given: Any) -> Samples:
        rng = np.random.default_rng(seed)
        sources = {"family": "test", "body": "boxes", "source": "cmu-07", "motion": "07_01"}
        flags = dict.fromkeys(("is_measured", "has_images", "has_points", "has_depth"), False)
        origin = sources | flags | {"fps": 30.0}
        origin |= {name: given.pop(name) for name in list(given) if name in origin}
        found_m = np.array([[side * x, y, 2.0] for side in (1, -1) for x, y in ARM])
        arrays = {
            "features": rng.standard_normal((images, 2, 5)),
            "found_m": np.tile(found_m, (images, 1, 1)),
            "evidence": rng.random((images, 8)),
            "result_features": rng.standard_normal((images, 2, 6)),
            "result_m": np.tile(found_m, (images, 1, 1)),
            "states": np.tile(np.append(reference_posture("front"), (0.0, 0.0)), (images, 1)),
            "stddevs": np.full((images, 14), 0.1),
            "true_m": np.tile(found_m, (images, 1, 1)),
            "torso_rad": np.zeros((images, 3)),
            "pitch_rad": np.array(0.1),
            "stamps_ns": np.arange(images) * 33_333_333,
        }
        return Samples(Origin(**origin), **(arrays | given))

    return make


# Right of the middle and down, m; the arm hangs.
ARM = ((0.2, 0.0), (0.2, 0.3), (0.2, 0.6))
