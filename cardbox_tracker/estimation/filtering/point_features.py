"""Features of a detector's points for the learned corrector."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.detection.image_points import ImagePoints
from cardbox_tracker.estimation.cost.joint_points import bones_of, level_sight, points_of
from cardbox_tracker.estimation.cost.joint_points_kernels import (
    ELBOW,
    KNUCKLES,
    POINTS_OF_ARM,
    SHOULDER,
    WRIST,
    WRIST_SHARE,
)
from cardbox_tracker.vision.camera import Camera

# Three values of each point of the arm, then two of each of its bones.
POINT_FEATURES = 3 * POINTS_OF_ARM + 2 * 2
"""Number of features of an arm from :func:`features_of_points`."""
_NEAREST_M = 0.1


def features_of_points(
    points: ImagePoints | None, camera: Camera, keypoints_m: FloatArray
) -> FloatArray:
    """Return the features (2, F) for the left arm and the mirrored right arm.

    For shoulder, elbow, wrist and knuckles they are the point's offset from the result's joint to
    the right and down, metres at its depth, times the score, and the score; for upper arm and
    forearm the difference of their components along the horizontal line of sight, as fractions of
    the length, times the score, and the score. All are zero without points
    and for points that are farther than half an image outside of it.

    Args:
        points: of the frame.
        camera: of the points.
        keypoints_m: of the result, (6, 3), metres in the optical frame.
    """
    features = np.zeros((2, POINT_FEATURES))
    if points is None or points.is_empty:
        return features
    found = points_of(points)
    size = np.array([camera.width, camera.height])
    is_possible = (np.abs(found[:, :2] - size / 2) < size).all(axis=1)
    found[~is_possible] = 0.0
    if not found[:, 2].any():
        return features
    for arm, row in enumerate(features):
        shoulder, elbow, hand = keypoints_m[3 * arm : 3 * arm + 3]
        joints = np.empty((POINTS_OF_ARM, 3))
        joints[[SHOULDER, ELBOW, KNUCKLES]] = shoulder, elbow, hand
        joints[WRIST] = elbow + WRIST_SHARE * (hand - elbow)
        of_arm = found[POINTS_OF_ARM * arm : POINTS_OF_ARM * (arm + 1)]
        metre_px = camera.fx / np.maximum(joints[:, 2:], _NEAREST_M)
        offsets_m = (of_arm[:, :2] - camera.project(joints)) / metre_px
        offsets_m[:, 0] *= 1.0 - 2.0 * arm
        of_points = row[: 3 * POINTS_OF_ARM].reshape(POINTS_OF_ARM, 3)
        of_points[:, :2] = offsets_m * of_arm[:, 2:]
        of_points[:, 2] = of_arm[:, 2]
        if points.spatial_m is not None:
            bones = bones_of(points.spatial_m, found)[2 * arm : 2 * arm + 2]
            away = level_sight(camera, float(found[SHOULDER::POINTS_OF_ARM, 0][:2].mean()))
            vectors = np.stack([elbow - shoulder, hand - elbow])
            own = vectors @ away / np.maximum(np.linalg.norm(vectors, axis=1), 1e-6)
            of_bones = row[3 * POINTS_OF_ARM :].reshape(2, 2)
            of_bones[:, 0] = (bones[:, 0] - own) * bones[:, 1]
            of_bones[:, 1] = bones[:, 1]
    return np.nan_to_num(features)
