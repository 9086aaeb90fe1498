"""The same people before the same camera, which is found to look down by another angle.

Their places in the optical frame stay; bodies and states turn into the other level frame.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cardbox_tracker.camera.camera import level_to_optical
from cardbox_tracker.person.model import PLACEMENT, BodyModel, CameraPose
from cardbox_tracker.person.posture import PITCH, ROLL, TORSO_X, TORSO_Y, TORSO_Z, YAW
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import rotation_x, rotation_y, rotation_z


def _turn(before: CameraPose, after: CameraPose) -> FloatArray:
    """Return the rotation (3, 3) from the level frame of one pitch into that of another."""
    turn: FloatArray = level_to_optical(after.pitch_rad).T @ level_to_optical(before.pitch_rad)
    return turn


def tilted_body(body: BodyModel, pose: CameraPose) -> BodyModel:
    """Return a body at the same place in the image of a camera with another pitch."""
    place = body.placement
    x_m, _, z_m = _turn(body.camera_pose, pose) @ (-place.distance_m, 0.0, place.hip_height_m)
    limits = np.array([PLACEMENT[name][:2] for name in ("distance_m", "hip_height_m")])
    x_m, z_m = np.clip((-x_m, z_m), *limits.T).tolist()
    there = replace(place, distance_m=x_m, hip_height_m=z_m)
    return replace(body, camera_pose=pose, placement=there)


def tilted_states(states: FloatArray, before: BodyModel, after: BodyModel) -> FloatArray:
    """Return states (N, 14) of the body ``before`` as those of :func:`tilted_body` ``after``."""
    found, turn = states.copy(), _turn(before.camera_pose, after.camera_pose)
    x_m = states[:, TORSO_X] - before.placement.distance_m
    z_m = states[:, TORSO_Z] + before.placement.hip_height_m
    hips_m = np.column_stack([x_m, states[:, TORSO_Y], z_m]) @ turn.T
    found[:, TORSO_X] = hips_m[:, 0] + after.placement.distance_m
    found[:, TORSO_Z] = hips_m[:, 2] - after.placement.hip_height_m
    yaw, pitch, roll = (states[:, value] for value in (YAW, PITCH, ROLL))
    torso = turn @ rotation_z(yaw) @ rotation_y(pitch) @ rotation_x(roll)
    # Of the two sets of angles, that with the nearer yaw: a trunk may bow beyond the horizontal.
    ahead = np.cos(yaw) * torso[:, 0, 0] + np.sin(yaw) * torso[:, 1, 0]
    side = np.where(ahead < 0.0, -1.0, 1.0)
    level = side * np.hypot(torso[:, 0, 0], torso[:, 1, 0])
    found[:, PITCH] = np.arctan2(-torso[:, 2, 0], level)
    found[:, ROLL] = np.arctan2(side * torso[:, 2, 1], side * torso[:, 2, 2])
    found[:, YAW] = np.arctan2(side * torso[:, 1, 0], side * torso[:, 0, 0])
    # Somebody who has turned around has a yaw beyond half a turn.
    found[:, YAW] += 2.0 * np.pi * np.rint((yaw - found[:, YAW]) / (2.0 * np.pi))
    return found
