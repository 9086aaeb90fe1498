"""Depth features of the learned corrector: distances of the measured surface from the joints.

The search already uses the depth image (:mod:`cardbox_tracker.estimation.cost.depth`); the
remaining distances at shoulder, elbow and hand indicate errors of the result.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.terms import Frame
from cardbox_tracker.vision.camera import Camera

_JOINTS = 3
DEPTH_FEATURES = 2 * _JOINTS
"""Number of features of an arm from :func:`features_of_depth`."""

# Half side of the square of pixels around a joint, m; least number of known depths in it.
_NEAR_M, _LEAST_PIXELS = 0.03, 4
# Limit of the distance, m; a farther surface is another part or the wall.
_MOST_M = 0.3


def features_of_depth(frame: Frame, camera: Camera, keypoints_m: FloatArray) -> FloatArray:
    """Return the features (2, F) of the left and the right arm.

    The features are the distances of the surface behind shoulder, elbow and hand, metres, at most
    0.3, and then, for each joint, 1 if the distance is known, else 0. Without a depth image, all
    features are 0.

    Args:
        frame: silhouette and depth image, (H, W).
        camera: camera of both.
        keypoints_m: keypoints of the result, (6, 3), metres in the optical frame.
    """
    features = np.zeros((2, DEPTH_FEATURES))
    if frame.depth_m is None:
        return features
    ahead_m = np.maximum(keypoints_m[:, 2], _MOST_M)
    pixels = camera.project(np.column_stack([keypoints_m[:, :2], ahead_m]))
    reaches = np.maximum(np.rint(camera.fx * _NEAR_M / ahead_m), 1)
    for joint, ((u, v), reach, z) in enumerate(zip(pixels, reaches, ahead_m, strict=True)):
        columns, rows = (
            slice(*np.clip([at - reach, at + reach + 1], 0, most).astype(int))
            for at, most in ((round(u), camera.width), (round(v), camera.height))
        )
        behind_m = frame.depth_m[rows, columns] - z
        # Pixels outside of the silhouette show the wall, and 0 is an unknown depth.
        known = behind_m[(frame.silhouette[rows, columns] > 0) & (np.abs(behind_m) < 2 * _MOST_M)]
        if known.size >= _LEAST_PIXELS:
            arm, of_arm = divmod(joint, _JOINTS)
            features[arm, of_arm] = np.clip(np.median(known), -_MOST_M, _MOST_M)
            features[arm, _JOINTS + of_arm] = 1.0
    return features
