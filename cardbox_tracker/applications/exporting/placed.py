"""Joints of a tracked motion in the level reference frame, with the bones of a measured body."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.applications.exporting.motion import Motion
from cardbox_tracker.body.kinematics import (
    KEYPOINT_NAMES,
    BodyFrames,
    forward_kinematics,
    with_shoulders,
)
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import POSTURE, TORSO_X, TORSO_Z
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.vision.camera import Camera

SHOULDERS = [KEYPOINT_NAMES.index(f"{side}_shoulder") for side in ("left", "right")]
_ENDS = [i for i in range(len(KEYPOINT_NAMES)) if i not in SHOULDERS]

# Rounding in tables is far below the first. A girdle lifts a shoulder by less than the second.
_MOST_APART_M = 0.005
_MOST_LIFT_M = 0.15


def keypoints_in_reference(motion: Motion, body: BodyModel | None) -> FloatArray:
    """Return the keypoints (n, 6, 3), metres in the reference frame; nan in gaps.

    Args:
        motion: the results.
        body: has the pitch of the camera; without it the camera is level.
    """
    pitch_rad = 0.0 if body is None else body.camera_pose.pitch_rad
    camera = Camera(1, 1, 1.0, 1.0, 0.0, 0.0, pitch_rad)
    return camera.optical_to_reference(motion.keypoints_m)


def frames_of(motion: Motion, body: BodyModel) -> BodyFrames:
    """Return the frames of the body's parts in each image, with the shoulders of the motion."""
    frames = _modelled(motion, body)
    return with_shoulders(frames, keypoints_in_reference(motion, body)[:, SHOULDERS])


def images_of_body(motion: Motion, body: BodyModel) -> Motion:
    """Return the motion with gaps where an image was tracked with another body.

    A tracker that fits guessed sizes to the person begins with others, and may fit them again.

    Raises:
        CardboxError: most images were tracked with another body.
    """
    keypoints_m = keypoints_in_reference(motion, body)
    modelled = _modelled(motion, body)
    frames = frames_of(motion, body)
    ends_m = np.stack([*frames.left[1:3], *frames.right[1:3]], axis=1)
    apart_m = _largest(ends_m - keypoints_m[:, _ENDS])
    shoulders_m = np.stack([modelled.left.shoulder, modelled.right.shoulder], axis=1)
    lift_m = _largest(shoulders_m - keypoints_m[:, SHOULDERS])
    is_other = motion.is_seen & ((apart_m > _MOST_APART_M) | (lift_m > _MOST_LIFT_M))
    if 2 * is_other.sum() > motion.is_seen.sum():
        raise CardboxError(
            f"the results are not those of the body: joints differ by {max(apart_m):.3f} m, "
            f"shoulders by {max(lift_m):.3f} m; give the model with which they were tracked. With "
            "--stature that is OUT.body.yaml, unless most images were tracked before the last fit "
            "of the sizes, as with several people in turn: then track each person alone"
        )
    return motion.without(is_other)


def _modelled(motion: Motion, body: BodyModel) -> BodyFrames:
    """Return the frames of the body's parts with the shoulders of hanging arms."""
    frames = forward_kinematics(body, motion.states[:, POSTURE])
    moved = np.zeros((len(motion.states), 3))
    moved[:, 0], moved[:, 2] = motion.states[:, TORSO_X], motion.states[:, TORSO_Z]
    shoulders_m = np.stack([frames.left.shoulder, frames.right.shoulder], axis=1)
    return with_shoulders(frames, shoulders_m + moved[:, None])._replace(
        hip=frames.hip + moved, neck=frames.neck + moved, head=frames.head + moved
    )


def _largest(differences_m: FloatArray) -> FloatArray:
    """Return the largest length of the vectors (n, k, 3) of each image, (n,); 0 in gaps."""
    lengths: FloatArray = np.nan_to_num(np.linalg.norm(differences_m, axis=-1))
    return np.asarray(lengths.max(axis=1))
