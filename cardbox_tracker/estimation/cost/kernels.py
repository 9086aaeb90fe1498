"""The compiled inner loop: kinematics, projection, rasterisation and XOR count in one pass.

The idea: with total = number of silhouette pixels, equation (2) is

    W = total + sum over the pixels covered by the model of (1 - 2 f)

A table of running sums of (1 - 2 f) along each row turns the inner sum of one covered run of pixels
into a difference of two entries. So a particle costs the rows of its outline, never its area. For
the arms the table holds 0 where the trunk covers the image already, and an arm particle draws its
own 4 patches, not 11.

The pixel rule is that of :mod:`cardbox_tracker.vision.rasterisation`; the results are equal. A
particle goes through four steps, each a short loop over the patches or over rows, without branches
and, where rows are counted, with 32-bit whole numbers only, for which there are vector
instructions: corners, their pixels, edges, and the two columns where edges cross each row. What
the near plane cuts, or rounding dents, takes a slower way to the same result.

Conventions: ``sizes`` (18,) and ``place`` (distance, hip height) are of the body, ``view`` is (fx,
fy, cx, cy, cos pitch, sin pitch), ``table`` is (rows, W + 1). Index c is one of a patch's 4 corners
in order around it, or the edge from it to the next; index p is a patch. ``work`` is the scratch of
:func:`_workspace`. Matrix products are written out: through BLAS they would cost more than all the
rest. All is in one file because the cache of compiled code on disk only asks the file of the
function that is called whether it has changed.
"""

from __future__ import annotations

from math import cos, sin
from typing import Any

import numpy as np
from numba import njit

from cardbox_tracker.vision.rasterisation import (
    CROSSING_BITS,
    FARTHEST_PX,
    NEAR_PLANE_M,
    SUBPIXELS,
)

_TRUNK, _ARM = 8, 4  # patches; the trunk has 7 and an empty one, for loops of fours
_ONE = float(2**CROSSING_BITS)
_BITS = np.int32(CROSSING_BITS)
_ROUND_UP = 2**CROSSING_BITS - 1
# Steeper than this an edge meets one row at most, and its step is not used.
_STEEPEST = 32000.0

_FOREGROUND = np.uint64(0xFFFFFFFFFFFFFFFF)
# An index of this type is never negative, so no code is made to count from an array's end.
_index = np.uint64

_compile = njit(cache=True, nogil=True, error_model="numpy")
_inline = njit(cache=True, nogil=True, error_model="numpy", forceinline=True)


@_inline
def _workspace(patches: int, rows: int) -> Any:
    """Return scratch for ``patches`` patches.

    0 shape (3, 4 K), metres in the frame of the part; 1 corners (3, 4 K), metres, optical;
    2 pixels (2, 5 K), snapped, the first corner again as the fifth; 3 edges (4, 4 K): first and end
    row, crossing of the first row and step from row to row, 2^-16 px; 4 crossings (K, 2, rows),
    columns; 5 extent (K, 2), first and end row; 6, 7, 8 starts, ends, active (K,) for the union;
    9 rotations (3, 3, 3); 10 places (2, 3): hip, joint; 11 a cut outline (2, 5);
    12 runs of two patches in one (2, rows).
    """
    return (
        np.zeros((3, 4 * patches)),
        np.zeros((3, 4 * patches)),
        np.empty((2, 5 * patches)),
        np.empty((4, 4 * patches), np.int32),
        np.empty((patches, 2, rows), np.int32),
        np.empty((patches, 2), np.int64),
        np.empty(patches, np.int32),
        np.empty(patches, np.int32),
        np.empty(patches, np.int64),
        np.empty((3, 3, 3)),
        np.empty((2, 3)),
        np.empty((2, 5)),
        np.empty((2, rows), np.int32),
    )


@_inline
def _count_on(table: Any, v: Any, u: Any, count: int, sums: Any, step: Any) -> None:
    """Write the ``count`` entries of row ``v`` that follow ``sums`` in column ``u``."""
    for i in range(count):
        table[v, u + _index(i) + _index(1)] = np.int32(sums + step + np.int32(i) * step)


@_compile
def running_sums(silhouette: Any, words: Any, table: Any) -> int:
    """Fill ``table`` (rows, W + 1) for ``silhouette`` (rows, W); return its foreground pixels.

    ``words`` is the same memory as (rows, W / 8) of 64 bits: where eight pixels are alike, and as
    the eight before, they are done by the run. With no words, pixel after pixel.
    """
    rows, width = silhouette.shape
    total = 0
    for v in range(_index(rows)):
        sums = np.int64(0)
        table[v, 0] = 0
        u = _index(0)
        w, n = _index(0), _index(words.shape[1])
        while w < n:
            word = words[v, w]
            begin = w
            w += _index(1)
            if word == _index(0) or word == _FOREGROUND:
                while w < n and words[v, w] == word:
                    w += _index(1)
                step = 1 if word == _index(0) else -1
                count = int(w - begin) * 8
                _count_on(table, v, u, count, np.int32(sums), np.int32(step))
                sums += count * step
                u += _index(count)
            else:
                for _ in range(8):
                    sums += 1 - 2 * (silhouette[v, u] != 0)
                    u += _index(1)
                    table[v, u] = sums
        while u < _index(width):
            sums += 1 - 2 * (silhouette[v, u] != 0)
            u += _index(1)
            table[v, u] = sums
        total += (width - sums) // 2
    return total


@_inline
def _snap(pixel: float) -> Any:
    near = min(max(pixel, -FARTHEST_PX), FARTHEST_PX)
    return np.floor(near * SUBPIXELS + 0.5) / SUBPIXELS


@_inline
def _row(y: float, rows: float) -> Any:
    """First row at or below ``y``, within the image."""
    return np.ceil(min(max(y, 0.0), rows))


@_inline
def _draw(work: Any, view: Any, rows: int, width: int) -> None:
    """Write crossings and extent of all patches, whose corners are there."""
    corners, pixels, edges, crossings, extent = work[1], work[2], work[3], work[4], work[5]
    fx, fy, cx, cy = view[0], view[1], view[2], view[3]
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
        edges[0, _index(e)] = np.int32(row)
        edges[1, _index(e)] = np.int32(_row(max(y0, y1), limit))
        edges[2, _index(e)] = np.int32(np.floor(crossing * _ONE + 0.5))
        edges[3, _index(e)] = np.int32(np.floor(step * _ONE + 0.5))
    for p in range(patches):
        # The edges that go down write one of the crossings of a row and those that go up the
        # other: each row is met once by either, unless rounding dented a sliver.
        y0, y1 = pixels[1, _index(p)], pixels[1, _index(p + patches)]
        y2, y3 = pixels[1, _index(p + 2 * patches)], pixels[1, _index(p + 3 * patches)]
        a, b, c, d = y1 > y0, y2 > y1, y3 > y2, y0 > y3
        if (a != b) + (b != c) + (c != d) + (d != a) > 2:
            _draw_cut(work, p, view, rows, width)
            continue
        extent[p, 0] = np.int64(_row(min(min(y0, y1), min(y2, y3)), limit))
        extent[p, 1] = np.int64(_row(max(max(y0, y1), max(y2, y3)), limit))
        _cross(edges, p, p, _index(a), crossings, width)
        _cross(edges, p + patches, p, _index(b), crossings, width)
        _cross(edges, p + 2 * patches, p, _index(c), crossings, width)
        _cross(edges, p + 3 * patches, p, _index(d), crossings, width)


@_inline
def _cross(edges: Any, e: int, p: int, side: Any, crossings: Any, width: int) -> None:
    """Write the columns where edge ``e`` crosses its rows as one side of patch ``p``."""
    first = np.int64(edges[0, _index(e)])
    x, step, limit = edges[2, _index(e)], edges[3, _index(e)], np.int32(width)
    base, k = _index(first), _index(p)
    for i in range(np.int64(edges[1, _index(e)]) - first):
        u = np.int32(np.int32(x + np.int32(i) * step + np.int32(_ROUND_UP)) >> _BITS)
        crossings[k, side, base + _index(i)] = min(max(u, np.int32(0)), limit)


@_compile
def _draw_cut(work: Any, p: Any, view: Any, rows: int, width: int) -> None:
    """Write crossings and extent of patch ``p``, cut at the near plane, as the definition says."""
    corners, crossings, extent, outline = work[1], work[4], work[5], work[11]
    fx, fy, cx, cy = view[0], view[1], view[2], view[3]
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
        crossings[p, 0, v] = width
        crossings[p, 1, v] = 0
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
                crossings[p, 0, v] = min(crossings[p, 0, v], u)
                crossings[p, 1, v] = max(crossings[p, 1, v], u)


@_inline
def _insert(starts: Any, ends: Any, n: int, start: Any, end: Any) -> None:
    """Insert a run into the first ``n`` runs, which are ordered by start."""
    i = n
    while i > 0 and starts[i - 1] > start:
        starts[i] = starts[i - 1]
        ends[i] = ends[i - 1]
        i -= 1
    starts[i] = start
    ends[i] = end


@_inline
def _run(crossings: Any, p: Any, row: Any) -> Any:
    """First and end column of a patch in a row."""
    a, b = crossings[p, 0, row], crossings[p, 1, row]
    return min(a, b), max(a, b)


@_inline
def _gain(table: Any, row: Any, start: Any, end: Any) -> Any:
    """Sum of (1 - 2 f) over a run of a row."""
    return np.int64(table[row, _index(end)]) - np.int64(table[row, _index(start)])


@_compile
def _join(crossings: Any, one: Any, other: Any, first: Any, count: int, joint: Any) -> Any:
    """Write the runs of two patches as one to ``joint``; above 0 if they are apart somewhere."""
    gap = np.int32(0)
    for i in range(count):
        row = first + _index(i)
        begin, stop = _run(crossings, one, row)
        start, end = _run(crossings, other, row)
        gap = max(gap, np.int32(max(begin, start) - min(stop, end)))
        joint[0, _index(i)] = min(begin, start)
        joint[1, _index(i)] = max(stop, end)
    return gap


@_inline
def _packed(crossings: Any, p: Any, row: Any) -> Any:
    """A run as one number that orders runs by their start."""
    start, end = _run(crossings, p, row)
    return (_index(start) << _index(32)) | _index(end)


@_compile
def _sum_four(
    crossings: Any, a: Any, b: Any, c: Any, d: Any, v: int, end_row: int, table: Any
) -> Any:
    """Sum ``table`` over the union of four patches in rows that all of them meet; also its area."""
    total = np.int64(0)
    area = np.int64(0)
    half, ends = _index(32), _index(0xFFFFFFFF)
    for row in range(_index(v), _index(end_row)):
        k, m = _packed(crossings, a, row), _packed(crossings, b, row)
        n, o = _packed(crossings, c, row), _packed(crossings, d, row)
        # A sorting network, for the order is hard to predict.
        k, m = min(k, m), max(k, m)
        n, o = min(n, o), max(n, o)
        k, n = min(k, n), max(k, n)
        m, o = min(m, o), max(m, o)
        m, n = min(m, n), max(m, n)
        stop = k & ends
        total += _gain(table, row, k >> half, stop)
        area += np.int64(stop) - np.int64(k >> half)
        for run in (m, n, o):
            begin = max(run >> half, stop)
            stop = max(run & ends, stop)
            total += _gain(table, row, begin, stop)
            area += np.int64(stop) - np.int64(begin)
    return total, area


@_compile
def _sum_many(
    crossings: Any, active: Any, n: int, v: int, end_row: int, table: Any, starts: Any, ends: Any
) -> Any:
    """Sum ``table`` over the union of ``n`` patches in rows that all of them meet; also its area.

    The patches of one part come one after the other and overlap, so most rows need no more than
    joining each to the one before; what does not join is kept, in order, for a sweep.
    """
    total = np.int64(0)
    area = np.int64(0)
    for row in range(_index(v), _index(end_row)):
        kept = 0
        begin = stop = np.int32(0)
        for j in range(n):
            start, end = _run(crossings, _index(active[_index(j)]), row)
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
                    total += _gain(table, row, begin, stop)
                    area += np.int64(stop) - np.int64(begin)
                    begin, stop = starts[i], ends[i]
        total += _gain(table, row, begin, stop)
        area += np.int64(stop) - np.int64(begin)
    return total, area


@_inline
def _sum_union(work: Any, count: int, table: Any) -> Any:
    """Sum ``table`` over the union of the first ``count`` patches; also its area in pixels.

    The rows fall into bands within which the same patches are met, so that a row does not ask each
    patch whether it reaches there.
    """
    crossings, extent, starts, ends, active = work[4], work[5], work[6], work[7], work[8]
    joint = work[12]
    rows = table.shape[0]
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
            gain, covered = _sum_many(crossings, active, n_active, v, band_end, table, starts, ends)
            total += gain
            area += covered
        elif n_active > 2:
            # A patch that is given twice adds nothing.
            one, other = _index(active[0]), _index(active[1])
            third, fourth = _index(active[2]), _index(active[n_active - 1])
            gain, covered = _sum_four(crossings, one, other, third, fourth, v, band_end, table)
            total += gain
            area += covered
        elif n_active > 0:
            one, other = _index(active[0]), _index(active[n_active - 1])
            gap = _join(crossings, one, other, _index(v), band_end - v, joint)
            for i in range(band_end - v):
                begin, stop = joint[0, _index(i)], joint[1, _index(i)]
                row = _index(v) + _index(i)
                total += _gain(table, row, begin, stop)
                area += np.int64(stop) - np.int64(begin)
            if gap > 0:
                # Somewhere they are apart: what lies between them does not count.
                for between in range(_index(v), _index(band_end)):
                    begin, stop = _run(crossings, one, between)
                    start, end = _run(crossings, other, between)
                    left = min(stop, end)
                    right = max(left, max(begin, start))
                    total -= _gain(table, between, left, right)
                    area -= np.int64(right) - np.int64(left)
        v = band_end
    return total, area


@_inline
def _torso_pose(torso: Any, place: Any, view: Any, rotation: Any, hip: Any) -> None:
    """Torso rotation (3, 3) and mid-hip (3,) in the optical frame for d1..d4."""
    cr, sr = cos(torso[1]), sin(torso[1])
    cp, sp = cos(torso[2]), sin(torso[2])
    cw, sw = cos(torso[3]), sin(torso[3])
    cv, sv = view[4], view[5]
    # Columns of Rz(yaw) Ry(pitch) Rx(roll), then into the optical frame.
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
    hip[0] = torso[0]
    hip[1] = -cv * place[1] - sv * place[0]
    hip[2] = -sv * place[1] + cv * place[0]


@_inline
def _upright(
    shape: Any,
    p: int,
    axis: int,
    half_low: float,
    half_high: float,
    low: float,
    high: float,
    shift: float,
) -> None:
    """Corners of a trapezoid through Z of a part, spreading along X (``axis`` 0) or Y (1).

    ``shift`` moves it along X.
    """
    patches = shape.shape[1] // 4
    for c in range(4):
        e = c * patches + p
        half = half_low if c < 2 else half_high
        shape[0, e] = shift
        shape[1, e] = 0.0
        shape[axis, e] += half if c == 1 or c == 2 else -half
        shape[2, e] = low if c < 2 else high


@_inline
def _shape_trunk(sizes: Any, shape: Any) -> None:
    """Corners of torso, waist and head, patches 0 to 6, in the torso's frame."""
    waist = sizes[4]
    top = waist + sizes[2]
    chin = top + sizes[7]
    crown = chin + sizes[6]
    depth, wide = sizes[8] / 2, sizes[0] / 2
    _upright(shape, 0, 1, sizes[1] / 2, wide, waist, top, 0.0)
    _upright(shape, 1, 0, depth, depth, waist, top, 0.0)
    patches = shape.shape[1] // 4
    for c in range(4):
        e = c * patches + 2
        shape[0, e] = depth if c == 1 or c == 2 else -depth
        shape[1, e] = wide if c >= 2 else -wide
        shape[2, e] = top
    _upright(shape, 3, 1, sizes[3] / 2, sizes[3] / 2, 0.0, waist, 0.0)
    _upright(shape, 4, 0, sizes[9] / 2, sizes[9] / 2, 0.0, waist, 0.0)
    _upright(shape, 5, 1, sizes[5] / 2, sizes[5] / 2, chin, crown, sizes[11])
    _upright(shape, 6, 0, sizes[10] / 2, sizes[10] / 2, chin, crown, sizes[11])


@_inline
def _shape_arm(sizes: Any, shape: Any, p: int) -> None:
    """Corners of an upper arm and a forearm, patches ``p`` to ``p`` + 3, in their own frames."""
    for part in range(2):
        length, half = sizes[14 + 2 * part], sizes[15 + 2 * part] / 2
        for patch in range(2):
            _upright(shape, p + 2 * part + patch, 1 - patch, half, half, -length, 0.0, 0.0)


@_inline
def _place(shape: Any, begin: int, end: int, rotation: Any, origin: Any, corners: Any) -> None:
    """Turn and move the patches ``begin`` to ``end`` from their part's frame to the optical one."""
    patches = shape.shape[1] // 4
    for j in range(3):
        a, b, c, o = rotation[j, 0], rotation[j, 1], rotation[j, 2], origin[j]
        for corner in range(4):
            at = corner * patches
            for e in range(at + begin, at + end):
                x, y, z = shape[0, _index(e)], shape[1, _index(e)], shape[2, _index(e)]
                corners[j, _index(e)] = o + a * x + b * y + c * z


@_inline
def _turn_limb(parent: Any, abduction: float, flexion: float, rotation: Any) -> None:
    """Rotation = parent Rx(abduction) Ry(-flexion)."""
    ca, sa = cos(abduction), sin(abduction)
    cf, sf = cos(flexion), sin(flexion)
    for c in range(3):
        px, py, pz = parent[c, 0], parent[c, 1], parent[c, 2]
        y = ca * py + sa * pz
        z = ca * pz - sa * py
        rotation[c, 0] = cf * px + sf * z
        rotation[c, 1] = y
        rotation[c, 2] = cf * z - sf * px


@_inline
def _place_trunk(work: Any) -> None:
    """Corners of torso, waist and head, the first patches, in the torso's pose."""
    _place(work[0], 0, _TRUNK, work[9][0], work[10][0], work[1])


@_inline
def _place_arm(work: Any, p: int, angles: Any, side: float, sizes: Any) -> None:
    """Corners of an arm at the torso's pose, patches ``p`` on; ``side`` is 1 for left, -1 right."""
    torso, upper, fore = work[9][0], work[9][1], work[9][2]
    hip, joint = work[10][0], work[10][1]
    height = sizes[4] + sizes[2] - sizes[13]
    for c in range(3):
        joint[c] = hip[c] + side * sizes[12] / 2 * torso[c, 1] + height * torso[c, 2]
    _turn_limb(torso, side * angles[0], angles[1], upper)
    _place(work[0], p, p + 2, upper, joint, work[1])
    for c in range(3):
        joint[c] -= sizes[14] * upper[c, 2]
    _turn_limb(upper, side * angles[2], angles[3], fore)
    _place(work[0], p + 2, p + 4, fore, joint, work[1])


@_compile
def trunk_costs(
    postures: Any, sizes: Any, place: Any, view: Any, table: Any, total: int, costs: Any
) -> None:
    """Costs (N,) of trunks (N, 4)."""
    rows, width = table.shape[0], table.shape[1] - 1
    work = _workspace(_TRUNK, rows)
    _shape_trunk(sizes, work[0])
    for i in range(postures.shape[0]):
        _torso_pose(postures[i], place, view, work[9][0], work[10][0])
        _place_trunk(work)
        _draw(work, view, rows, width)
        costs[i] = total + _sum_union(work, _TRUNK, table)[0]


@_compile
def _cover(work: Any, table: Any, covered: Any) -> None:
    """Write ``table`` without the gain of the pixels under the patches to ``covered``."""
    crossings, extent = work[4], work[5]
    rows, columns = table.shape
    for v in range(_index(rows)):
        for u in range(_index(columns)):
            covered[v, u] = table[v, u]
    for k in range(_index(extent.shape[0])):
        for v in range(_index(extent[k, 0]), _index(extent[k, 1])):
            start, end = _run(crossings, k, v)
            if start < end:
                base = covered[v, _index(start)]
                gain = covered[v, _index(end)] - base
                for u in range(_index(start), _index(end)):
                    covered[v, u] = base
                for u in range(_index(end), _index(columns)):
                    covered[v, u] -= gain


@_compile
def cover_trunk(torso: Any, sizes: Any, place: Any, view: Any, table: Any, covered: Any) -> Any:
    """Write ``table`` without the gain under the trunk to ``covered``; return what was taken."""
    rows, width = table.shape[0], table.shape[1] - 1
    work = _workspace(_TRUNK, rows)
    _shape_trunk(sizes, work[0])
    _torso_pose(torso, place, view, work[9][0], work[10][0])
    _place_trunk(work)
    _draw(work, view, rows, width)
    _cover(work, table, covered)
    return _sum_union(work, _TRUNK, table)[0]


@_compile
def cover_arms(posture: Any, sizes: Any, place: Any, view: Any, table: Any, covered: Any) -> Any:
    """Write ``table`` without the gain under both arms to ``covered``; return what was taken."""
    rows, width = table.shape[0], table.shape[1] - 1
    work = _workspace(2 * _ARM, rows)
    _torso_pose(posture, place, view, work[9][0], work[10][0])
    for arm in range(2):
        p, angles = _ARM * arm, posture[4 + 4 * arm : 8 + 4 * arm]
        _shape_arm(sizes, work[0], p)
        _place_arm(work, p, angles, 1.0 - 2.0 * arm, sizes)
    _draw(work, view, rows, width)
    _cover(work, table, covered)
    return _sum_union(work, 2 * _ARM, table)[0]


@_compile
def arm_costs(
    postures: Any,
    side: float,
    torso: Any,
    sizes: Any,
    place: Any,
    view: Any,
    covered: Any,
    base: int,
    costs: Any,
) -> None:
    """Costs (N,) of arms (N, 4) beside a trunk that ``covered`` accounts for, of cost ``base``."""
    rows, width = covered.shape[0], covered.shape[1] - 1
    work = _workspace(_ARM, rows)
    _shape_arm(sizes, work[0], 0)
    _torso_pose(torso, place, view, work[9][0], work[10][0])
    for i in range(postures.shape[0]):
        _place_arm(work, 0, postures[i], side, sizes)
        _draw(work, view, rows, width)
        costs[i] = base + _sum_union(work, _ARM, covered)[0]


@_compile
def full_costs(
    postures: Any, sizes: Any, place: Any, view: Any, table: Any, total: int, costs: Any, areas: Any
) -> None:
    """Costs and drawn areas (N,) of whole postures (N, 12)."""
    rows, width = table.shape[0], table.shape[1] - 1
    patches = _TRUNK + 2 * _ARM
    work = _workspace(patches, rows)
    _shape_trunk(sizes, work[0])
    _shape_arm(sizes, work[0], _TRUNK)
    _shape_arm(sizes, work[0], _TRUNK + _ARM)
    for i in range(postures.shape[0]):
        _torso_pose(postures[i], place, view, work[9][0], work[10][0])
        _place_trunk(work)
        for arm in range(2):
            p, angles = _TRUNK + _ARM * arm, postures[i, 4 + 4 * arm : 8 + 4 * arm]
            _place_arm(work, p, angles, 1.0 - 2.0 * arm, sizes)
        _draw(work, view, rows, width)
        gain, area = _sum_union(work, patches, table)
        costs[i] = total + gain
        areas[i] = area


@_compile
def body_costs(
    sizes: Any, place: Any, postures: Any, view: Any, table: Any, total: int, costs: Any
) -> None:
    """Costs (N,) of bodies (N, 18), each in its own posture (N, 12)."""
    areas = np.empty(1, np.int64)
    for i in range(sizes.shape[0]):
        full_costs(
            postures[i : i + 1], sizes[i], place, view, table, total, costs[i : i + 1], areas
        )


@_compile
def polygon_costs(corners_m: Any, view: Any, table: Any, total: int, costs: Any) -> None:
    """Costs (N,) of any quadrilaterals (N, K, 4, 3) of the optical frame, such as a box model's."""
    rows, width = table.shape[0], table.shape[1] - 1
    count = corners_m.shape[1]
    work = _workspace(count, rows)
    for i in range(corners_m.shape[0]):
        for p in range(count):
            for c in range(4):
                for j in range(3):
                    work[1][j, c * count + p] = corners_m[i, p, c, j]
        _draw(work, view, rows, width)
        costs[i] = total + _sum_union(work, count, table)[0]


@_compile
def keypoints(posture: Any, sizes: Any, place: Any, view: Any, points: Any) -> None:
    """Write shoulder, elbow, hand of the left, then the right arm to ``points`` (6, 3), optical."""
    torso, hip, limb = np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    fore = np.empty((3, 3))
    _torso_pose(posture, place, view, torso, hip)
    height = sizes[4] + sizes[2] - sizes[13]
    for arm in range(2):
        side = 1.0 - 2.0 * arm
        first = 4 + 4 * arm
        _turn_limb(torso, side * posture[first], posture[first + 1], limb)
        _turn_limb(limb, side * posture[first + 2], posture[first + 3], fore)
        for c in range(3):
            shoulder = hip[c] + side * sizes[12] / 2 * torso[c, 1] + height * torso[c, 2]
            points[3 * arm, c] = shoulder
            points[3 * arm + 1, c] = shoulder - sizes[14] * limb[c, 2]
            points[3 * arm + 2, c] = points[3 * arm + 1, c] - sizes[16] * fore[c, 2]
