"""Compiled outlines of the whole body: the corners of its patches in the optical frame.

Torso, waist, neck and head are drawn as outlines of elliptic frustums, so their width is right from
any side; the torso's top is a rectangle. A limb is a bar that faces the camera, with a square at
its end. These are 13 patches instead of the cardbox's 15.
"""

from __future__ import annotations

from math import sqrt

from cardbox_tracker.common.compiling import inlined_allocation, inlined_kernel, kernel
from cardbox_tracker.person.kinematics import (
    PosedArm,
    angles_in,
    new_arm,
    pose_arm,
    side_of,
    state_pose,
    turn_arm,
)
from cardbox_tracker.person.parts import (
    BOTTOM,
    BOTTOM_WIDTH,
    DEPTH,
    FOREARM,
    FORWARD,
    HEIGHT,
    TOP_WIDTH,
    TORSO,
    UPPER_ARM,
)
from cardbox_tracker.terms.kernel_arguments import Body, BodyTuple, Floats, body_of
from cardbox_tracker.terms.rasterisation import Workspace, new_workspace

_TRUNK_PARTS, TRUNK_PATCHES, LIMB_PATCHES = 4, 5, 2
ARM_PATCHES = 2 * LIMB_PATCHES
BODY_PATCHES = TRUNK_PATCHES + 2 * ARM_PATCHES
# A square replaces the disc of equal area at an elbow (limbs' mean width) and at a hand's end
# (forearm's width); half its side is sqrt(pi) / 2 = 0.886 of the radius.
_SQUARE_OF_DISC = 0.886


@inlined_kernel
def _frustum(part: Floats, p: int, vx: float, vy: float, shape: Floats) -> None:
    """Write patch ``p``: the outline of an elliptic frustum of the torso's frame.

    The line of sight is the level direction (vx, vy). The outline of an ellipse with half axes a
    along Y and b along X consists of the two points

        +-(-vy b^2, vx a^2) / sqrt(vy^2 b^2 + vx^2 a^2)
    """
    patches = shape.shape[1] // 4
    b = part[DEPTH] / 2
    for end in range(2):
        a = (part[BOTTOM_WIDTH] if end == 0 else part[TOP_WIDTH]) / 2
        z = part[BOTTOM] if end == 0 else part[BOTTOM] + part[HEIGHT]
        norm = sqrt(vy * vy * b * b + vx * vx * a * a) + 1e-9
        x, y = -vy * b * b / norm, vx * a * a / norm
        one = (0 if end == 0 else 3) * patches + p
        other = (1 if end == 0 else 2) * patches + p
        shape[0, one], shape[1, one], shape[2, one] = part[FORWARD] - x, -y, z
        shape[0, other], shape[1, other], shape[2, other] = part[FORWARD] + x, y, z


@inlined_kernel
def lid(part: Floats, p: int, shape: Floats) -> None:
    """Write patch ``p``: the horizontal rectangle at the top of a part."""
    patches = shape.shape[1] // 4
    x, y = part[DEPTH] / 2, part[TOP_WIDTH] / 2
    for c in range(4):
        e = c * patches + p
        shape[0, e] = x if c == 1 or c == 2 else -x
        shape[1, e] = y if c >= 2 else -y
        shape[2, e] = part[BOTTOM] + part[HEIGHT]


@inlined_kernel
def place_trunk(work: Workspace, drawn: Floats) -> None:
    """Write the corners of torso, waist, neck, head and the torso's top, patches 0 to 4."""
    rotation, hip, shape, corners = work.torso, work.hip, work.shape, work.corners
    # Line of sight, level in the torso's frame, to half the height of the torso's top.
    middle = 0.5 * (drawn[TORSO, BOTTOM] + drawn[TORSO, HEIGHT])
    x = hip[0] + middle * rotation[0, 2]
    y = hip[1] + middle * rotation[1, 2]
    z = hip[2] + middle * rotation[2, 2]
    vx = rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z
    vy = rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z
    norm = sqrt(vx * vx + vy * vy) + 1e-9
    for p in range(_TRUNK_PARTS):
        _frustum(drawn[p], p, vx / norm, vy / norm, shape)
    # The top is visible if the person bows.
    lid(drawn[TORSO], _TRUNK_PARTS, shape)
    patches = shape.shape[1] // 4
    for j in range(3):
        for c in range(4):
            for e in range(c * patches, c * patches + TRUNK_PATCHES):
                turned = rotation[j, 0] * shape[0, e] + rotation[j, 1] * shape[1, e]
                corners[j, e] = hip[j] + turned + rotation[j, 2] * shape[2, e]


@inlined_kernel
def _place_limb(
    arm: PosedArm, limb: int, size: tuple[float, float, float], p: int, corners: Floats
) -> None:
    """Write patches ``p``, a bar that faces the camera, and ``p`` + 1, a square around its end.

    ``size`` is the length of the bar, half its width, and half the side of the square, metres;
    ``limb`` is 0 for the upper arm, 1 for the forearm.
    """
    start, end, axis = arm.joints[limb], arm.joints[limb + 1], arm.axes[limb]
    length, half, cap = size
    patches = corners.shape[1] // 4
    mx = start[0] + 0.5 * length * axis[0]
    my = start[1] + 0.5 * length * axis[1]
    mz = start[2] + 0.5 * length * axis[2]
    # Direction across limb and line of sight.
    sx = my * axis[2] - mz * axis[1]
    sy = mz * axis[0] - mx * axis[2]
    sz = mx * axis[1] - my * axis[0]
    norm = sqrt(sx * sx + sy * sy + sz * sz)
    far = sqrt(mx * mx + my * my + mz * mz) + 1e-12
    if norm < 1e-6 * far:
        # The limb points to the camera, so any direction is valid.
        sx, sy, sz, norm = 1.0, 0.0, 0.0, 1.0
    sx, sy, sz = sx / norm, sy / norm, sz / norm
    # Direction across that one and the line of sight.
    tx, ty, tz = (sy * mz - sz * my) / far, (sz * mx - sx * mz) / far, (sx * my - sy * mx) / far
    for c in range(4):
        is_first = c == 0 or c == 3
        a = -half if is_first else half
        b = 0.0 if c < 2 else length
        e = c * patches + p
        corners[0, e] = start[0] + b * axis[0] + a * sx
        corners[1, e] = start[1] + b * axis[1] + a * sy
        corners[2, e] = start[2] + b * axis[2] + a * sz
        a = -cap if is_first else cap
        b = -cap if c < 2 else cap
        corners[0, e + 1] = end[0] + a * sx + b * tx
        corners[1, e + 1] = end[1] + a * sy + b * ty
        corners[2, e + 1] = end[2] + a * sz + b * tz


@inlined_kernel
def place_arm(arm: PosedArm, p: int, drawn: Floats, corners: Floats) -> None:
    """Write the corners of an arm, patches ``p`` to ``p`` + 3, from its joints and axes."""
    half, thin = drawn[UPPER_ARM, TOP_WIDTH] / 2, drawn[FOREARM, TOP_WIDTH] / 2
    elbow_cap, hand_cap = _SQUARE_OF_DISC * (half + thin) / 2, _SQUARE_OF_DISC * thin
    upper_m, fore_m = drawn[UPPER_ARM, HEIGHT], drawn[FOREARM, HEIGHT]
    _place_limb(arm, 0, (upper_m, half, elbow_cap), p, corners)
    _place_limb(arm, 1, (fore_m, thin, hand_cap), p + LIMB_PATCHES, corners)


@inlined_allocation
def new_scratch() -> tuple[Workspace, PosedArm]:
    """Return the scratch arrays of :func:`place_patches`."""
    return new_workspace(BODY_PATCHES, 1), new_arm()


@inlined_kernel
def place_patches(state: Floats, body: Body, work: Workspace, arm: PosedArm) -> None:
    """Write the corners of all patches of a state into ``work``."""
    state_pose(state, body.place, body.camera, work.torso, work.hip)
    place_trunk(work, body.drawn)
    for k in range(2):
        angles = angles_in(state, k)
        pose_arm(angles, side_of(k), body.parts, body.girdle, arm.points, arm.directions)
        turn_arm(arm, work.torso, work.hip)
        place_arm(arm, TRUNK_PATCHES + ARM_PATCHES * k, body.drawn, work.corners)


@kernel
def corners_of_body(state: Floats, body: BodyTuple, corners_m: Floats) -> None:
    """Write the patches of a state to ``corners_m`` (13, 4, 3), metres in the optical frame."""
    work, arm = new_scratch()
    place_patches(state, body_of(body), work, arm)
    for p in range(BODY_PATCHES):
        for c in range(4):
            for j in range(3):
                corners_m[p, c, j] = work.corners[j, c * BODY_PATCHES + p]
