"""Joints of a tracked motion in the level reference frame, with the bones of a measured body."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.applications.exporting.motion import Motion
from cardbox_tracker.camera.camera import level_to_optical
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.kinematics import PosedBodies, pose
from cardbox_tracker.person.legs import floor_m
from cardbox_tracker.person.model import BodyModel, CameraPose
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES, Group, joints_of

SHOULDERS = [KEYPOINT_NAMES.index(f"{side}_shoulder") for side in ("left", "right")]

# Rounding in tables is far below the first. A shoulder rises by less than the second.
_MOST_APART_M = 0.005
_MOST_RISE_M = 0.15


def in_reference(optical: FloatArray, body: BodyModel | None) -> FloatArray:
    """Return points or directions (..., 3) of the optical frame in the reference frame.

    Args:
        optical: points, metres, or directions.
        body: has pitch and roll of the camera; without it the camera is level.
    """
    tilt = CameraPose() if body is None else body.camera_pose
    return np.asarray(optical @ level_to_optical(tilt.pitch_rad, tilt.roll_rad))


def floor_below(body: BodyModel | None) -> FloatArray:
    """Return the origin of exports, (3,), m in the reference frame: on the floor, if it is known.

    The floor is that on which the measured person stands; otherwise it is the camera.
    """
    height_m = None if body is None else floor_m(body)
    return np.array([0.0, 0.0, height_m or 0.0])


def frames_of(motion: Motion, body: BodyModel) -> PosedBodies:
    """Return the body in each image, with the shoulders raised as in the motion."""
    rigid = pose(body.rigid, motion.states)
    shoulders_m = in_reference(motion.keypoints_m, body)[:, SHOULDERS]
    moved_m = shoulders_m - rigid.keypoints_m[:, SHOULDERS]
    axes = np.array([joint.axis for joint in joints_of(Group.CLAVICLES)])
    rise_m = np.einsum("nkj,nji,ki->nk", moved_m, rigid.torso_rotation, axes)
    return pose(body, motion.states, clavicles_m=rise_m)


def images_of_body(motion: Motion, body: BodyModel) -> Motion:
    """Return the motion with gaps where an image was tracked with another body.

    A running tracker may get another body from the initializer.

    Raises:
        CardboxError: most images were tracked with another body.
    """
    keypoints_m = in_reference(motion.keypoints_m, body)
    frames = frames_of(motion, body)
    apart_m = _largest(frames.keypoints_m - keypoints_m)
    rise_m = np.nan_to_num(np.abs(frames.clavicles_m)).max(axis=1)
    is_other = motion.is_seen & ((apart_m > _MOST_APART_M) | (rise_m > _MOST_RISE_M))
    if 2 * is_other.sum() > motion.is_seen.sum():
        raise CardboxError(
            f"the results are not those of the body: joints differ by {max(apart_m):.3f} m, "
            f"shoulders rise by {max(rise_m):.3f} m; give the model with which they were tracked, "
            "which 'cardbox track' writes beside the table OUT.csv as OUT.body.yaml"
        )
    return motion.without(is_other)


def _largest(differences_m: FloatArray) -> FloatArray:
    """Return the largest length of the vectors (n, k, 3) of each image, (n,); 0 in gaps."""
    lengths: FloatArray = np.nan_to_num(np.linalg.norm(differences_m, axis=-1))
    return np.asarray(lengths.max(axis=1))
