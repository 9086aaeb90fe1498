"""Motions of postures with raised shoulders, and a reader of BVH that is not ours."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cardbox_tracker.applications.exporting.motion import Motion
from cardbox_tracker.body.kinematics import (
    forward_kinematics,
    rotation_x,
    rotation_y,
    rotation_z,
    with_shoulders,
)
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.vision.camera import Camera

STEP_NS = 100_000_000
CLAVICLE = 0.43
TURNS: dict[str, Callable[..., np.ndarray]] = {"X": rotation_x, "Y": rotation_y, "Z": rotation_z}


def motion_of(states: np.ndarray, body: BodyModel, lifts_rad: tuple[float, float] = (0, 0)) -> Any:
    """Return the motion of states (n, 14), 10 a second; rows of nan are gaps.

    ``lifts_rad`` turn the left and right shoulder up about the inner end of their clavicles.
    """
    states = np.atleast_2d(np.asarray(states, float))
    frames = forward_kinematics(body, states[:, :12])
    clavicle_m = CLAVICLE * body.size("shoulder_breadth")
    shoulders = []
    for arm, side, lift in zip((frames.left, frames.right), (1, -1), lifts_rad, strict=True):
        moved = np.array([0, side * (np.cos(lift) - 1), np.sin(lift)]) * clavicle_m
        shoulders.append(arm.shoulder + frames.torso_rotation @ moved)
    place = np.stack([states[:, 12], 0 * states[:, 12], states[:, 13]], axis=1)
    placed = with_shoulders(frames, np.stack(shoulders, axis=1) + place[:, None])
    points = np.stack([*placed.left[:3], *placed.right[:3]], axis=1)
    camera = Camera(1, 1, 1.0, 1.0, 0.0, 0.0, body.camera_pose.pitch_rad)
    stamps = np.arange(len(states)) * STEP_NS
    return Motion(
        stamps,
        stamps / 1e9,
        tuple("lost" if np.isnan(row).any() else "tracking" for row in states),
        states,
        np.full((len(states), 2), np.nan),
        camera.reference_to_optical(points),
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
