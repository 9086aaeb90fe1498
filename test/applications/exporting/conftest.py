"""Motions of postures with raised shoulders, and a reader of BVH that is not ours."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.applications.exporting.motion import Motion
from cardbox_tracker.camera.camera import level_to_optical
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.skeleton import (
    LEG_NAMES,
    NECK_NAMES,
    STATE_NAMES,
    rotation_x,
    rotation_y,
    rotation_z,
)
from cardbox_tracker.recordings.result_table import RATE_COLUMNS

STEP_NS = 100_000_000
TURNS: dict[str, Callable[..., np.ndarray]] = {"X": rotation_x, "Y": rotation_y, "Z": rotation_z}


def motion_of(
    states: np.ndarray,
    body: BodyModel,
    rises_m: tuple[float, float] = (0, 0),
    neck: Any = np.nan,
    legs: Any = np.nan,
    **more: np.ndarray,
) -> Any:
    """Return the motion of states (n, 14), 10 a second; rows of nan are gaps.

    ``rises_m`` raise the left and right shoulder; ``neck`` and ``legs`` are joints, and ``more``
    other arrays of the motion.
    """
    states = np.atleast_2d(np.asarray(states, float))
    points = pose(body, states, clavicles_m=np.tile(rises_m, (len(states), 1))).keypoints_m
    tilt, n = body.camera_pose, len(states)
    shapes = {
        "wrists": (2, 3),
        "palms": (2, 3),
        "leg_points_m": (6, 3),
        "leg_stddev_m": (6,),
        "rates": (len(RATE_COLUMNS),),
    }
    unknown = {name: np.full((n, *shape), np.nan) for name, shape in shapes.items()}
    stamps = np.arange(len(states)) * STEP_NS
    joints = np.full((n, len(STATE_NAMES)), np.nan)
    joints[:, :14] = states
    for names, values in ((NECK_NAMES, neck), (LEG_NAMES, legs)):
        first = STATE_NAMES.index(names[0])
        joints[:, first : first + len(names)] = values
    return Motion(
        stamps,
        stamps / 1e9,
        tuple("lost" if np.isnan(row).any() else "tracking" for row in states),
        joints,
        keypoints_m=points @ level_to_optical(tilt.pitch_rad, tilt.roll_rad).T,
        **(unknown | more),
    )


def joints_of_bvh(path: Path) -> dict[str, np.ndarray]:
    """Return the places (n, 3) of the joints in the axes of the file, as the library reads it."""
    bvh = pytest.importorskip("bvh", reason="bvh is not installed")
    file = bvh.Bvh(path.read_text(encoding="utf-8"))
    places: dict[str, np.ndarray] = {}
    rotations: dict[str, np.ndarray] = {}
    for name in file.get_joints_names():
        place = np.tile(np.array(file.joint_offset(name)), (file.nframes, 1))
        rotation = np.tile(np.eye(3), (file.nframes, 1, 1))
        for channel in file.joint_channels(name):
            values = [file.frame_joint_channel(i, name, channel) for i in range(file.nframes)]
            if channel.endswith("position"):
                place[:, "XYZ".index(channel[0])] += values
            else:
                rotation = rotation @ TURNS[channel[0]](np.radians(values))
        parent = file.joint_parent(name)
        if parent is not None:
            place = places[parent.name] + np.einsum("nij,nj->ni", rotations[parent.name], place)
            rotation = rotations[parent.name] @ rotation
        places[name], rotations[name] = place, rotation
    return places


@pytest.fixture(name="motion_of")
def _motion_of() -> Callable[..., Motion]:
    return motion_of


@pytest.fixture(name="joints_of_bvh")
def _joints_of_bvh() -> Callable[[Path], dict[str, np.ndarray]]:
    return joints_of_bvh


@pytest.fixture(name="body", scope="session")
def _body() -> BodyModel:
    """A person before a camera that looks down by 0.2 rad."""
    return BodyModel.of(distance_m=2.5, hip_height_m=-0.4, camera_pitch_rad=0.2)
