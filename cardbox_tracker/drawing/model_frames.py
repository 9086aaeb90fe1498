"""Frames of the parts of a tracked person, for drawing."""

from __future__ import annotations

from cardbox_tracker.body.kinematics import (
    KEYPOINT_NAMES,
    BodyFrames,
    forward_kinematics,
    with_shoulders,
)
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.vision.camera import Camera

_SHOULDERS = [KEYPOINT_NAMES.index(f"{side}_shoulder") for side in ("left", "right")]


def model_frames(
    body: BodyModel, camera: Camera, posture: FloatArray, keypoints_m: FloatArray | None
) -> BodyFrames:
    """Return the frames of the parts of ``body``, with the estimated shoulders.

    Args:
        body: the person at their present place.
        camera: camera with the pitch of the body model.
        posture: (12,), rad and metres.
        keypoints_m: (6, 3), metres in the optical frame; None for the shoulders of the posture.
    """
    frames = forward_kinematics(body, posture)
    if keypoints_m is None:
        return frames
    return with_shoulders(frames, camera.optical_to_reference(keypoints_m[_SHOULDERS]))
