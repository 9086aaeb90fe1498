"""Compiled ratings of whole bodies: kinematics with a shoulder girdle, rounded outlines, priors.

A *state* (14,) is a posture d1..d12 and, at ``TORSO_X`` and ``TORSO_Z``, how far the hips are
nearer to the camera and higher than the body model says, metres. Its rating is a share of the
silhouette:

    rating = (pixels in which model and silhouette differ) / (pixels of the silhouette) + priors

The pixels are those of equation (2), counted by the functions of
:mod:`cardbox_tracker.estimation.cost.kernels`; what is drawn is another model than the cardbox.
Torso, waist, neck and head are the outlines of elliptic frustums, so they look as wide from any
side as a body does, with the torso's top as a rectangle; a limb is a bar that faces the camera with
a square at its end. These are 13 patches instead of 15. The steps below are *kinematics*,
*outlines*, *priors*, *ratings*.

Who changes ``kernels.py``, ``pose_prior.py`` or this file has to delete the cache of compiled code
of the others: the cache on disk only knows the file of the function that is called.
"""

from __future__ import annotations

from math import acos, asin, atan2, cos, exp, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from cardbox_tracker.compiling import njit
from cardbox_tracker.estimation.cost.kernels import (
    Floats,
    Place,
    PlaceTuple,
    View,
    ViewTuple,
    Workspace,
    _cover,
    _draw,
    _lid,
    _sum_union,
    _torso_pose,
    _workspace,
)
from cardbox_tracker.estimation.cost.pose_prior import nats_of
from cardbox_tracker.estimation.cost.row_sums import RowSums

_compile = njit(cache=True, nogil=True, error_model="numpy")
_inline = njit(cache=True, nogil=True, error_model="numpy", forceinline=True)

# A state: d1..d12, then the offset of the hips.
TORSO_Y, ROLL, PITCH, YAW = 0, 1, 2, 3
LEFT_ARM, RIGHT_ARM, ARM_ANGLES = 4, 8, 4
TORSO_X, TORSO_Z = 12, 13
N_STATE = 14

# Rows and columns of ``parts`` and ``drawn`` (6, 6), as in kernels.py: ``parts`` are the measured
# parts, ``drawn`` those whose outlines are drawn, with a longer waist, neck and forearm.
TORSO, WAIST, NECK, HEAD, UPPER_ARM, FOREARM = 0, 1, 2, 3, 4, 5
BOTTOM, HEIGHT, BOTTOM_WIDTH, TOP_WIDTH, DEPTH, FORWARD = 0, 1, 2, 3, 4, 5

# What ``girdle`` (5,) holds: the shoulder joint of a hanging arm in the torso's frame, m; the
# radius of the circle on which it is lifted, m; radians of that circle per radian of elevation, and
# the elevation where it begins, rad.
ASIDE, UPWARDS, CLAVICLE, LIFT_GAIN, LIFT_FROM = 0, 1, 2, 3, 4

# What ``rules`` (15,) of the priors hold; ``WholeBodyConfig`` describes them.
(
    WEIGHT,
    ROLL_UNIT,
    PITCH_REST,
    FORWARD_UNIT,
    BACK_UNIT,
    YAW_UNIT,
    ANGLE_CAP,
    X_STEP,
    Z_STEP,
    STEP_CAP,
    X_HOME,
    Z_HOME,
    HOME_CAP,
    PENETRATION,
    UNKNOWN_DENSITY,
) = range(15)
N_RULES = 15

_TRUNK_PARTS, TRUNK_PATCHES, _LIMB_PATCHES = 4, 5, 2
ARM_PATCHES = 2 * _LIMB_PATCHES
BODY_PATCHES = TRUNK_PATCHES + 2 * ARM_PATCHES
# The square at an elbow is as large as the disc of the limbs' mean width, that at a hand's end as
# the disc of the forearm's width: half sides, sqrt(pi) / 2 = 0.886 of the radius.
_SQUARE_OF_DISC = 0.886
# Below the middle of the hips a body ends, m: a hanging arm is not inside the legs.
_HIPS_END_M = -0.1


class Arm(NamedTuple):
    """Scratch of one arm."""

    points: Floats
    """(3, 3): shoulder, elbow, hand in the torso's frame, metres."""
    directions: Floats
    """(6,): unit vectors of upper arm and forearm in the torso's frame."""
    joints: Floats
    """(3, 3): the points in the optical frame, metres."""
    axes: Floats
    """(2, 3): the directions in the optical frame."""
    away: Floats
    """(6,): scratch of the arms' prior."""
    outward: Floats
    """(6,): the directions with y outwards, as the arms' prior has them; scratch else."""


@_inline
def _new_arm() -> Arm:
    return Arm(
        points=np.empty((3, 3)),
        directions=np.empty(6),
        joints=np.empty((3, 3)),
        axes=np.empty((2, 3)),
        away=np.empty(6),
        outward=np.empty(6),
    )


# ---------------------------------------------------------------------------------------------
# Kinematics


@_inline
def _first_angle(arm: int) -> int:
    """Where the angles of the left arm, 0, or the right, 1, begin in a state."""
    return LEFT_ARM + ARM_ANGLES * arm


@_inline
def _side_of(arm: int) -> float:
    """1 for the left arm, 0, and -1 for the right, 1."""
    return 1.0 - 2.0 * arm


@_inline
def _pose(state: Floats, place: Place, view: View, rotation: Floats, hip: Floats) -> None:
    """Write rotation (3, 3) and mid-hip (3,) of the torso in the optical frame."""
    moved = Place(place.distance_m - state[TORSO_X], place.hip_height_m + state[TORSO_Z])
    _torso_pose(state, moved, view, rotation, hip)


@_inline
def _pose_arm(
    angles: Floats, side: float, parts: Floats, girdle: Floats, points: Floats, directions: Floats
) -> None:
    """Write shoulder, elbow, hand (3, 3) and the directions (6,) of an arm in the torso's frame.

    With the angles a, f of the shoulder the upper arm's frame is Rx(a) Ry(-f), and it points along
    -Z of it; the forearm's direction in that frame is (sin g, sin e cos g, -cos e cos g). The
    girdle lifts the shoulder on a circle of radius r by b = gain (elevation - start):

        aside = aside0 - r (1 - cos b),    upwards = upwards0 + r sin b
    """
    ca, sa = cos(side * angles[0]), sin(side * angles[0])
    cf, sf = cos(angles[1]), sin(angles[1])
    # Columns x, y and z of the upper arm's frame; the x component of y is 0.
    x0, x1, x2 = cf, -sa * sf, ca * sf
    y1, y2 = ca, sa
    z0, z1, z2 = -sf, -sa * cf, ca * cf
    ce, se = cos(side * angles[2]), sin(side * angles[2])
    cg, sg = cos(angles[3]), sin(angles[3])
    w0, w1, w2 = sg, se * cg, -ce * cg
    directions[0], directions[1], directions[2] = -z0, -z1, -z2
    directions[3] = x0 * w0 + z0 * w2
    directions[4] = x1 * w0 + y1 * w1 + z1 * w2
    directions[5] = x2 * w0 + y2 * w1 + z2 * w2
    elevation = acos(min(max(z2, -1.0), 1.0))
    lift = girdle[LIFT_GAIN] * max(elevation - girdle[LIFT_FROM], 0.0)
    points[0, 0] = 0.0
    points[0, 1] = side * (girdle[ASIDE] - girdle[CLAVICLE] * (1.0 - cos(lift)))
    points[0, 2] = girdle[UPWARDS] + girdle[CLAVICLE] * sin(lift)
    for c in range(3):
        points[1, c] = points[0, c] + parts[UPPER_ARM, HEIGHT] * directions[c]
        points[2, c] = points[1, c] + parts[FOREARM, HEIGHT] * directions[3 + c]


@_inline
def _turn_arm(arm: Arm, rotation: Floats, hip: Floats) -> None:
    """Write joints and axes of an arm in the optical frame from those in the torso's."""
    for j in range(3):
        a, b, c = rotation[j, 0], rotation[j, 1], rotation[j, 2]
        for i in range(3):
            point = arm.points[i, 0] * a + arm.points[i, 1] * b + arm.points[i, 2] * c
            arm.joints[i, j] = hip[j] + point
        for i in range(2):
            o = 3 * i
            arm.axes[i, j] = (
                arm.directions[o] * a + arm.directions[o + 1] * b + arm.directions[o + 2] * c
            )


@_inline
def angles_of_arm(directions: Floats, side: float, limits: Floats, angles: Floats) -> None:
    """Write the angles (4,) of an arm with ``directions`` (6,) in the torso's frame.

    The inverse of :func:`_pose_arm`, within ``limits`` (4, 2).
    """
    flexion = asin(min(max(directions[0], -1.0), 1.0))
    turned = atan2(directions[1], -directions[2])
    abduction = side * turned
    if abduction < -0.5 * pi:
        abduction += 2.0 * pi
    ca, sa = cos(turned), sin(turned)
    cf, sf = cos(flexion), sin(flexion)
    u, v, w = directions[3], directions[4], directions[5]
    # The forearm along the columns of the upper arm's frame.
    along_x = cf * u - sa * sf * v + ca * sf * w
    along_y = ca * v + sa * w
    along_z = -sf * u - sa * cf * v + ca * cf * w
    angles[0], angles[1] = abduction, flexion
    angles[2] = side * atan2(along_y, -along_z)
    angles[3] = asin(min(max(along_x, -1.0), 1.0))
    for i in range(4):
        angles[i] = min(max(angles[i], limits[i, 0]), limits[i, 1])


@_compile
def directions_of_arm(angles: Floats, side: float) -> Floats:
    """Return the directions (6,) of upper arm and forearm in the torso's frame for angles (4,)."""
    points, directions = np.empty((3, 3)), np.empty(6)
    _pose_arm(angles, side, np.zeros((6, 6)), np.zeros(5), points, directions)
    return directions


@_compile
def angles_of_arms(directions: Floats, side: float, limits: Floats) -> Floats:
    """Return the angles (N, 4) of arms with ``directions`` (N, 6), within ``limits`` (4, 2)."""
    angles = np.empty((directions.shape[0], 4))
    for i in range(directions.shape[0]):
        angles_of_arm(directions[i], side, limits, angles[i])
    return angles


@_compile
def keypoints(
    state: Floats,
    parts: Floats,
    girdle: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    points: Floats,
) -> None:
    """Write shoulder, elbow, hand of the left, then the right arm to ``points`` (6, 3).

    Metres in the optical frame.
    """
    rotation, hip, arm = np.empty((3, 3)), np.empty(3), _new_arm()
    _pose(state, Place(*place), View(*view), rotation, hip)
    for k in range(2):
        first = _first_angle(k)
        angles = state[first : first + ARM_ANGLES]
        _pose_arm(angles, _side_of(k), parts, girdle, arm.points, arm.directions)
        _turn_arm(arm, rotation, hip)
        for i in range(3):
            for j in range(3):
                points[3 * k + i, j] = arm.joints[i, j]


# ---------------------------------------------------------------------------------------------
# Outlines: corners of the patches in the optical frame


@_inline
def _frustum(part: Floats, p: int, vx: float, vy: float, shape: Floats) -> None:
    """Write patch ``p``: the outline of an elliptic frustum of the torso's frame.

    It is seen along the level direction (vx, vy). An ellipse with half axes a along Y and b along X
    shows the two points

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


@_inline
def _place_trunk(work: Workspace, drawn: Floats) -> None:
    """Write the corners of torso, waist, neck, head and the torso's top, patches 0 to 4."""
    rotation, hip, shape, corners = work.torso, work.hip, work.shape, work.corners
    # The direction of sight, level in the torso's frame, at half the height of the torso's top.
    middle = 0.5 * (drawn[TORSO, BOTTOM] + drawn[TORSO, HEIGHT])
    x = hip[0] + middle * rotation[0, 2]
    y = hip[1] + middle * rotation[1, 2]
    z = hip[2] + middle * rotation[2, 2]
    vx = rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z
    vy = rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z
    norm = sqrt(vx * vx + vy * vy) + 1e-9
    for p in range(_TRUNK_PARTS):
        _frustum(drawn[p], p, vx / norm, vy / norm, shape)
    # Who bows shows it.
    _lid(drawn[TORSO], _TRUNK_PARTS, shape)
    patches = shape.shape[1] // 4
    for j in range(3):
        for c in range(4):
            for e in range(c * patches, c * patches + TRUNK_PATCHES):
                turned = rotation[j, 0] * shape[0, e] + rotation[j, 1] * shape[1, e]
                corners[j, e] = hip[j] + turned + rotation[j, 2] * shape[2, e]


@_inline
def _place_limb(
    start: Floats,
    axis: Floats,
    end: Floats,
    length: float,
    half: float,
    cap: float,
    p: int,
    corners: Floats,
) -> None:
    """Write patches ``p``, a bar that faces the camera, and ``p`` + 1, a square around ``end``.

    The bar reaches ``length`` along ``axis`` from ``start`` and is 2 ``half`` wide; the square's
    side is 2 ``cap``; metres, all in the optical frame.
    """
    patches = corners.shape[1] // 4
    mx = start[0] + 0.5 * length * axis[0]
    my = start[1] + 0.5 * length * axis[1]
    mz = start[2] + 0.5 * length * axis[2]
    # Across limb and line of sight.
    sx = my * axis[2] - mz * axis[1]
    sy = mz * axis[0] - mx * axis[2]
    sz = mx * axis[1] - my * axis[0]
    norm = sqrt(sx * sx + sy * sy + sz * sz)
    far = sqrt(mx * mx + my * my + mz * mz) + 1e-12
    if norm < 1e-6 * far:
        # It points to the camera: any direction will do.
        sx, sy, sz, norm = 1.0, 0.0, 0.0, 1.0
    sx, sy, sz = sx / norm, sy / norm, sz / norm
    # Across that and the line of sight.
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


@_inline
def _place_arm(arm: Arm, p: int, drawn: Floats, corners: Floats) -> None:
    """Write the corners of an arm, patches ``p`` to ``p`` + 3, from its joints and axes."""
    half, thin = drawn[UPPER_ARM, TOP_WIDTH] / 2, drawn[FOREARM, TOP_WIDTH] / 2
    elbow_cap, hand_cap = _SQUARE_OF_DISC * (half + thin) / 2, _SQUARE_OF_DISC * thin
    start, elbow, hand = arm.joints[0], arm.joints[1], arm.joints[2]
    upper_m, fore_m = drawn[UPPER_ARM, HEIGHT], drawn[FOREARM, HEIGHT]
    _place_limb(start, arm.axes[0], elbow, upper_m, half, elbow_cap, p, corners)
    _place_limb(elbow, arm.axes[1], hand, fore_m, thin, hand_cap, p + _LIMB_PATCHES, corners)


# ---------------------------------------------------------------------------------------------
# Priors, in units of squared distances from rest


@_inline
def _saturating(square: float, cap: float) -> float:
    """``square`` where it is small, ``cap`` where it is large."""
    return cap * (1.0 - exp(-square / cap))


@_inline
def _torso_prior(state: Floats, anchor: Floats, rules: Floats) -> float:
    """Prior of a torso.

    ``anchor`` (4,) is x and z of the last frame and the home of x, metres, and the expected yaw.
    """
    cap = rules[ANGLE_CAP]
    pitch = state[PITCH] - rules[PITCH_REST]
    pitch /= rules[BACK_UNIT] if pitch < 0.0 else rules[FORWARD_UNIT]
    rated = _saturating((state[ROLL] / rules[ROLL_UNIT]) ** 2, cap)
    rated += _saturating(pitch**2, cap)
    rated += _saturating(((state[YAW] - anchor[3]) / rules[YAW_UNIT]) ** 2, cap)
    rated += _saturating(((state[TORSO_X] - anchor[0]) / rules[X_STEP]) ** 2, rules[STEP_CAP])
    rated += _saturating(((state[TORSO_Z] - anchor[1]) / rules[Z_STEP]) ** 2, rules[STEP_CAP])
    rated += _saturating(((state[TORSO_X] - anchor[2]) / rules[X_HOME]) ** 2, rules[HOME_CAP])
    rated += _saturating((state[TORSO_Z] / rules[Z_HOME]) ** 2, rules[HOME_CAP])
    prior: float = rules[WEIGHT] * rated
    return prior


@_inline
def _depth_inside(x: float, y: float, z: float, parts: Floats, margin: float) -> float:
    """How deep a point of the torso's frame lies in trunk or head: 0, outside, to 1, on the axis.

    The trunk is an elliptic frustum, the head an ellipsoid, both wider by ``margin``, metres.
    """
    waist_top = parts[TORSO, BOTTOM]
    top = waist_top + parts[TORSO, HEIGHT]
    deep = 0.0
    if _HIPS_END_M < z < top:
        if z < waist_top:
            wide, thick = parts[WAIST, TOP_WIDTH] / 2, parts[WAIST, DEPTH] / 2
        else:
            along = (z - waist_top) / parts[TORSO, HEIGHT]
            below, above = parts[TORSO, BOTTOM_WIDTH], parts[TORSO, TOP_WIDTH]
            wide, thick = (below + (above - below) * along) / 2, parts[TORSO, DEPTH] / 2
        a, b = x / (thick + margin), y / (wide + margin)
        deep = max(1.0 - sqrt(a * a + b * b), 0.0)
    a = (x - parts[HEAD, FORWARD]) / (parts[HEAD, DEPTH] / 2 + margin)
    b = y / (parts[HEAD, TOP_WIDTH] / 2 + margin)
    half = parts[HEAD, HEIGHT] / 2
    c = (z - parts[HEAD, BOTTOM] - half) / (half + margin)
    return max(deep, 1.0 - sqrt(a * a + b * b + c * c))


@_compile
def penetration(points: Floats, parts: Floats) -> float:
    """Sum of how deep hand, middle of the forearm and elbow (3, 3) lie inside trunk or head."""
    margin = parts[FOREARM, TOP_WIDTH] / 2
    elbow, hand = points[1], points[2]
    deep = _depth_inside(hand[0], hand[1], hand[2], parts, margin)
    x, y, z = (elbow[0] + hand[0]) / 2, (elbow[1] + hand[1]) / 2, (elbow[2] + hand[2]) / 2
    deep += _depth_inside(x, y, z, parts, margin)
    deep += _depth_inside(elbow[0], elbow[1], elbow[2], parts, 0.0)
    return deep


@_inline
def _arm_prior(arm: Arm, side: float, parts: Floats, rules: Floats, gmm: Floats) -> float:
    """Prior of a posed arm: the learned one, nats, and what it costs to be inside the body."""
    for c in range(6):
        arm.outward[c] = arm.directions[c] * (side if c == 1 or c == 4 else 1.0)
    rated = nats_of(arm.outward, gmm, rules[UNKNOWN_DENSITY], arm.away)
    rated += rules[PENETRATION] * penetration(arm.points, parts)
    prior: float = rules[WEIGHT] * rated
    return prior


@_compile
def priors(
    state: Floats, anchor: Floats, parts: Floats, girdle: Floats, rules: Floats, gmm: Floats
) -> tuple[float, float, float]:
    """Return the priors of torso, left and right arm of one state, and see what they say."""
    found = np.zeros(2)
    arm = _new_arm()
    for k in range(2):
        first, side = _first_angle(k), _side_of(k)
        angles = state[first : first + ARM_ANGLES]
        _pose_arm(angles, side, parts, girdle, arm.points, arm.directions)
        found[k] = _arm_prior(arm, side, parts, rules, gmm)
    return _torso_prior(state, anchor, rules), found[0], found[1]


# ---------------------------------------------------------------------------------------------
# Ratings


@_compile
def rate_trunks(
    states: Floats,
    drawn: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    row_sums: RowSums,
    base_px: int,
    scale: float,
    anchor: Floats,
    rules: Floats,
    ratings: Floats,
) -> None:
    """Write ratings (N,) of the trunks of states (N, 14), with the cost of drawing nothing.

    ``scale`` is 1 / (pixels of the silhouette).
    """
    rows, width = row_sums.shape[0], row_sums.shape[1] - 1
    work = _workspace(TRUNK_PATCHES, rows)
    for i in range(states.shape[0]):
        _pose(states[i], Place(*place), View(*view), work.torso, work.hip)
        _place_trunk(work, drawn)
        _draw(work, View(*view), rows, width)
        gain = _sum_union(work, TRUNK_PATCHES, row_sums)[0]
        ratings[i] = (base_px + gain) * scale + _torso_prior(states[i], anchor, rules)


@_compile
def rate_arms(
    arms: Floats,
    side: float,
    torso: Floats,
    parts: Floats,
    drawn: Floats,
    girdle: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    covered: RowSums,
    base_px: int,
    scale: float,
    rules: Floats,
    gmm: Floats,
    ratings: Floats,
) -> None:
    """Write ratings (N,) of one arm (N, 4) beside the trunk of the state ``torso`` (14,).

    ``covered`` and ``base_px`` are the row sums and the cost with that trunk drawn.
    """
    rows, width = covered.shape[0], covered.shape[1] - 1
    work, arm = _workspace(ARM_PATCHES, rows), _new_arm()
    _pose(torso, Place(*place), View(*view), work.torso, work.hip)
    for i in range(arms.shape[0]):
        _pose_arm(arms[i], side, parts, girdle, arm.points, arm.directions)
        _turn_arm(arm, work.torso, work.hip)
        _place_arm(arm, 0, drawn, work.corners)
        _draw(work, View(*view), rows, width)
        gain = _sum_union(work, ARM_PATCHES, covered)[0]
        ratings[i] = (base_px + gain) * scale + _arm_prior(arm, side, parts, rules, gmm)


@_compile
def rate_bodies(
    states: Floats,
    parts: Floats,
    drawn: Floats,
    girdle: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    row_sums: RowSums,
    silhouette_px: int,
    scale: float,
    anchor: Floats,
    rules: Floats,
    gmm: Floats,
    ratings: Floats,
    costs_px: Floats,
    areas_px: Floats,
) -> None:
    """Write ratings, costs in pixels and drawn areas, each (N,), of states (N, 14)."""
    rows, width = row_sums.shape[0], row_sums.shape[1] - 1
    work, arm = _workspace(BODY_PATCHES, rows), _new_arm()
    for i in range(states.shape[0]):
        _pose(states[i], Place(*place), View(*view), work.torso, work.hip)
        _place_trunk(work, drawn)
        prior = _torso_prior(states[i], anchor, rules)
        for k in range(2):
            first, side = _first_angle(k), _side_of(k)
            angles = states[i, first : first + ARM_ANGLES]
            _pose_arm(angles, side, parts, girdle, arm.points, arm.directions)
            _turn_arm(arm, work.torso, work.hip)
            _place_arm(arm, TRUNK_PATCHES + ARM_PATCHES * k, drawn, work.corners)
            prior += _arm_prior(arm, side, parts, rules, gmm)
        _draw(work, View(*view), rows, width)
        gain, area = _sum_union(work, BODY_PATCHES, row_sums)
        costs_px[i] = silhouette_px + gain
        areas_px[i] = area
        ratings[i] = costs_px[i] * scale + prior


@_compile
def cover(
    state: Floats,
    has_trunk: bool,
    has_left: bool,
    has_right: bool,
    parts: Floats,
    drawn: Floats,
    girdle: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    row_sums: RowSums,
    covered: RowSums,
) -> int:
    """Write the row sums beside some parts of a state to ``covered``; return the gain they lack."""
    rows, width = row_sums.shape[0], row_sums.shape[1] - 1
    patches = TRUNK_PATCHES * has_trunk + ARM_PATCHES * (int(has_left) + int(has_right))
    work, arm = _workspace(patches, rows), _new_arm()
    _pose(state, Place(*place), View(*view), work.torso, work.hip)
    p = 0
    if has_trunk:
        _place_trunk(work, drawn)
        p = TRUNK_PATCHES
    for k in range(2):
        if (k == 0 and has_left) or (k == 1 and has_right):
            first = _first_angle(k)
            angles = state[first : first + ARM_ANGLES]
            _pose_arm(angles, _side_of(k), parts, girdle, arm.points, arm.directions)
            _turn_arm(arm, work.torso, work.hip)
            _place_arm(arm, p, drawn, work.corners)
            p += ARM_PATCHES
    _draw(work, View(*view), rows, width)
    _cover(work.sides, work.extent, row_sums, covered)
    return int(_sum_union(work, patches, row_sums)[0])


@_inline
def new_figure() -> tuple[Workspace, Arm]:
    """Return what :func:`place_patches` needs."""
    return _workspace(BODY_PATCHES, 1), _new_arm()


@_inline
def place_patches(
    state: Floats,
    has_trunk: bool,
    has_arm: tuple[bool, bool],
    parts: Floats,
    drawn: Floats,
    girdle: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    work: Workspace,
    arm: Arm,
) -> None:
    """Write the corners of trunk, left and right arm, or some of these, into ``work``."""
    _pose(state, Place(*place), View(*view), work.torso, work.hip)
    if has_trunk:
        _place_trunk(work, drawn)
    for k in range(2):
        if has_arm[k]:
            first = _first_angle(k)
            angles = state[first : first + ARM_ANGLES]
            _pose_arm(angles, _side_of(k), parts, girdle, arm.points, arm.directions)
            _turn_arm(arm, work.torso, work.hip)
            _place_arm(arm, TRUNK_PATCHES + ARM_PATCHES * k, drawn, work.corners)


@_compile
def corners_of_body(
    state: Floats,
    parts: Floats,
    drawn: Floats,
    girdle: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    corners_m: Floats,
) -> None:
    """Write the patches of a state to ``corners_m`` (13, 4, 3), metres in the optical frame."""
    work, arm = new_figure()
    place_patches(state, True, (True, True), parts, drawn, girdle, place, view, work, arm)
    for p in range(BODY_PATCHES):
        for c in range(4):
            for j in range(3):
                corners_m[p, c, j] = work.corners[j, c * BODY_PATCHES + p]


@_compile
def leave_out(row_sums: RowSums, first_row: int, start: int, end: int) -> int:
    """Make the columns ``start`` to ``end`` of the rows from ``first_row`` on count as nothing.

    Where somebody's legs are. Returns the foreground pixels there.
    """
    taken = 0
    for v in range(first_row, row_sums.shape[0]):
        level = int(row_sums[v, start])
        gain = int(row_sums[v, end]) - level
        taken += ((end - start) - gain) // 2
        for u in range(start + 1, end):
            row_sums[v, u] = level
        for u in range(end, row_sums.shape[1]):
            row_sums[v, u] -= gain
    return taken


@_compile
def median_column(row_sums: RowSums) -> float:
    """Column that halves the foreground, from every 8th row and every 4th column, pixels."""
    rows, width = row_sums.shape[0], row_sums.shape[1] - 1
    counts = np.zeros(width // 4 + 1, np.int64)
    total = 0
    for v in range(0, rows, 8):
        for u in range(0, width - 3, 4):
            if row_sums[v, u + 4] < row_sums[v, u]:
                counts[u // 4] += 1
                total += 1
    seen = 0
    for i in range(counts.shape[0]):
        seen += counts[i]
        if 2 * seen >= total:
            return 4.0 * i + 2.0
    middle: float = width / 2.0
    return middle
