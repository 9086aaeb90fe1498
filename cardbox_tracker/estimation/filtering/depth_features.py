"""Features of a depth image for the learned corrector: how far behind the result its surface is.

The term of the depth (:mod:`cardbox_tracker.estimation.cost.depth`) has chosen among the states
with it; the remaining distances at shoulder, elbow and hand say where the result is still wrong.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.terms import Frame
from cardbox_tracker.vision.camera import Camera

_JOINTS = 3
DEPTH_FEATURES = 2 * _JOINTS
"""How many numbers :func:`features_of_depth` returns for an arm."""

# How far the square around a joint reaches whose pixels count, m; how many have to be known.
_NEAR_M, _LEAST_PIXELS = 0.03, 4
# Farther away it is another part of the body, or the wall.
_MOST_M = 0.3


def features_of_depth(frame: Frame, camera: Camera, keypoints_m: FloatArray) -> FloatArray:
    """Return what a network sees, (2, F), of the left arm and of the right one.

    Of shoulder, elbow and hand: how far the surface there is behind the joint, metres, at most
    0.3, and then, of each, 1 where that is known and 0 elsewhere. All are 0 without a depth image.

    Args:
        frame: silhouette and depth image, (H, W).
        camera: of both.
        keypoints_m: of the result, (6, 3), metres in the optical frame.
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
        # The wall is beside the person, and 0 is unknown.
        known = behind_m[(frame.silhouette[rows, columns] > 0) & (np.abs(behind_m) < 2 * _MOST_M)]
        if known.size >= _LEAST_PIXELS:
            arm, of_arm = divmod(joint, _JOINTS)
            features[arm, of_arm] = np.clip(np.median(known), -_MOST_M, _MOST_M)
            features[arm, _JOINTS + of_arm] = 1.0
    return features
