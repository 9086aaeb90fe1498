"""Compiled costs of the cardbox model: kinematics, projection, rasterisation and XOR in one pass.

Let h be 1 on the drawn model and f be 1 on the silhouette. Then (h XOR f) = f + h (1 - 2 f), so
equation (2) becomes

    W = sum of f + sum over the pixels covered by the model of (1 - 2 f)

The first sum is a constant of the image. The second is counted in bits, see
:mod:`cardbox_tracker.terms.bit_masks`. For the arms, pixels that the trunk covers do not count, so
an arm particle draws only its own 4 patches instead of 11.
"""

from __future__ import annotations

from cardbox_tracker.common.compiling import index, inlined_kernel, kernel
from cardbox_tracker.person.kinematics import angles_in, side_of, torso_pose, turn_limb
from cardbox_tracker.person.parts import (
    BOTTOM,
    BOTTOM_WIDTH,
    DEPTH,
    FOREARM,
    FORWARD,
    HEAD,
    HEIGHT,
    NECK,
    TOP_WIDTH,
    TORSO,
    UPPER_ARM,
    WAIST,
)
from cardbox_tracker.terms.bit_masks import Masks, cover_masks, new_masks, sum_masks
from cardbox_tracker.terms.bit_planes import Planes
from cardbox_tracker.terms.body_outline import lid
from cardbox_tracker.terms.kernel_arguments import (
    Cardbox,
    CardboxTuple,
    Counts,
    Floats,
    Intrinsics,
    IntrinsicsTuple,
    cardbox_of,
)
from cardbox_tracker.terms.rasterisation import Workspace, draw, new_workspace

TRUNK_PATCHES = 8
"""7 patches of the paper and a neck, which is empty at width 0; a multiple of four for loops."""
ARM_PATCHES = 4
_BODY_PATCHES = TRUNK_PATCHES + 2 * ARM_PATCHES
Size = tuple[int, int]


@inlined_kernel
def _joint(axis: int, side: float, shoulder: Floats, torso: Floats, hip: Floats) -> float:
    """Return a coordinate of a shoulder joint: hip + torso (0, side aside, height)."""
    joint: float = hip[axis] + side * shoulder[0] * torso[axis, 1] + shoulder[1] * torso[axis, 2]
    return joint


@inlined_kernel
def _upright(part: Floats, is_frontal: bool, p: int, shape: Floats) -> None:
    """Write patch ``p``: a part's frontal trapezoid, in the plane of Y and Z, or its sagittal one.

    The order of the corners is left and right below, then right and left above.
    """
    patches = shape.shape[1] // 4
    half_below = (part[BOTTOM_WIDTH] if is_frontal else part[DEPTH]) / 2
    half_above = (part[TOP_WIDTH] if is_frontal else part[DEPTH]) / 2
    for c in range(4):
        e = c * patches + p
        half = half_below if c < 2 else half_above
        aside = half if c == 1 or c == 2 else -half
        shape[0, e] = part[FORWARD] + (0.0 if is_frontal else aside)
        shape[1, e] = aside if is_frontal else 0.0
        shape[2, e] = part[BOTTOM] if c < 2 else part[BOTTOM] + part[HEIGHT]


@inlined_kernel
def _shape_trunk(parts: Floats, shape: Floats) -> None:
    """Write patches 0 to 7, in the torso's frame; see ``person/cardbox.py``."""
    _upright(parts[TORSO], True, 0, shape)
    _upright(parts[TORSO], False, 1, shape)
    lid(parts[TORSO], 2, shape)
    _upright(parts[WAIST], True, 3, shape)
    _upright(parts[WAIST], False, 4, shape)
    _upright(parts[HEAD], True, 5, shape)
    _upright(parts[HEAD], False, 6, shape)
    if parts[NECK, TOP_WIDTH] > 0.0:
        _upright(parts[NECK], True, 7, shape)


@inlined_kernel
def _shape_arm(parts: Floats, first: int, shape: Floats) -> None:
    """Write the patches of upper arm and forearm, from ``first`` on, in the frames of the parts."""
    _upright(parts[UPPER_ARM], True, first, shape)
    _upright(parts[UPPER_ARM], False, first + 1, shape)
    _upright(parts[FOREARM], True, first + 2, shape)
    _upright(parts[FOREARM], False, first + 3, shape)


@inlined_kernel
def _shape_body(parts: Floats, shape: Floats) -> None:
    """Write the patches of the trunk, the left and the right arm."""
    _shape_trunk(parts, shape)
    for arm in range(2):
        _shape_arm(parts, TRUNK_PATCHES + ARM_PATCHES * arm, shape)


@inlined_kernel
def _place(
    shape: Floats, first: int, end: int, rotation: Floats, origin: Floats, corners: Floats
) -> None:
    """Transform the patches ``first`` to ``end`` from their part's frame to the optical frame."""
    patches = shape.shape[1] // 4
    for j in range(3):
        a, b, c, o = rotation[j, 0], rotation[j, 1], rotation[j, 2], origin[j]
        for corner in range(4):
            at = corner * patches
            for e in range(at + first, at + end):
                x, y, z = shape[0, index(e)], shape[1, index(e)], shape[2, index(e)]
                corners[j, index(e)] = o + a * x + b * y + c * z


@inlined_kernel
def _place_trunk(work: Workspace) -> None:
    """Write the corners of torso, waist, head and neck, the first patches, in the torso's pose."""
    _place(work.shape, 0, TRUNK_PATCHES, work.torso, work.hip, work.corners)


@inlined_kernel
def _place_arm(work: Workspace, first: int, angles: Floats, side: float, model: Cardbox) -> None:
    """Write an arm's corners from ``first`` on, of ``angles`` (4,), rad; ``side`` 1 is left."""
    elbow, end = first + ARM_PATCHES // 2, first + ARM_PATCHES
    for j in range(3):
        work.joint[j] = _joint(j, side, model.shoulder, work.torso, work.hip)
    turn_limb(work.torso, side * angles[0], angles[1], work.upper_arm)
    _place(work.shape, first, elbow, work.upper_arm, work.joint, work.corners)
    for j in range(3):
        work.joint[j] -= model.parts[UPPER_ARM, HEIGHT] * work.upper_arm[j, 2]
    turn_limb(work.upper_arm, side * angles[2], angles[3], work.forearm)
    _place(work.shape, elbow, end, work.forearm, work.joint, work.corners)


@inlined_kernel
def _place_body(work: Workspace, posture: Floats, model: Cardbox) -> None:
    """Write the corners of all 16 patches for d1..d12."""
    torso_pose(posture, model.place, model.camera, work.torso, work.hip)
    _place_trunk(work)
    for arm in range(2):
        first = TRUNK_PATCHES + ARM_PATCHES * arm
        _place_arm(work, first, angles_in(posture, arm), side_of(arm), model)


@inlined_kernel
def _sum(
    work: Workspace, camera: Intrinsics, size: Size, planes: Planes, masks: Masks
) -> tuple[int, int]:
    """Draw all patches; return their sum of (1 - 2 f) and their area, px."""
    has_cuts = draw(work, camera, size[0], size[1])
    return sum_masks(work, has_cuts, size[1], planes, masks)


@kernel
def trunk_costs(
    postures: Floats, cardbox: CardboxTuple, size: Size, planes: Planes, base: int, costs: Counts
) -> None:
    """Write the costs (N,) of trunks (N, 4), given the cost ``base`` of drawing nothing.

    Here and below, ``size`` is the number of rows that count, and the width, px.
    """
    model = cardbox_of(cardbox)
    work, masks = new_workspace(TRUNK_PATCHES, planes.shape[2]), new_masks(TRUNK_PATCHES, planes)
    _shape_trunk(model.parts, work.shape)
    for i in range(postures.shape[0]):
        torso_pose(postures[i], model.place, model.camera, work.torso, work.hip)
        _place_trunk(work)
        costs[i] = base + _sum(work, model.camera, size, planes, masks)[0]


@kernel
def cover_trunk(
    torso: Floats, cardbox: CardboxTuple, size: Size, planes: Planes, covered: Planes
) -> int:
    """Write the planes outside of a trunk (4,) to ``covered``; return the gain of the trunk."""
    model = cardbox_of(cardbox)
    work, masks = new_workspace(TRUNK_PATCHES, planes.shape[2]), new_masks(TRUNK_PATCHES, planes)
    _shape_trunk(model.parts, work.shape)
    torso_pose(torso, model.place, model.camera, work.torso, work.hip)
    _place_trunk(work)
    gain = _sum(work, model.camera, size, planes, masks)[0]
    cover_masks(masks, planes, covered)
    return gain


@kernel
def cover_arms(
    posture: Floats, cardbox: CardboxTuple, size: Size, planes: Planes, covered: Planes
) -> int:
    """Write the planes outside of the arms of a posture (12,); return the gain of the arms."""
    model, patches = cardbox_of(cardbox), 2 * ARM_PATCHES
    work, masks = new_workspace(patches, planes.shape[2]), new_masks(patches, planes)
    torso_pose(posture, model.place, model.camera, work.torso, work.hip)
    for arm in range(2):
        first = ARM_PATCHES * arm
        _shape_arm(model.parts, first, work.shape)
        _place_arm(work, first, angles_in(posture, arm), side_of(arm), model)
    gain = _sum(work, model.camera, size, planes, masks)[0]
    cover_masks(masks, planes, covered)
    return gain


@kernel
def arm_costs(
    postures: Floats,
    side: float,
    torso: Floats,
    cardbox: CardboxTuple,
    size: Size,
    covered: Planes,
    base: int,
    costs: Counts,
) -> None:
    """Write the costs (N,) of arms (N, 4) beside a trunk (4,), given its planes and its cost."""
    model = cardbox_of(cardbox)
    work, masks = new_workspace(ARM_PATCHES, covered.shape[2]), new_masks(ARM_PATCHES, covered)
    _shape_arm(model.parts, 0, work.shape)
    torso_pose(torso, model.place, model.camera, work.torso, work.hip)
    for i in range(postures.shape[0]):
        _place_arm(work, 0, postures[i], side, model)
        costs[i] = base + _sum(work, model.camera, size, covered, masks)[0]


@kernel
def full_costs(
    postures: Floats,
    cardbox: CardboxTuple,
    size: Size,
    planes: Planes,
    base: int,
    costs: Counts,
    areas: Counts,
) -> None:
    """Write costs and drawn areas (N,), px, of whole postures (N, 12)."""
    model = cardbox_of(cardbox)
    work, masks = new_workspace(_BODY_PATCHES, planes.shape[2]), new_masks(_BODY_PATCHES, planes)
    _shape_body(model.parts, work.shape)
    for i in range(postures.shape[0]):
        _place_body(work, postures[i], model)
        gain, areas[i] = _sum(work, model.camera, size, planes, masks)
        costs[i] = base + gain


@kernel
def body_costs(
    postures: Floats, bodies: CardboxTuple, size: Size, planes: Planes, base: int, costs: Counts
) -> None:
    """Write the costs (N,) of N ``bodies`` at one place in the N ``postures`` (N, 12)."""
    work, masks = new_workspace(_BODY_PATCHES, planes.shape[2]), new_masks(_BODY_PATCHES, planes)
    parts, shoulders, place, camera = bodies
    for i in range(postures.shape[0]):
        model = cardbox_of((parts[i], shoulders[i], place, camera))
        _shape_body(model.parts, work.shape)
        _place_body(work, postures[i], model)
        costs[i] = base + _sum(work, model.camera, size, planes, masks)[0]


@kernel
def polygon_costs(
    corners_m: Floats, camera: IntrinsicsTuple, size: Size, planes: Planes, base: int, costs: Counts
) -> None:
    """Write the costs (N,) of quadrilaterals (N, K, 4, 3) in the optical frame, metres."""
    count = corners_m.shape[1]
    work, masks = new_workspace(count, planes.shape[2]), new_masks(count, planes)
    for i in range(corners_m.shape[0]):
        for p in range(count):
            for c in range(4):
                for axis in range(3):
                    work.corners[axis, c * count + p] = corners_m[i, p, c, axis]
        costs[i] = base + _sum(work, Intrinsics(*camera), size, planes, masks)[0]
