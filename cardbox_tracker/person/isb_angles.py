"""Angles of elbow, upper arm and trunk by the International Society of Biomechanics.

Source: G. Wu et al., "ISB recommendation on definitions of joint coordinate systems of various
joints for the reporting of human joint motion - Part II: shoulder, elbow, wrist and hand", Journal
of Biomechanics 38 (2005) 981-992. In its frames X points forwards, Y up and Z to the right. The
left arm is mirrored, so that its angles have the signs of the right one.

The humerus has the second definition of its frame, from the directions of upper arm and forearm:
its Z axis is the normal of the plane through both. The forearm then lies in that plane, so the
carrying angle is 0, and its pronation is not known.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.person.posture import LEFT_ARM, PITCH, RIGHT_ARM, ROLL, YAW
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import arm_directions, rotation_x, rotation_y, rotation_z

LABORATORY: FloatArray = np.array([(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)])
"""Rotation from the reference frame, or the body frame, into axes forwards, up and right."""
LABORATORY.setflags(write=False)

SIDES = ("left", "right")
THORAX = ("extension", "lateral_flexion_right", "axial_rotation_left")
"""Angles of the thorax in the laboratory, order Z-X'-Y''; the names tell the positive direction."""
ARM = ("plane_of_elevation", "elevation", "internal_rotation", "elbow_flexion")
"""Humerus in the thorax, order Y-X'-Y'', and elbow; the elevation is negative by the source."""
ISB_NAMES: tuple[str, ...] = (
    *(f"thorax_{name}" for name in THORAX),
    *(f"{side}_{name}" for side in SIDES for name in ARM),
)

ANATOMICAL_NAMES = (
    *("left_elbow_bend_deg", "left_arm_elevation_deg", "left_arm_plane_deg"),
    *("right_elbow_bend_deg", "right_arm_elevation_deg", "right_arm_plane_deg"),
    *("trunk_lean_deg", "trunk_side_lean_deg"),
)
"""Angles in plain words, see :func:`anatomical_angles`."""

LEAST_RAISED_RAD = np.radians(10.0)
"""An arm nearer to the thorax's vertical axis has no plane of elevation and no rotation."""
LEAST_BENT_RAD = np.radians(20.0)
"""An elbow straighter than this does not show how the upper arm is rotated."""

_OF_ARM = (("elbow_flexion", 1.0), ("elevation", -1.0), ("plane_of_elevation", 1.0))


def isb_angles(states: FloatArray) -> FloatArray:
    """Return ``ISB_NAMES``, (n, 11), rad, of states or postures; nan where not determined."""
    d = np.asarray(states, dtype=np.float64)
    left = arm_angles(*arm_directions(d[:, LEFT_ARM], 1.0), side=1.0)
    right = arm_angles(*arm_directions(d[:, RIGHT_ARM], -1.0), side=-1.0)
    return np.hstack([thorax_angles(d), left, right])


def anatomical_angles(postures: FloatArray) -> FloatArray:
    """Return the angles of ``ANATOMICAL_NAMES``, (n, 8), degrees; nan where undetermined.

    The bend of an elbow is 0 for a straight arm. Elevation is the angle between the upper arm and
    the hanging one, and its plane is 0 to the side and 90 to the front; both are against the trunk.
    The trunk leans to the front and to the right of the direction in which the person faces. The
    postures are (n, 12), rad and metres.
    """
    found = dict(zip(ISB_NAMES, np.degrees(isb_angles(postures)).T, strict=True))
    arms = [sign * found[f"{side}_{name}"] for side in SIDES for name, sign in _OF_ARM]
    return np.stack([*arms, *np.degrees(postures[:, [PITCH, ROLL]]).T], axis=1)


def thorax_angles(postures: FloatArray) -> FloatArray:
    """Return the whole trunk's extension, lateral flexion right, rotation left, (n, 3), rad."""
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

    Unit vectors (n, 3) in the torso's frame lead from shoulder to elbow, and from there to the
    hand; ``side`` is +1 for the left arm, -1 for the right.
    """
    upper, lower = (v @ LABORATORY.T * (1.0, 1.0, -side) for v in (upper_arm, forearm))
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
