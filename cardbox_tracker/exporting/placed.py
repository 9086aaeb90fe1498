"""Joints of a tracked motion in the level reference frame, with the bones of a measured body."""

from __future__ import annotations

import numpy as np

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
from cardbox_tracker.exporting.motion import Motion
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
    """Return the frames of the body's parts in each image, with the shoulders of the motion.

    Raises:
        CardboxError: the motion is not that of ``body``.
    """
    keypoints_m = keypoints_in_reference(motion, body)
    frames = forward_kinematics(body, motion.states[:, POSTURE])
    moved = np.zeros((len(motion.states), 3))
    moved[:, 0], moved[:, 2] = motion.states[:, TORSO_X], motion.states[:, TORSO_Z]
    frames = frames._replace(
        hip=frames.hip + moved, neck=frames.neck + moved, head=frames.head + moved
    )
    modelled_m = np.stack([frames.left.shoulder, frames.right.shoulder], 1) + moved[:, None]
    frames = with_shoulders(frames, keypoints_m[:, SHOULDERS])
    ends_m = np.stack([*frames.left[1:3], *frames.right[1:3]], axis=1)
    apart_m = _largest(ends_m - keypoints_m[:, _ENDS])
    lift_m = _largest(modelled_m - keypoints_m[:, SHOULDERS])
    if apart_m > _MOST_APART_M or lift_m > _MOST_LIFT_M:
        raise CardboxError(
            f"the results are not those of the given body: joints differ by {apart_m:.3f} m, "
            f"shoulders by {lift_m:.3f} m; give the model with which they were tracked (with "
            "--stature that is OUT.body.yaml), or a bag of results, which contains it"
        )
    return frames


def _largest(differences_m: FloatArray) -> float:
    """Return the largest length of vectors (n, k, 3) that are known, or 0."""
    lengths = np.linalg.norm(differences_m, axis=-1)
    known = lengths[np.isfinite(lengths)]
    return float(known.max(initial=0.0))
