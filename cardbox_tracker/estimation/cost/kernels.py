"""The compiled inner loop: kinematics, projection, rasterisation and XOR count in one pass.

With h = 1 where the model is drawn and f = 1 where the silhouette is, (h XOR f) = f + h (1 - 2 f),
so that equation (2) is

    W = sum of f + sum over the pixels covered by the model of (1 - 2 f)

The first sum is a constant of the image. The second is taken from the row sums S of
:mod:`cardbox_tracker.estimation.cost.row_sums`: one covered run a <= u < b of row v gives
S(v, b) - S(v, a). So a particle costs the rows of its outline, never its area. For the arms the row
sums stay level where the trunk covers the image already, and an arm particle draws its own 4
patches, not 11.

The sections below are the steps of a particle: *kinematics* places the corners of its patches,
*rasterisation* finds the two columns where each row enters and leaves each patch, *union* sums
(1 - 2 f) over the pixels under any of them; *costs* are the functions to call. The pixel rule is
that of :mod:`cardbox_tracker.vision.rasterisation`; the results are equal. All steps are short
loops over patches or rows, without branches and, where rows are counted, with 32-bit whole numbers
only, for which there are vector instructions. What the near plane cuts, or rounding dents, takes a
slower way to the same result. Matrix products are written out: through BLAS they would cost more
than all the rest.

Corners and edges of K patches are flat arrays: entry c K + p is corner c of patch p, in order
around it, or the edge from that corner to the next.

All this is in one file, with its types, because the cache of compiled code on disk only asks the
file of the function that is called whether it has changed: were a helper in another file, its old
version would live on inside the cached callers. The same holds for the constants imported from
``vision/rasterisation.py``: who changes them has to change this file, too, or to delete the cache.
"""

from __future__ import annotations

from math import cos, sin
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.compiling import njit
from cardbox_tracker.estimation.cost.row_sums import RowSums
from cardbox_tracker.vision.rasterisation import (
    CROSSING_BITS,
    FARTHEST_PX,
    NEAR_PLANE_M,
    SUBPIXELS,
)

Floats = NDArray[np.float64]
Whole = NDArray[np.int32]
Counts = NDArray[np.int64]

TRUNK_PATCHES = 8
"""7 of the paper and one for a neck, which draws nothing without a width: loops of fours."""
ARM_PATCHES = 4
_BODY_PATCHES = TRUNK_PATCHES + 2 * ARM_PATCHES
# Rows and columns of ``parts`` (6, 6), ordered as ``BodyParts`` and ``Part`` of body/parts.py. It
# comes with ``shoulder`` (2,): the joint, aside and upwards, in the torso's frame, metres.
_TORSO, _WAIST, _NECK, _HEAD, _UPPER_ARM, _FOREARM = 0, 1, 2, 3, 4, 5
_BOTTOM, _HEIGHT, _BOTTOM_WIDTH, _TOP_WIDTH, _DEPTH, _FORWARD = 0, 1, 2, 3, 4, 5
# A posture is d1..d4 of the torso, then 4 angles of the left arm, then 4 of the right.
_TORSO_ANGLES = 4
_ARM_ANGLES = 4

_ONE = float(2**CROSSING_BITS)
_BITS = np.int32(CROSSING_BITS)
_ROUND_UP = 2**CROSSING_BITS - 1
# Steeper than this an edge meets one row at most, and its step is not used.
_STEEPEST = 32000.0

# An index of this type is never negative, so no code is made to count from an array's end.
_index = np.uint64
_Index = int | np.integer[Any]
# Rows of the array of edges.
_FIRST_ROW, _END_ROW, _CROSSING, _STEP = 0, 1, 2, 3

_compile = njit(cache=True, nogil=True, error_model="numpy")
_inline = njit(cache=True, nogil=True, error_model="numpy", forceinline=True)


# From Python, camera and place come as plain tuples, which cross over several times faster.
ViewTuple = tuple[float, float, float, float, float, float]
PlaceTuple = tuple[float, float]


class View(NamedTuple):
    """A camera: focal lengths and principal point, px, and how far it looks down."""

    fx: float
    fy: float
    cx: float
    cy: float
    cos_pitch: float
    sin_pitch: float


class Place(NamedTuple):
    """Where the middle of the hips is in the reference frame, but for d1: (-distance, d1, height).

    Metres.
    """

    distance_m: float
    hip_height_m: float


class Workspace(NamedTuple):
    """Scratch of one call for K patches and so many rows.

    Functions that are inlined take all of it; the others take the arrays they need, for handing
    over all of them makes a call dear.
    """

    shape: Floats
    """(3, 4 K): corners in the frame of the part, metres."""
    corners: Floats
    """(3, 4 K): the same in the optical frame."""
    pixels: Floats
    """(2, 5 K): the same projected and snapped; the first corner again as the fifth."""
    edges: Whole
    """(4, 4 K): first and end row, crossing of the first row and step from row to row, 2^-16 px."""
    sides: Whole
    """(K, 2, rows): the two columns where a row crosses the outline of a patch, in any order."""
    extent: Counts
    """(K, 2): first and end row of a patch."""
    starts: Whole
    ends: Whole
    """(K,): runs of one row, to be joined."""
    active: Counts
    """(K,): patches that a row meets."""
    joined: Whole
    """(2, rows): runs of two patches as one."""
    outline: Floats
    """(2, 6): pixels of a patch that the near plane cuts. A plane patch that is cut has 5 corners,
    but one that lies in the near plane may seem to cross it at all edges, by rounding."""
    torso: Floats
    upper_arm: Floats
    forearm: Floats
    """(3, 3): rotations from the parts' frames to the optical frame."""
    hip: Floats
    joint: Floats
    """(3,): middle of the hips, and shoulder or elbow, in the optical frame, metres."""


@_inline
def _workspace(patches: int, rows: int) -> Workspace:
    return Workspace(
        shape=np.zeros((3, 4 * patches)),
        corners=np.zeros((3, 4 * patches)),
        pixels=np.empty((2, 5 * patches)),
        edges=np.empty((4, 4 * patches), np.int32),
        sides=np.empty((patches, 2, rows), np.int32),
        extent=np.empty((patches, 2), np.int64),
        starts=np.empty(patches, np.int32),
        ends=np.empty(patches, np.int32),
        active=np.empty(patches, np.int64),
        joined=np.empty((2, rows), np.int32),
        outline=np.empty((2, 6)),
        torso=np.empty((3, 3)),
        upper_arm=np.empty((3, 3)),
        forearm=np.empty((3, 3)),
        hip=np.empty(3),
        joint=np.empty(3),
    )


# ---------------------------------------------------------------------------------------------
# Kinematics: corners of all patches in the optical frame


@_inline
def _torso_pose(torso: Floats, place: Place, view: View, rotation: Floats, hip: Floats) -> None:
    """Write rotation (3, 3) and mid-hip (3,) of the torso in the optical frame for d1..d4.

    Its rotation in the reference frame is Rz(yaw) Ry(pitch) Rx(roll), with c and s for cos and sin:

        cw cp    cw sp sr - sw cr    cw sp cr + sw sr
        sw cp    sw sp sr + cw cr    sw sp cr - cw sr
        -sp      cp sr               cp cr

    and a camera that looks down by v has the axes

        x = Y,    y = -cos v Z + sin v X,    z = -sin v Z - cos v X
    """
    y_m, roll, pitch, yaw = torso[0], torso[1], torso[2], torso[3]
    cr, sr = cos(roll), sin(roll)
    cp, sp = cos(pitch), sin(pitch)
    cw, sw = cos(yaw), sin(yaw)
    cv, sv = view.cos_pitch, view.sin_pitch
    for j in range(3):
        if j == 0:
            x, y, z = cw * cp, sw * cp, -sp
        elif j == 1:
            x, y, z = cw * sp * sr - sw * cr, sw * sp * sr + cw * cr, cp * sr
        else:
            x, y, z = cw * sp * cr + sw * sr, sw * sp * cr - cw * sr, cp * cr
        rotation[0, j] = y
        rotation[1, j] = -cv * z + sv * x
        rotation[2, j] = -sv * z - cv * x
    hip[0] = y_m
    hip[1] = -cv * place.hip_height_m - sv * place.distance_m
    hip[2] = -sv * place.hip_height_m + cv * place.distance_m


@_inline
def _turn_limb(parent: Floats, abduction: float, flexion: float, rotation: Floats) -> None:
    """Write parent Rx(abduction) Ry(-flexion), each (3, 3).

    With a and f for the angles, the columns of the parent (px, py, pz) become

        cos f px + sin f z,    y,    cos f z - sin f px

    where y = cos a py + sin a pz and z = cos a pz - sin a py.
    """
    ca, sa = cos(abduction), sin(abduction)
    cf, sf = cos(flexion), sin(flexion)
    for j in range(3):
        px, py, pz = parent[j, 0], parent[j, 1], parent[j, 2]
        y = ca * py + sa * pz
        z = ca * pz - sa * py
        rotation[j, 0] = cf * px + sf * z
        rotation[j, 1] = y
        rotation[j, 2] = cf * z - sf * px


@_inline
def _joint(axis: int, side: float, shoulder: Floats, torso: Floats, hip: Floats) -> float:
    """Coordinate of a shoulder joint: hip + torso (0, side aside, height)."""
    joint: float = hip[axis] + side * shoulder[0] * torso[axis, 1] + shoulder[1] * torso[axis, 2]
    return joint


@_inline
def _upright(part: Floats, is_frontal: bool, p: int, shape: Floats) -> None:
    """Write patch ``p``: a part's frontal trapezoid, in the plane of Y and Z, or its sagittal one.

    Corners: left and right below, then right and left above.
    """
    patches = shape.shape[1] // 4
    half_below = (part[_BOTTOM_WIDTH] if is_frontal else part[_DEPTH]) / 2
    half_above = (part[_TOP_WIDTH] if is_frontal else part[_DEPTH]) / 2
    for c in range(4):
        e = c * patches + p
        half = half_below if c < 2 else half_above
        aside = half if c == 1 or c == 2 else -half
        shape[0, e] = part[_FORWARD] + (0.0 if is_frontal else aside)
        shape[1, e] = aside if is_frontal else 0.0
        shape[2, e] = part[_BOTTOM] if c < 2 else part[_BOTTOM] + part[_HEIGHT]


@_inline
def _lid(part: Floats, p: int, shape: Floats) -> None:
    """Write patch ``p``: the horizontal rectangle at a part's top."""
    patches = shape.shape[1] // 4
    x, y = part[_DEPTH] / 2, part[_TOP_WIDTH] / 2
    for c in range(4):
        e = c * patches + p
        shape[0, e] = x if c == 1 or c == 2 else -x
        shape[1, e] = y if c >= 2 else -y
        shape[2, e] = part[_BOTTOM] + part[_HEIGHT]


@_inline
def _shape_trunk(parts: Floats, shape: Floats) -> None:
    """Write patches 0 to 7, in the torso's frame; see ``body/cardbox.py``."""
    _upright(parts[_TORSO], True, 0, shape)
    _upright(parts[_TORSO], False, 1, shape)
    _lid(parts[_TORSO], 2, shape)
    _upright(parts[_WAIST], True, 3, shape)
    _upright(parts[_WAIST], False, 4, shape)
    _upright(parts[_HEAD], True, 5, shape)
    _upright(parts[_HEAD], False, 6, shape)
    if parts[_NECK, _TOP_WIDTH] > 0.0:
        _upright(parts[_NECK], True, 7, shape)
    # Else all its corners stay at the hips, and no row has to ask for it.


@_inline
def _shape_arm(parts: Floats, first: int, shape: Floats) -> None:
    """Write the patches of an upper arm and a forearm, ``first`` on, in their own frames."""
    _upright(parts[_UPPER_ARM], True, first, shape)
    _upright(parts[_UPPER_ARM], False, first + 1, shape)
    _upright(parts[_FOREARM], True, first + 2, shape)
    _upright(parts[_FOREARM], False, first + 3, shape)


@_inline
def _shape_body(parts: Floats, shape: Floats) -> None:
    """Write the patches of the trunk, the left and the right arm."""
    _shape_trunk(parts, shape)
    for arm in range(2):
        _shape_arm(parts, TRUNK_PATCHES + ARM_PATCHES * arm, shape)


@_inline
def _place(
    shape: Floats, first: int, end: int, rotation: Floats, origin: Floats, corners: Floats
) -> None:
    """Turn and move the patches ``first`` to ``end`` from their part's frame to the optical one."""
    patches = shape.shape[1] // 4
    for j in range(3):
        a, b, c, o = rotation[j, 0], rotation[j, 1], rotation[j, 2], origin[j]
        for corner in range(4):
            at = corner * patches
            for e in range(at + first, at + end):
                x, y, z = shape[0, _index(e)], shape[1, _index(e)], shape[2, _index(e)]
                corners[j, _index(e)] = o + a * x + b * y + c * z


@_inline
def _place_trunk(work: Workspace) -> None:
    """Corners of torso, waist, head and neck, the first patches, in the torso's pose."""
    _place(work.shape, 0, TRUNK_PATCHES, work.torso, work.hip, work.corners)


@_inline
def _place_arm(
    work: Workspace, first: int, angles: Floats, side: float, parts: Floats, shoulder: Floats
) -> None:
    """Corners of an arm at the torso's pose; ``side`` is 1 for left, -1 for right.

    Its patches are ``first`` on, its angles (4,) abduction and flexion of shoulder and elbow.
    """
    elbow, end = first + ARM_PATCHES // 2, first + ARM_PATCHES
    for j in range(3):
        work.joint[j] = _joint(j, side, shoulder, work.torso, work.hip)
    _turn_limb(work.torso, side * angles[0], angles[1], work.upper_arm)
    _place(work.shape, first, elbow, work.upper_arm, work.joint, work.corners)
    for j in range(3):
        work.joint[j] -= parts[_UPPER_ARM, _HEIGHT] * work.upper_arm[j, 2]
    _turn_limb(work.upper_arm, side * angles[2], angles[3], work.forearm)
    _place(work.shape, elbow, end, work.forearm, work.joint, work.corners)


@_inline
def _angles_of_arm(posture: Floats, arm: int) -> Floats:
    """Angles (4,) of the left arm, 0, or the right, 1."""
    first = _TORSO_ANGLES + _ARM_ANGLES * arm
    return posture[first : first + _ARM_ANGLES]


@_inline
def _side(arm: int) -> float:
    """1 for the left arm, 0, and -1 for the right, 1: abduction is mirrored, flexion is not."""
    return 1.0 - 2.0 * arm


@_inline
def _place_body(
    work: Workspace, posture: Floats, parts: Floats, shoulder: Floats, place: Place, view: View
) -> None:
    """Corners of all 16 patches for d1..d12."""
    _torso_pose(posture, place, view, work.torso, work.hip)
    _place_trunk(work)
    for arm in range(2):
        first = TRUNK_PATCHES + ARM_PATCHES * arm
        _place_arm(work, first, _angles_of_arm(posture, arm), _side(arm), parts, shoulder)


# ---------------------------------------------------------------------------------------------
# Rasterisation: the two columns where each row crosses the outline of each patch


@_inline
def _snap(pixel: float) -> float:
    """Nearest point of the 1/256 px grid, within 16000 px."""
    near = min(max(pixel, -FARTHEST_PX), FARTHEST_PX)
    snapped: float = np.floor(near * SUBPIXELS + 0.5) / SUBPIXELS
    return snapped


@_inline
def _row(y: float, rows: float) -> float:
    """First row at or below ``y``, within the image."""
    row: float = np.ceil(min(max(y, 0.0), rows))
    return row


@_inline
def _draw(work: Workspace, view: View, rows: int, width: int) -> None:
    """Write sides and extent of all patches, whose corners are there.

    An edge from its upper end (x0, y0) to its lower end (x1, y1) has the slope
    s = (x1 - x0) / (y1 - y0), first meets row v0 = ceil(y0), crosses it at x0 + (v0 - y0) s and
    moves by s from row to row.
    """
    corners, pixels, edges, extent = work.corners, work.pixels, work.edges, work.extent
    fx, fy, cx, cy = view.fx, view.fy, view.cx, view.cy
    patches = extent.shape[0]
    behind = 0
    for e in range(4 * patches):
        z = corners[2, _index(e)]
        behind += z < NEAR_PLANE_M
        nearness = 1.0 / z
        pixels[0, _index(e)] = _snap(fx * corners[0, _index(e)] * nearness + cx)
        pixels[1, _index(e)] = _snap(fy * corners[1, _index(e)] * nearness + cy)
    if behind > 0:
        for p in range(patches):
            _draw_cut(work, p, view, rows, width)
        return
    limit = float(rows)
    for p in range(patches):
        pixels[0, _index(4 * patches + p)] = pixels[0, _index(p)]
        pixels[1, _index(4 * patches + p)] = pixels[1, _index(p)]
    for e in range(4 * patches):
        x0, x1 = pixels[0, _index(e)], pixels[0, _index(e + patches)]
        y0, y1 = pixels[1, _index(e)], pixels[1, _index(e + patches)]
        slope = (x1 - x0) / (1.0 if y0 == y1 else y1 - y0)
        upper_x = x0 if y0 < y1 else x1
        upper_y = min(y0, y1)
        row = _row(upper_y, limit)
        # A level edge meets no row; its crossing has only to be some number.
        crossing = upper_x + (0.0 if y0 == y1 else (row - upper_y) * slope)
        step = min(max(slope, -_STEEPEST), _STEEPEST)
        edges[_FIRST_ROW, _index(e)] = np.int32(row)
        edges[_END_ROW, _index(e)] = np.int32(_row(max(y0, y1), limit))
        edges[_CROSSING, _index(e)] = np.int32(np.floor(crossing * _ONE + 0.5))
        edges[_STEP, _index(e)] = np.int32(np.floor(step * _ONE + 0.5))
    for p in range(patches):
        # Edges that go down write one side of their rows and those that go up the other: each row
        # is met once by either, unless rounding dented a sliver.
        y0, y1 = pixels[1, _index(p)], pixels[1, _index(p + patches)]
        y2, y3 = pixels[1, _index(p + 2 * patches)], pixels[1, _index(p + 3 * patches)]
        a, b, c, d = y1 > y0, y2 > y1, y3 > y2, y0 > y3
        if (a != b) + (b != c) + (c != d) + (d != a) > 2:
            _draw_cut(work, p, view, rows, width)
            continue
        extent[p, 0] = np.int64(_row(min(min(y0, y1), min(y2, y3)), limit))
        extent[p, 1] = np.int64(_row(max(max(y0, y1), max(y2, y3)), limit))
        _cross(edges, p, p, _index(a), work.sides, width)
        _cross(edges, p + patches, p, _index(b), work.sides, width)
        _cross(edges, p + 2 * patches, p, _index(c), work.sides, width)
        _cross(edges, p + 3 * patches, p, _index(d), work.sides, width)


@_inline
def _cross(edges: Whole, e: int, p: int, side: _Index, sides: Whole, width: int) -> None:
    """Write the columns where edge ``e`` crosses its rows as one side of patch ``p``."""
    first = np.int64(edges[_FIRST_ROW, _index(e)])
    x, step, limit = edges[_CROSSING, _index(e)], edges[_STEP, _index(e)], np.int32(width)
    base, k = _index(first), _index(p)
    for i in range(np.int64(edges[_END_ROW, _index(e)]) - first):
        u = np.int32(np.int32(x + np.int32(i) * step + np.int32(_ROUND_UP)) >> _BITS)
        sides[k, side, base + _index(i)] = min(max(u, np.int32(0)), limit)


@_compile
def _draw_cut(work: Workspace, p: int, view: View, rows: int, width: int) -> None:
    """Write sides and extent of patch ``p``, cut at the near plane, as the definition says.

    That is :func:`cardbox_tracker.vision.rasterisation.clip_near` and ``fill_convex``.
    """
    corners, sides, extent, outline = work.corners, work.sides, work.extent, work.outline
    fx, fy, cx, cy = view.fx, view.fy, view.cx, view.cy
    patches = extent.shape[0]
    n = 0
    for corner in range(4):
        c, d = corner * patches + p, (corner + 1) % 4 * patches + p
        z0, z1 = corners[2, c], corners[2, d]
        if z0 >= NEAR_PLANE_M:
            nearness = 1.0 / z0
            outline[0, n] = _snap(fx * corners[0, c] * nearness + cx)
            outline[1, n] = _snap(fy * corners[1, c] * nearness + cy)
            n += 1
        if (z0 >= NEAR_PLANE_M) != (z1 >= NEAR_PLANE_M):
            t = (NEAR_PLANE_M - z0) / (z1 - z0)
            x = corners[0, c] + t * (corners[0, d] - corners[0, c])
            y = corners[1, c] + t * (corners[1, d] - corners[1, c])
            outline[0, n] = _snap(fx * x / NEAR_PLANE_M + cx)
            outline[1, n] = _snap(fy * y / NEAR_PLANE_M + cy)
            n += 1
    extent[p, 0] = extent[p, 1] = 0
    if n < 3:
        return
    ys = outline[1, :n]
    top, bottom = int(_row(ys.min(), rows)), int(_row(ys.max(), rows))
    extent[p, 0] = top
    extent[p, 1] = bottom
    for v in range(top, bottom):
        sides[p, 0, v] = width
        sides[p, 1, v] = 0
    for i in range(n):
        j = (i + 1) % n
        if ys[i] > ys[j]:
            i, j = j, i
        x0, y0, x1, y1 = outline[0, i], ys[i], outline[0, j], ys[j]
        low, high = int(_row(y0, rows)), int(_row(y1, rows))
        if low < high:
            slope = (x1 - x0) / (y1 - y0)
            x = int(np.floor((x0 + (low - y0) * slope) * _ONE + 0.5)) + _ROUND_UP
            step = int(np.floor(slope * _ONE + 0.5))
            for v in range(low, high):
                u = min(max((x + (v - low) * step) >> CROSSING_BITS, 0), width)
                sides[p, 0, v] = min(sides[p, 0, v], u)
                sides[p, 1, v] = max(sides[p, 1, v], u)


# ---------------------------------------------------------------------------------------------
# Union: the sum of (1 - 2 f) over the pixels under any patch


@_inline
def _insert(starts: Whole, ends: Whole, n: int, start: np.int32, end: np.int32) -> None:
    """Insert a run into the first ``n`` runs, which are ordered by start."""
    i = n
    while i > 0 and starts[i - 1] > start:
        starts[i] = starts[i - 1]
        ends[i] = ends[i - 1]
        i -= 1
    starts[i] = start
    ends[i] = end


@_inline
def _run(sides: Whole, p: _Index, row: _Index) -> tuple[np.int32, np.int32]:
    """First and end column of a patch in a row."""
    a, b = sides[p, 0, row], sides[p, 1, row]
    return min(a, b), max(a, b)


@_inline
def _gain(row_sums: RowSums, row: _Index, start: _Index, end: _Index) -> np.int64:
    """Sum of (1 - 2 f) over a run of a row: S(row, end) - S(row, start)."""
    return np.int64(row_sums[row, _index(end)]) - np.int64(row_sums[row, _index(start)])


@_compile
def _join(
    sides: Whole, one: np.uint64, other: np.uint64, first: np.uint64, count: int, joined: Whole
) -> np.int32:
    """Write the runs of two patches as one to ``joined``; above 0 if they are apart somewhere."""
    gap = np.int32(0)
    for i in range(count):
        row = first + _index(i)
        begin, stop = _run(sides, one, row)
        start, end = _run(sides, other, row)
        gap = max(gap, np.int32(max(begin, start) - min(stop, end)))
        joined[0, _index(i)] = min(begin, start)
        joined[1, _index(i)] = max(stop, end)
    return gap


@_inline
def _packed(sides: Whole, p: _Index, row: _Index) -> np.uint64:
    """A run as one number that orders runs by their start."""
    start, end = _run(sides, p, row)
    return (_index(start) << _index(32)) | _index(end)


@_compile
def _sum_four(
    sides: Whole,
    a: np.uint64,
    b: np.uint64,
    c: np.uint64,
    d: np.uint64,
    v: int,
    end_row: int,
    row_sums: RowSums,
) -> tuple[np.int64, np.int64]:
    """Sum (1 - 2 f) over the union of four patches in rows that all of them meet; also its area."""
    total = np.int64(0)
    area = np.int64(0)
    half, ends = _index(32), _index(0xFFFFFFFF)
    for row in range(_index(v), _index(end_row)):
        k, m = _packed(sides, a, row), _packed(sides, b, row)
        n, o = _packed(sides, c, row), _packed(sides, d, row)
        # A sorting network, for the order is hard to predict.
        k, m = min(k, m), max(k, m)
        n, o = min(n, o), max(n, o)
        k, n = min(k, n), max(k, n)
        m, o = min(m, o), max(m, o)
        m, n = min(m, n), max(m, n)
        stop = k & ends
        total += _gain(row_sums, row, k >> half, stop)
        area += np.int64(stop) - np.int64(k >> half)
        for run in (m, n, o):
            begin = max(run >> half, stop)
            stop = max(run & ends, stop)
            total += _gain(row_sums, row, begin, stop)
            area += np.int64(stop) - np.int64(begin)
    return total, area


@_compile
def _sum_many(
    sides: Whole,
    active: Counts,
    n: int,
    v: int,
    end_row: int,
    row_sums: RowSums,
    starts: Whole,
    ends: Whole,
) -> tuple[np.int64, np.int64]:
    """Sum (1 - 2 f) over the union of ``n`` patches in rows that all of them meet; also its area.

    The patches of one part come one after the other and overlap, so most rows need no more than
    joining each to the one before; what does not join is kept, in order, for a sweep.
    """
    total = np.int64(0)
    area = np.int64(0)
    for row in range(_index(v), _index(end_row)):
        kept = 0
        begin = stop = np.int32(0)
        for j in range(n):
            start, end = _run(sides, _index(active[_index(j)]), row)
            if start < end:
                if start <= stop and begin <= end and begin < stop:
                    begin = min(begin, start)
                    stop = max(stop, end)
                else:
                    if begin < stop:
                        _insert(starts, ends, kept, begin, stop)
                        kept += 1
                    begin, stop = start, end
        if kept > 0:
            _insert(starts, ends, kept, begin, stop)
            begin, stop = starts[0], ends[0]
            for i in range(1, kept + 1):
                if starts[i] <= stop:
                    stop = max(stop, ends[i])
                else:
                    total += _gain(row_sums, row, begin, stop)
                    area += np.int64(stop) - np.int64(begin)
                    begin, stop = starts[i], ends[i]
        total += _gain(row_sums, row, begin, stop)
        area += np.int64(stop) - np.int64(begin)
    return total, area


@_inline
def _sum_union(work: Workspace, count: int, row_sums: RowSums) -> tuple[np.int64, np.int64]:
    """Sum (1 - 2 f) over the union of the first ``count`` patches; also its area in pixels.

    The rows fall into bands within which the same patches are met, so that a row does not ask each
    patch whether it reaches there.
    """
    sides, extent, active, joined = work.sides, work.extent, work.active, work.joined
    rows = row_sums.shape[0]
    v = rows
    for k in range(count):
        if extent[k, 0] < extent[k, 1]:
            v = min(v, extent[k, 0])
    total = np.int64(0)
    area = np.int64(0)
    while v < rows:
        band_end = rows
        n_active = 0
        for k in range(count):
            first, last = extent[k, 0], extent[k, 1]
            if first < last:
                if first > v:
                    band_end = min(band_end, first)
                elif last > v:
                    band_end = min(band_end, last)
                    active[n_active] = k
                    n_active += 1
        if n_active > 4:
            gain, covered = _sum_many(
                sides, active, n_active, v, band_end, row_sums, work.starts, work.ends
            )
            total += gain
            area += covered
        elif n_active > 2:
            # A patch that is given twice adds nothing.
            one, other = _index(active[0]), _index(active[1])
            third, fourth = _index(active[2]), _index(active[n_active - 1])
            gain, covered = _sum_four(sides, one, other, third, fourth, v, band_end, row_sums)
            total += gain
            area += covered
        elif n_active > 0:
            one, other = _index(active[0]), _index(active[n_active - 1])
            gap = _join(sides, one, other, _index(v), band_end - v, joined)
            for i in range(band_end - v):
                begin, stop = joined[0, _index(i)], joined[1, _index(i)]
                row = _index(v) + _index(i)
                total += _gain(row_sums, row, begin, stop)
                area += np.int64(stop) - np.int64(begin)
            if gap > 0:
                # Somewhere they are apart: what lies between them does not count.
                for between in range(_index(v), _index(band_end)):
                    begin, stop = _run(sides, one, between)
                    start, end = _run(sides, other, between)
                    left = min(stop, end)
                    right = max(left, max(begin, start))
                    total -= _gain(row_sums, between, left, right)
                    area -= np.int64(right) - np.int64(left)
        v = band_end
    return total, area


# ---------------------------------------------------------------------------------------------
# Costs: what is called from outside


@_compile
def trunk_costs(
    postures: Floats,
    parts: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    row_sums: RowSums,
    base: int,
    costs: Counts,
) -> None:
    """Write the costs (N,) of trunks (N, 4), given the cost ``base`` of drawing nothing."""
    rows, width = row_sums.shape[0], row_sums.shape[1] - 1
    work = _workspace(TRUNK_PATCHES, rows)
    _shape_trunk(parts, work.shape)
    for i in range(postures.shape[0]):
        _torso_pose(postures[i], Place(*place), View(*view), work.torso, work.hip)
        _place_trunk(work)
        _draw(work, View(*view), rows, width)
        costs[i] = base + _sum_union(work, TRUNK_PATCHES, row_sums)[0]


@_compile
def _cover(sides: Whole, extent: Counts, row_sums: RowSums, covered: RowSums) -> None:
    """Write the row sums without the gain of the pixels under the patches to ``covered``.

    Over a run they stay level, and behind it they are lower by what the run gave.
    """
    rows, columns = row_sums.shape
    for v in range(_index(rows)):
        for u in range(_index(columns)):
            covered[v, u] = row_sums[v, u]
    for p in range(_index(extent.shape[0])):
        for v in range(_index(extent[p, 0]), _index(extent[p, 1])):
            start, end = _run(sides, p, v)
            if start < end:
                level = covered[v, _index(start)]
                gain = covered[v, _index(end)] - level
                for u in range(_index(start), _index(end)):
                    covered[v, u] = level
                for u in range(_index(end), _index(columns)):
                    covered[v, u] -= gain


@_compile
def cover_trunk(
    torso: Floats,
    parts: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    row_sums: RowSums,
    covered: RowSums,
) -> np.int64:
    """Write the row sums beside a trunk (4,) to ``covered``; return the gain that they lack."""
    rows, width = row_sums.shape[0], row_sums.shape[1] - 1
    work = _workspace(TRUNK_PATCHES, rows)
    _shape_trunk(parts, work.shape)
    _torso_pose(torso, Place(*place), View(*view), work.torso, work.hip)
    _place_trunk(work)
    _draw(work, View(*view), rows, width)
    _cover(work.sides, work.extent, row_sums, covered)
    gain: np.int64 = _sum_union(work, TRUNK_PATCHES, row_sums)[0]
    return gain


@_compile
def cover_arms(
    posture: Floats,
    parts: Floats,
    shoulder: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    row_sums: RowSums,
    covered: RowSums,
) -> np.int64:
    """Write the row sums beside the arms of a posture (12,); return the gain that they lack."""
    rows, width = row_sums.shape[0], row_sums.shape[1] - 1
    work = _workspace(2 * ARM_PATCHES, rows)
    _torso_pose(posture, Place(*place), View(*view), work.torso, work.hip)
    for arm in range(2):
        first = ARM_PATCHES * arm
        _shape_arm(parts, first, work.shape)
        _place_arm(work, first, _angles_of_arm(posture, arm), _side(arm), parts, shoulder)
    _draw(work, View(*view), rows, width)
    _cover(work.sides, work.extent, row_sums, covered)
    gain: np.int64 = _sum_union(work, 2 * ARM_PATCHES, row_sums)[0]
    return gain


@_compile
def arm_costs(
    postures: Floats,
    side: float,
    torso: Floats,
    parts: Floats,
    shoulder: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    covered: RowSums,
    base: int,
    costs: Counts,
) -> None:
    """Write the costs (N,) of arms (N, 4) beside a trunk (4,), by its row sums and its cost."""
    rows, width = covered.shape[0], covered.shape[1] - 1
    work = _workspace(ARM_PATCHES, rows)
    _shape_arm(parts, 0, work.shape)
    _torso_pose(torso, Place(*place), View(*view), work.torso, work.hip)
    for i in range(postures.shape[0]):
        _place_arm(work, 0, postures[i], side, parts, shoulder)
        _draw(work, View(*view), rows, width)
        costs[i] = base + _sum_union(work, ARM_PATCHES, covered)[0]


@_compile
def full_costs(
    postures: Floats,
    parts: Floats,
    shoulder: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    row_sums: RowSums,
    base: int,
    costs: Counts,
    areas: Counts,
) -> None:
    """Write costs and drawn areas (N,), px, of whole postures (N, 12)."""
    rows, width = row_sums.shape[0], row_sums.shape[1] - 1
    work = _workspace(_BODY_PATCHES, rows)
    _shape_body(parts, work.shape)
    for i in range(postures.shape[0]):
        _place_body(work, postures[i], parts, shoulder, Place(*place), View(*view))
        _draw(work, View(*view), rows, width)
        gain, area = _sum_union(work, _BODY_PATCHES, row_sums)
        costs[i] = base + gain
        areas[i] = area


@_compile
def body_costs(
    postures: Floats,
    parts: Floats,
    shoulders: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    row_sums: RowSums,
    base: int,
    costs: Counts,
) -> None:
    """Write the costs (N,) of N bodies in one place, each in its own posture (N, 12).

    Their shapes are ``parts`` (N, 6, 6) and ``shoulders`` (N, 2).
    """
    rows, width = row_sums.shape[0], row_sums.shape[1] - 1
    work = _workspace(_BODY_PATCHES, rows)
    for i in range(postures.shape[0]):
        _shape_body(parts[i], work.shape)
        _place_body(work, postures[i], parts[i], shoulders[i], Place(*place), View(*view))
        _draw(work, View(*view), rows, width)
        costs[i] = base + _sum_union(work, _BODY_PATCHES, row_sums)[0]


@_compile
def polygon_costs(
    corners_m: Floats, view: ViewTuple, row_sums: RowSums, base: int, costs: Counts
) -> None:
    """Write the costs (N,) of any quadrilaterals (N, K, 4, 3) of the optical frame, metres."""
    rows, width = row_sums.shape[0], row_sums.shape[1] - 1
    count = corners_m.shape[1]
    work = _workspace(count, rows)
    for i in range(corners_m.shape[0]):
        for p in range(count):
            for c in range(4):
                for axis in range(3):
                    work.corners[axis, c * count + p] = corners_m[i, p, c, axis]
        _draw(work, View(*view), rows, width)
        costs[i] = base + _sum_union(work, count, row_sums)[0]


@_compile
def keypoints(
    posture: Floats,
    parts: Floats,
    shoulder: Floats,
    place: PlaceTuple,
    view: ViewTuple,
    points: Floats,
) -> None:
    """Write shoulder, elbow, hand of the left, then the right arm to ``points`` (6, 3).

    Metres in the optical frame.
    """
    torso, hip = np.empty((3, 3)), np.empty(3)
    upper_arm, forearm = np.empty((3, 3)), np.empty((3, 3))
    _torso_pose(posture, Place(*place), View(*view), torso, hip)
    for arm in range(2):
        side, angles = _side(arm), _angles_of_arm(posture, arm)
        _turn_limb(torso, side * angles[0], angles[1], upper_arm)
        _turn_limb(upper_arm, side * angles[2], angles[3], forearm)
        for j in range(3):
            start = _joint(j, side, shoulder, torso, hip)
            elbow = start - parts[_UPPER_ARM, _HEIGHT] * upper_arm[j, 2]
            points[3 * arm, j] = start
            points[3 * arm + 1, j] = elbow
            points[3 * arm + 2, j] = elbow - parts[_FOREARM, _HEIGHT] * forearm[j, 2]
