"""Joint angles by the recommendations of the International Society of Biomechanics.

Source: G. Wu et al., "ISB recommendation on definitions of joint coordinate systems of various
joints for the reporting of human joint motion - Part II: shoulder, elbow, wrist and hand", Journal
of Biomechanics 38 (2005) 981-992. In its frames X points forwards, Y up and Z to the right. The
left arm is mirrored, so that its angles have the signs of the right one.

The humerus has the second definition of its frame, from the directions of upper arm and forearm:
its Z axis is the normal of the plane through both. The forearm then lies in that plane, so the
carrying angle is 0, and its pronation is not known.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cardbox_tracker.applications.exporting.markers import LABORATORY
from cardbox_tracker.applications.exporting.motion import Motion
from cardbox_tracker.common.files import write_table
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import LEFT_ARM, PITCH, RIGHT_ARM, ROLL, YAW
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import (
    JOINT_NAMES,
    NECK_NAMES,
    PLACE_NAMES,
    UNITS,
    arm_directions,
    rotation_x,
    rotation_y,
    rotation_z,
)

THORAX = ("extension", "lateral_flexion_right", "axial_rotation_left")
"""Angles of the thorax in the laboratory, order Z-X'-Y''; the names tell the positive direction."""
ARM = ("plane_of_elevation", "elevation", "internal_rotation", "elbow_flexion")
"""Humerus in the thorax, order Y-X'-Y'', and elbow; the elevation is negative by the source."""
ISB_NAMES: tuple[str, ...] = (
    *(f"thorax_{name}" for name in THORAX),
    *(f"{side}_{name}" for side in ("left", "right") for name in ARM),
)

LEAST_RAISED_RAD = np.radians(10.0)
"""An arm nearer to the thorax's vertical axis has no plane of elevation and no rotation."""
LEAST_BENT_RAD = np.radians(20.0)
"""An elbow straighter than this does not show how the upper arm is rotated."""

_MIRROR = np.array([1.0, 1.0, -1.0])


def isb_angles(states: FloatArray) -> FloatArray:
    """Return the angles of ``ISB_NAMES``, (n, 11), rad; nan where they are not determined.

    Args:
        states: (n, 14), or postures (n, 12), rad and metres; nan in gaps.
    """
    d = np.asarray(states, dtype=np.float64)
    left = arm_angles(*arm_directions(d[:, LEFT_ARM], 1.0), side=1.0)
    right = arm_angles(*arm_directions(d[:, RIGHT_ARM], -1.0), side=-1.0)
    return np.hstack([thorax_angles(d), left, right])


def thorax_angles(postures: FloatArray) -> FloatArray:
    """Return extension, lateral flexion to the right and rotation to the left, (n, 3), rad.

    They are those of the whole trunk: the model's torso is one part from the hips to the neck.

    Args:
        postures: (n, 12) or (n, 14), rad and metres.
    """
    roll, pitch, yaw = (postures[:, i] for i in (ROLL, PITCH, YAW))
    torso = rotation_z(yaw) @ rotation_y(pitch) @ rotation_x(roll)
    r = LABORATORY @ torso @ LABORATORY.T
    # Rz(a) Rx(b) Ry(c)
    return np.stack(
        [
            np.arctan2(-r[:, 0, 1], r[:, 1, 1]),
            np.arcsin(np.clip(r[:, 2, 1], -1.0, 1.0)),
            np.arctan2(-r[:, 2, 0], r[:, 2, 2]),
        ],
        axis=1,
    )


def arm_angles(upper_arm: FloatArray, forearm: FloatArray, side: float) -> FloatArray:
    """Return the angles of ``ARM``, (n, 4), rad; nan where they are not determined.

    Args:
        upper_arm: unit vectors (n, 3) from shoulder to elbow in the torso's frame.
        forearm: unit vectors (n, 3) from elbow to hand in the same frame.
        side: +1 for the left arm, -1 for the right.
    """
    mirror = _MIRROR if side > 0 else np.ones(3)
    upper, lower = (v @ LABORATORY.T * mirror for v in (upper_arm, forearm))
    normal = np.cross(upper, lower)
    bent = np.linalg.norm(normal, axis=1)
    flexion = np.arctan2(bent, np.sum(upper * lower, axis=1))
    raised = np.arctan2(np.hypot(upper[:, 0], upper[:, 2]), -upper[:, 1])
    is_aside = (raised >= LEAST_RAISED_RAD) & (raised <= np.pi - LEAST_RAISED_RAD)
    plane = np.where(is_aside, np.arctan2(upper[:, 0], upper[:, 2]), np.nan)

    # In the axes after plane and elevation, the humerus is turned about its own axis Y.
    z = np.einsum("nij,njk,nk->ni", rotation_x(raised), rotation_y(-plane), normal)
    is_turned = is_aside & (flexion >= LEAST_BENT_RAD) & (flexion <= np.pi - LEAST_BENT_RAD)
    rotation = np.where(is_turned, np.arctan2(z[:, 0], z[:, 2]), np.nan)
    return np.stack([plane, -raised, rotation, flexion], axis=1)


def write_isb(path: Path, motion: Motion, body: BodyModel | None = None) -> None:
    """Write a CSV file with the angles of the ISB in degrees, then our own joints.

    Args:
        path: file to write.
        motion: the results; a row for each image, empty in gaps.
        body: not needed.

    Raises:
        CardboxError: the file cannot be written.
    """
    names = (*JOINT_NAMES, *PLACE_NAMES, *NECK_NAMES)
    values = np.hstack([np.degrees(isb_angles(motion.states)), motion.states, motion.neck])
    rows = (
        (str(stamp_ns), f"{time_s:.6f}", state, *("" if v != v else f"{v:.6f}" for v in row))
        for stamp_ns, time_s, state, row in zip(
            motion.stamp_ns.tolist(), motion.time_s, motion.state, values.tolist(), strict=True
        )
    )
    units = (f"{name}_{UNITS[name]}" for name in names)
    header = ("stamp_ns", "time_s", "state", *(f"{name}_deg" for name in ISB_NAMES), *units)
    write_table(path, header, rows)
