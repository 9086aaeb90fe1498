"""Full bodies as rotations from SMPL's T-pose, and a file of them as AMASS has it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from cardbox_tracker.applications.teleoperation.full_body import NAMES, FullBody
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import atomic_path
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import rotation_x, rotation_z

PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21)
"""The joint before each of ``NAMES``; -1 for the pelvis."""
TO_SMPL = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""SMPL's axes: X to the left, Y up, Z ahead."""
# The pelvis of SMPL-X's mean body in its own axes, from which ``trans`` counts, m.
_SMPLX_PELVIS_M = np.array([0.0031, -0.3514, 0.0120])
_BODY_JOINTS, _BETAS = 21, 16
FEET = [NAMES.index(f"{side}_foot") for side in ("left", "right")]


def local_frames(body: FullBody) -> tuple[FloatArray, FloatArray]:
    """Return rotation (24, 3, 3) and place (24, 3), m, of each joint against the one before it.

    In the T-pose, in which hanging arms are raised sideways by a quarter, all rotations are the
    identity. Axes are those of the person. The pelvis does not turn, and is above the floor, on
    which the lower foot is.
    """
    turns = Rotation.from_quat(body.turns[:, [1, 2, 3, 0]]).as_matrix()
    for number, name in enumerate(NAMES):
        side, _, part = name.partition("_")
        if part in ("shoulder", "elbow", "wrist", "hand"):
            quarter = np.array(-np.pi / 2 if side == "left" else np.pi / 2)
            turns[number] = turns[number] @ rotation_x(quarter)
    backwards = turns[list(PARENTS)].transpose(0, 2, 1)
    backwards[0] = np.eye(3)
    places = np.einsum("nij,nj->ni", backwards, body.points_m - body.points_m[list(PARENTS)])
    places[0] = 0.0, 0.0, -body.points_m[FEET, 2].min()
    return backwards @ turns, places


def write_npz(bodies: Sequence[FullBody], rate_hz: float, path: Path) -> None:
    """Write bodies at even times as NPZ, or raise CardboxError.

    It has the arrays of AMASS for SMPL-X (https://amass.is.tue.mpg.de): ``root_orient`` (n, 3) and
    ``pose_body`` (n, 63), rotation vectors, ``trans`` (n, 3), ``betas`` (16,) of the mean body,
    ``gender``, ``mocap_frame_rate``. Z is up; the lower foot is on the floor, and the pelvis above
    the origin. It has, too, ``smpl_joints`` (n, 24, 3), m in the person's frame, with
    ``joint_names`` and ``joint_valid`` (n, 24), and ``stamp_ns`` (n,).
    """
    if not bodies:
        raise CardboxError("the results have no posture; track a recording of a person")
    frames = [local_frames(body) for body in bodies]
    turns = np.array([TO_SMPL @ one @ TO_SMPL.T for one, _ in frames])
    roots = np.array([rotation_z(np.array(body.yaw_rad)) @ TO_SMPL.T for body in bodies])
    vectors = Rotation.from_matrix(turns.reshape(-1, 3, 3)).as_rotvec().reshape(len(bodies), -1)
    arrays = {
        "gender": np.array("neutral"),
        "mocap_frame_rate": np.array(rate_hz),
        "betas": np.zeros(_BETAS),
        "root_orient": Rotation.from_matrix(roots).as_rotvec(),
        "pose_body": vectors[:, 3 : 3 * (1 + _BODY_JOINTS)],
        "trans": np.array([places[0] for _, places in frames]) - _SMPLX_PELVIS_M,
        "smpl_joints": np.array([body.points_m for body in bodies]),
        "joint_names": np.array(NAMES),
        "joint_valid": np.array([body.valid for body in bodies]),
        "stamp_ns": np.array([body.stamp_ns for body in bodies]),
    }
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)
