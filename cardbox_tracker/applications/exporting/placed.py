"""Joints of a tracked motion in the level reference frame, with the bones of a measured body."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.applications.exporting.motion import Motion
from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.kinematics import (
    PosedBodies,
    pose,
)
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES, Group, joints_of

SHOULDERS = [KEYPOINT_NAMES.index(f"{side}_shoulder") for side in ("left", "right")]

# Rounding in tables is far below the first. A shoulder rises by less than the second.
_MOST_APART_M = 0.005
_MOST_RISE_M = 0.15


def keypoints_in_reference(motion: Motion, body: BodyModel | None) -> FloatArray:
    """Return the keypoints (n, 6, 3), metres in the reference frame; nan in gaps.

    Args:
        motion: the results.
        body: has the pitch of the camera; without it the camera is level.
    """
    pitch_rad = 0.0 if body is None else body.camera_pose.pitch_rad
    camera = Camera(1, 1, 1.0, 1.0, 0.0, 0.0, pitch_rad)
    return camera.optical_to_reference(motion.keypoints_m)


def frames_of(motion: Motion, body: BodyModel) -> PosedBodies:
    """Return the body in each image, with the shoulders raised as in the motion."""
    rigid = pose(body.rigid, motion.states)
    shoulders_m = keypoints_in_reference(motion, body)[:, SHOULDERS]
    moved_m = shoulders_m - rigid.keypoints_m[:, SHOULDERS]
    axes = np.array([joint.axis for joint in joints_of(Group.CLAVICLES)])
    rise_m = np.einsum("nkj,nji,ki->nk", moved_m, rigid.torso_rotation, axes)
    return pose(body, motion.states, clavicles_m=rise_m)


def images_of_body(motion: Motion, body: BodyModel) -> Motion:
    """Return the motion with gaps where an image was tracked with another body.

    A tracker that fits guessed sizes to the person begins with others, and may fit them again.

    Raises:
        CardboxError: most images were tracked with another body.
    """
    keypoints_m = keypoints_in_reference(motion, body)
    frames = frames_of(motion, body)
    apart_m = _largest(frames.keypoints_m - keypoints_m)
    rise_m = np.nan_to_num(np.abs(frames.clavicles_m)).max(axis=1)
    is_other = motion.is_seen & ((apart_m > _MOST_APART_M) | (rise_m > _MOST_RISE_M))
    if 2 * is_other.sum() > motion.is_seen.sum():
        raise CardboxError(
            f"the results are not those of the body: joints differ by {max(apart_m):.3f} m, "
            f"shoulders rise by {max(rise_m):.3f} m; give the model with which they were tracked. "
            "With --stature that is OUT.body.yaml, unless most images were tracked before the last "
            "fit of the sizes, as with several people in turn: then track each person alone"
        )
    return motion.without(is_other)


def _largest(differences_m: FloatArray) -> FloatArray:
    """Return the largest length of the vectors (n, k, 3) of each image, (n,); 0 in gaps."""
    lengths: FloatArray = np.nan_to_num(np.linalg.norm(differences_m, axis=-1))
    return np.asarray(lengths.max(axis=1))
