"""Joint angles of the model from true keypoints.

A limb hangs along -Z of its parent's frame turned by Rx(+-abduction) Ry(-flexion), so its direction
in that frame is

    (sin f, +- sin a cos f, -cos a cos f),

with + for the left arm. The two angles follow from it; at a flexion of 90 degrees abduction is free
and given as 0.
"""

from __future__ import annotations

from collections.abc import Container

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import level_to_optical
from cardbox_tracker.person.skeleton import rotation_x, rotation_y, rotation_z
from lab.evaluation.session import RecordedSession

FloatArray = NDArray[np.float64]


def joint_angles(keypoints_m: FloatArray, torso_rad: FloatArray, pitch_rad: float) -> FloatArray:
    """Return the 11 angles of the posture, all but ``torso_y``.

    Args:
        keypoints_m: (..., 6, 3), ordered as ``KEYPOINT_NAMES``, metres in the optical frame.
        torso_rad: roll, pitch and yaw of the torso, (..., 3).
        pitch_rad: downward pitch of the camera.

    Returns:
        Shape (..., 11), rad, ordered as ``JOINT_NAMES[1:]``.
    """
    points = np.asarray(keypoints_m) @ level_to_optical(pitch_rad)
    torso = np.asarray(torso_rad)
    frame = rotation_z(torso[..., 2]) @ rotation_y(torso[..., 1]) @ rotation_x(torso[..., 0])
    angles = [torso]
    for first, side in ((0, 1.0), (3, -1.0)):
        parent = frame
        for start in (first, first + 1):
            bone = points[..., start + 1, :] - points[..., start, :]
            local = np.einsum("...ji,...j->...i", parent, bone)
            abduction, flexion = limb_angles(local, side)
            angles.append(np.stack([abduction, flexion], axis=-1))
            parent = parent @ rotation_x(side * abduction) @ rotation_y(-flexion)
    return np.concatenate(angles, axis=-1)


def true_postures(session: RecordedSession) -> FloatArray:
    """Return the true postures (n, 12) of a session; ``torso_y`` is 0.

    Unknown angles of the torso are replaced by 0, which makes the angles of the arms wrong.
    """
    postures = np.zeros((len(session.stamps_ns), 12))
    pitch_rad = float(np.radians(session.truth.pitch_deg))
    torso_rad = np.nan_to_num(session.torso_rad)
    postures[:, 1:] = joint_angles(session.keypoints_m, torso_rad, pitch_rad)
    return postures


def comparable(session: RecordedSession, found: Container[int]) -> NDArray[np.bool_]:
    """Return a mask (n,) of the images with a true torso and a stamp in ``found``, ns.

    Raises:
        ValueError: there is no such image.
    """
    known = np.array([stamp in found for stamp in session.stamps_ns.tolist()], dtype=bool)
    known &= np.isfinite(session.torso_rad).all(axis=1)
    if not known.any():
        raise ValueError(f"{session.name} has no image with both an estimate and the true torso")
    return known


def limb_angles(bone: FloatArray, side: float) -> tuple[FloatArray, FloatArray]:
    """Return abduction and flexion (...), rad, of a limb along ``bone`` (..., 3).

    Args:
        bone: in the frame of the limb's parent, of any length above 0.
        side: +1 for the left arm, -1 for the right.
    """
    unit = bone / np.linalg.norm(bone, axis=-1, keepdims=True)
    flexion = np.arcsin(np.clip(unit[..., 0], -1.0, 1.0))
    abduction = np.arctan2(side * unit[..., 1], -unit[..., 2])
    return np.where(np.abs(unit[..., 0]) < 1.0 - 1e-12, abduction, 0.0), flexion
