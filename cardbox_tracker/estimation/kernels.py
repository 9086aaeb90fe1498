"""The compiled inner loop: kinematics, projection, rasterisation and XOR count in one pass.

The idea: with total = number of silhouette pixels, equation (2) is

    W = total + sum over the pixels covered by the model of (1 - 2 f)

A table of running sums of (1 - 2 f) along each row turns the inner sum of one covered run of pixels
into a difference of two entries. So a particle costs the rows of its outline, never its area. For
the arms the table holds 0 where the trunk covers the picture already, and an arm particle draws its
own 4 patches, not 11.

The pixel rule is that of :mod:`cardbox_tracker.vision.rasterisation`; the results are equal.
Conventions here: ``sizes`` (18,) and ``place`` (distance, hip height) are of the body, ``view`` is
(fx, fy, cx, cy, cos pitch, sin pitch); ``table`` is (rows, W + 1). Matrix products are written out:
through BLAS they would cost more than all the rest.
"""

from __future__ import annotations

from math import ceil, cos, floor, sin
from typing import Any

import numpy as np
from numba import njit

from cardbox_tracker.vision.rasterisation import NEAR_PLANE_M, SUBPIXELS

MAX_CORNERS = 5  # of a quadrilateral cut at the near plane

# An index of this type is never negative, so no code is made to count from an array's end.
_index = np.uint64

_compile = njit(cache=True, nogil=True, error_model="numpy")
_inline = njit(cache=True, nogil=True, error_model="numpy", forceinline=True)


@_compile
def running_sums(silhouette: Any, table: Any) -> int:
    """Fill ``table`` (rows, W + 1) for ``silhouette`` (rows, W); return its foreground pixels."""
    rows, width = silhouette.shape
    total = 0
    for v in range(rows):
        sums = 0
        table[v, 0] = 0
        for u in range(width):
            sums += 1 - 2 * (silhouette[v, u] != 0)
            table[v, u + 1] = sums
        total += (width - sums) // 2
    return total


@_inline
def _snap(pixel: float) -> float:
    return floor(pixel * SUBPIXELS + 0.5) / SUBPIXELS


@_inline
def _put_quad(
    quad: Any, pixels: Any, view: Any, k: int, spans: Any, extent: Any, rows: int, width: int
) -> None:
    """Project a quadrilateral (4, 3) of the optical frame and store its runs as patch ``k``.

    ``spans`` (K, 2, rows) receives first and last + 1 column of each row, ``extent`` (K, 2) the
    first and last + 1 row.
    """
    xs, ys = pixels[0], pixels[1]
    n = 0
    fx, fy, cx, cy = view[0], view[1], view[2], view[3]
    if (
        quad[0, 2] >= NEAR_PLANE_M
        and quad[1, 2] >= NEAR_PLANE_M
        and quad[2, 2] >= NEAR_PLANE_M
        and quad[3, 2] >= NEAR_PLANE_M
    ):
        for i in range(4):
            nearness = 1.0 / quad[i, 2]
            xs[i] = _snap(fx * quad[i, 0] * nearness + cx)
            ys[i] = _snap(fy * quad[i, 1] * nearness + cy)
        n = 4
    else:
        for i in range(4):
            j = (i + 1) % 4
            z0, z1 = quad[i, 2], quad[j, 2]
            if z0 >= NEAR_PLANE_M:
                xs[n] = _snap(fx * quad[i, 0] / z0 + cx)
                ys[n] = _snap(fy * quad[i, 1] / z0 + cy)
                n += 1
            if (z0 >= NEAR_PLANE_M) != (z1 >= NEAR_PLANE_M):
                t = (NEAR_PLANE_M - z0) / (z1 - z0)
                x = quad[i, 0] + t * (quad[j, 0] - quad[i, 0])
                y = quad[i, 1] + t * (quad[j, 1] - quad[i, 1])
                xs[n] = _snap(fx * x / NEAR_PLANE_M + cx)
                ys[n] = _snap(fy * y / NEAR_PLANE_M + cy)
                n += 1
    _put_polygon(xs, ys, n, k, spans, extent, rows, width)


@_inline
def _clip_row(y: float, rows: int) -> int:
    return ceil(min(max(y, 0.0), float(rows)))


@_inline
def _put_polygon(
    xs: Any, ys: Any, n: int, patch: int, spans: Any, extent: Any, rows: int, width: int
) -> None:
    """Store the runs of a convex polygon of ``n`` snapped corners as patch ``patch``."""
    if n < 3:
        extent[patch, 0] = extent[patch, 1] = 0
        return
    lowest = highest = ys[0]
    for i in range(1, n):
        lowest = min(lowest, ys[i])
        highest = max(highest, ys[i])
    first, last = _clip_row(lowest, rows), _clip_row(highest, rows)
    k = _index(patch)
    extent[k, 0] = first
    extent[k, 1] = last
    # Going round a convex polygon, the edges that go down are all on one side and those that go up
    # on the other, so each row is written once a side. Rounding to the grid may dent a sliver; then
    # the crossings of a row are compared, as in the definition.
    turns_left = turns_right = False
    for i in range(n):
        j = i + 1 if i + 1 < n else 0
        m = j + 1 if j + 1 < n else 0
        turn = (xs[j] - xs[i]) * (ys[m] - ys[j]) - (ys[j] - ys[i]) * (xs[m] - xs[j])
        turns_left |= turn < 0.0
        turns_right |= turn > 0.0
    is_convex = not (turns_left and turns_right)
    if not is_convex:
        for v in range(first, last):
            spans[k, 0, v] = width
            spans[k, 1, v] = 0
    limit = float(width)
    for edge in range(n):
        j = edge + 1 if edge + 1 < n else 0
        if ys[edge] == ys[j]:
            continue
        side = _index(0) if (ys[j] < ys[edge]) == turns_right else _index(1)
        # From the upper end to the lower, as in the definition.
        if ys[edge] < ys[j]:
            x0, y0, x1, y1 = xs[edge], ys[edge], xs[j], ys[j]
        else:
            x0, y0, x1, y1 = xs[j], ys[j], xs[edge], ys[edge]
        slope = (x1 - x0) / (y1 - y0)
        low = _clip_row(y0, rows)
        # 32-bit counters and np.ceil, for these have vector instructions. On the grid of corners
        # the differences are exact, so this is v - y0 of the definition to the last bit.
        count = np.int32(_clip_row(y1, rows) - low)
        below = low - y0
        base = _index(low)
        if is_convex:
            for i in range(count):
                x = x0 + (np.float64(i) + below) * slope
                spans[k, side, base + _index(i)] = np.int32(np.ceil(min(max(x, 0.0), limit)))
        else:
            for i in range(count):
                x = x0 + (np.float64(i) + below) * slope
                u = np.uint32(np.int32(np.ceil(min(max(x, 0.0), limit))))
                spans[k, 0, base + _index(i)] = min(spans[k, 0, base + _index(i)], u)
                spans[k, 1, base + _index(i)] = max(spans[k, 1, base + _index(i)], u)


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


@_compile
def _sum_union(
    spans: Any, extent: Any, count: int, table: Any, starts: Any, ends: Any, active: Any
) -> Any:
    """Sum ``table`` over the union of the first ``count`` patches; also its area in pixels.

    The rows fall into bands within which the same patches are met, so that a row does not ask each
    patch whether it reaches there. ``starts``, ``ends`` and ``active`` (K,) are scratch.
    """
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
        if n_active == 0:
            v = band_end
            continue
        if n_active == 1:
            only = _index(active[0])
            for row in range(_index(v), _index(band_end)):
                start, end = spans[only, 0, row], spans[only, 1, row]
                if start < end:
                    total += np.int64(table[row, end]) - np.int64(table[row, start])
                    area += np.int64(end) - np.int64(start)
        elif n_active == 2:
            first_k, second_k = _index(active[0]), _index(active[1])
            for row in range(_index(v), _index(band_end)):
                begin = spans[first_k, 0, row]
                stop = max(begin, spans[first_k, 1, row])
                start = spans[second_k, 0, row]
                end = max(start, spans[second_k, 1, row])
                if max(begin, start) <= min(stop, end):
                    begin = min(begin, start)
                    stop = max(stop, end)
                else:
                    total += np.int64(table[row, end]) - np.int64(table[row, start])
                    area += np.int64(end) - np.int64(start)
                total += np.int64(table[row, stop]) - np.int64(table[row, begin])
                area += np.int64(stop) - np.int64(begin)
        else:
            for row in range(_index(v), _index(band_end)):
                # The patches of one part come one after the other and overlap, so most rows need no
                # more than this; what does not join is kept, in order, for the sweep below.
                n = 0
                begin = stop = np.uint32(0)
                for j in range(n_active):
                    this = _index(active[_index(j)])
                    start, end = spans[this, 0, row], spans[this, 1, row]
                    if start < end:
                        if start <= stop and begin <= end and begin < stop:
                            begin = min(begin, start)
                            stop = max(stop, end)
                        else:
                            if begin < stop:
                                _insert(starts, ends, n, begin, stop)
                                n += 1
                            begin, stop = start, end
                if n > 0:
                    _insert(starts, ends, n, begin, stop)
                    begin, stop = starts[0], ends[0]
                    for i in range(1, n + 1):
                        if starts[i] <= stop:
                            stop = max(stop, ends[i])
                        else:
                            total += np.int64(table[row, stop]) - np.int64(table[row, begin])
                            area += np.int64(stop) - np.int64(begin)
                            begin, stop = starts[i], ends[i]
                total += np.int64(table[row, stop]) - np.int64(table[row, begin])
                area += np.int64(stop) - np.int64(begin)
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
    quad: Any,
    rotation: Any,
    axis: int,
    origin: Any,
    half_low: float,
    half_high: float,
    low: float,
    high: float,
    shift: float,
) -> None:
    """Corners of a trapezoid through Z of a part, spreading along X (``axis`` 0) or Y (1).

    ``shift`` moves it along X.
    """
    for c in range(3):
        across, up = rotation[c, axis], rotation[c, 2]
        base = origin[c] + shift * rotation[c, 0]
        quad[0, c] = base + low * up - half_low * across
        quad[1, c] = base + low * up + half_low * across
        quad[2, c] = base + high * up + half_high * across
        quad[3, c] = base + high * up - half_high * across


@_compile
def _put_trunk(
    rotation: Any,
    hip: Any,
    sizes: Any,
    view: Any,
    quad: Any,
    pixels: Any,
    spans: Any,
    extent: Any,
    rows: int,
    width: int,
) -> None:
    """Store torso, waist and head as patches 0 to 6."""
    waist = sizes[4]
    top = waist + sizes[2]
    chin = top + sizes[7]
    crown = chin + sizes[6]
    _upright(quad, rotation, 1, hip, sizes[1] / 2, sizes[0] / 2, waist, top, 0.0)
    _put_quad(quad, pixels, view, 0, spans, extent, rows, width)
    _upright(quad, rotation, 0, hip, sizes[8] / 2, sizes[8] / 2, waist, top, 0.0)
    _put_quad(quad, pixels, view, 1, spans, extent, rows, width)
    x, y = sizes[8] / 2, sizes[0] / 2
    for c in range(3):
        middle = hip[c] + top * rotation[c, 2]
        forward, aside = x * rotation[c, 0], y * rotation[c, 1]
        quad[0, c] = middle - forward - aside
        quad[1, c] = middle + forward - aside
        quad[2, c] = middle + forward + aside
        quad[3, c] = middle - forward + aside
    _put_quad(quad, pixels, view, 2, spans, extent, rows, width)
    _upright(quad, rotation, 1, hip, sizes[3] / 2, sizes[3] / 2, 0.0, waist, 0.0)
    _put_quad(quad, pixels, view, 3, spans, extent, rows, width)
    _upright(quad, rotation, 0, hip, sizes[9] / 2, sizes[9] / 2, 0.0, waist, 0.0)
    _put_quad(quad, pixels, view, 4, spans, extent, rows, width)
    _upright(quad, rotation, 1, hip, sizes[5] / 2, sizes[5] / 2, chin, crown, sizes[11])
    _put_quad(quad, pixels, view, 5, spans, extent, rows, width)
    _upright(quad, rotation, 0, hip, sizes[10] / 2, sizes[10] / 2, chin, crown, sizes[11])
    _put_quad(quad, pixels, view, 6, spans, extent, rows, width)


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


@_compile
def _put_arm(
    angles: Any,
    side: float,
    torso: Any,
    hip: Any,
    sizes: Any,
    view: Any,
    k: int,
    upper: Any,
    fore: Any,
    origin: Any,
    quad: Any,
    pixels: Any,
    spans: Any,
    extent: Any,
    rows: int,
    width: int,
) -> None:
    """Store one arm as patches ``k`` to ``k`` + 3; ``side`` is +1 for left, -1 for right."""
    height = sizes[4] + sizes[2] - sizes[13]
    for c in range(3):
        origin[c] = hip[c] + side * sizes[12] / 2 * torso[c, 1] + height * torso[c, 2]
    _turn_limb(torso, side * angles[0], angles[1], upper)
    _upright(quad, upper, 1, origin, sizes[15] / 2, sizes[15] / 2, -sizes[14], 0.0, 0.0)
    _put_quad(quad, pixels, view, k, spans, extent, rows, width)
    _upright(quad, upper, 0, origin, sizes[15] / 2, sizes[15] / 2, -sizes[14], 0.0, 0.0)
    _put_quad(quad, pixels, view, k + 1, spans, extent, rows, width)
    for c in range(3):
        origin[c] -= sizes[14] * upper[c, 2]
    _turn_limb(upper, side * angles[2], angles[3], fore)
    _upright(quad, fore, 1, origin, sizes[17] / 2, sizes[17] / 2, -sizes[16], 0.0, 0.0)
    _put_quad(quad, pixels, view, k + 2, spans, extent, rows, width)
    _upright(quad, fore, 0, origin, sizes[17] / 2, sizes[17] / 2, -sizes[16], 0.0, 0.0)
    _put_quad(quad, pixels, view, k + 3, spans, extent, rows, width)


@_compile
def trunk_costs(
    postures: Any, sizes: Any, place: Any, view: Any, table: Any, total: int, costs: Any
) -> None:
    """Costs (N,) of trunks (N, 4)."""
    rows, width = table.shape[0], table.shape[1] - 1
    spans = np.empty((7, 2, rows), np.uint32)
    extent = np.empty((7, 2), np.int64)
    starts, ends = np.empty(7, np.uint32), np.empty(7, np.uint32)
    active, pixels = np.empty(7, np.int64), np.empty((2, MAX_CORNERS))
    rotation, hip, quad = np.empty((3, 3)), np.empty(3), np.empty((4, 3))
    for i in range(postures.shape[0]):
        _torso_pose(postures[i], place, view, rotation, hip)
        _put_trunk(rotation, hip, sizes, view, quad, pixels, spans, extent, rows, width)
        costs[i] = total + _sum_union(spans, extent, 7, table, starts, ends, active)[0]


@_compile
def _cover(spans: Any, extent: Any, count: int, covered: Any) -> None:
    """Take the gain of the pixels under the first ``count`` patches out of ``covered``."""
    width = covered.shape[1] - 1
    for k in range(count):
        for v in range(extent[k, 0], extent[k, 1]):
            start, end = spans[k, 0, v], spans[k, 1, v]
            if start < end:
                base = covered[v, start]
                gain = covered[v, end] - base
                for u in range(start + 1, end):
                    covered[v, u] = base
                if gain != 0:
                    for u in range(end, width + 1):
                        covered[v, u] -= gain
                else:
                    covered[v, end] = base


@_compile
def cover_trunk(torso: Any, sizes: Any, place: Any, view: Any, table: Any, covered: Any) -> Any:
    """Write ``table`` without the gain under the trunk to ``covered``; return what was taken."""
    rows, width = table.shape[0], table.shape[1] - 1
    spans = np.empty((7, 2, rows), np.uint32)
    extent = np.empty((7, 2), np.int64)
    starts, ends = np.empty(7, np.uint32), np.empty(7, np.uint32)
    active, pixels = np.empty(7, np.int64), np.empty((2, MAX_CORNERS))
    rotation, hip, quad = np.empty((3, 3)), np.empty(3), np.empty((4, 3))
    _torso_pose(torso, place, view, rotation, hip)
    _put_trunk(rotation, hip, sizes, view, quad, pixels, spans, extent, rows, width)
    covered[:] = table
    _cover(spans, extent, 7, covered)
    return _sum_union(spans, extent, 7, table, starts, ends, active)[0]


@_compile
def cover_arms(posture: Any, sizes: Any, place: Any, view: Any, table: Any, covered: Any) -> Any:
    """Write ``table`` without the gain under both arms to ``covered``; return what was taken."""
    rows, width = table.shape[0], table.shape[1] - 1
    spans = np.empty((8, 2, rows), np.uint32)
    extent = np.empty((8, 2), np.int64)
    starts, ends = np.empty(8, np.uint32), np.empty(8, np.uint32)
    active, pixels = np.empty(8, np.int64), np.empty((2, MAX_CORNERS))
    rotation, hip, quad = np.empty((3, 3)), np.empty(3), np.empty((4, 3))
    upper, fore, origin = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    _torso_pose(posture, place, view, rotation, hip)
    for arm in range(2):
        _put_arm(
            posture[4 + 4 * arm : 8 + 4 * arm],
            1.0 - 2.0 * arm,
            rotation,
            hip,
            sizes,
            view,
            4 * arm,
            upper,
            fore,
            origin,
            quad,
            pixels,
            spans,
            extent,
            rows,
            width,
        )
    covered[:] = table
    _cover(spans, extent, 8, covered)
    return _sum_union(spans, extent, 8, table, starts, ends, active)[0]


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
    spans = np.empty((4, 2, rows), np.uint32)
    extent = np.empty((4, 2), np.int64)
    starts, ends = np.empty(4, np.uint32), np.empty(4, np.uint32)
    active, pixels = np.empty(4, np.int64), np.empty((2, MAX_CORNERS))
    rotation, hip, quad = np.empty((3, 3)), np.empty(3), np.empty((4, 3))
    upper, fore, origin = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    _torso_pose(torso, place, view, rotation, hip)
    for i in range(postures.shape[0]):
        _put_arm(
            postures[i],
            side,
            rotation,
            hip,
            sizes,
            view,
            0,
            upper,
            fore,
            origin,
            quad,
            pixels,
            spans,
            extent,
            rows,
            width,
        )
        costs[i] = base + _sum_union(spans, extent, 4, covered, starts, ends, active)[0]


@_compile
def full_costs(
    postures: Any, sizes: Any, place: Any, view: Any, table: Any, total: int, costs: Any, areas: Any
) -> None:
    """Costs and drawn areas (N,) of whole postures (N, 12)."""
    rows, width = table.shape[0], table.shape[1] - 1
    spans = np.empty((15, 2, rows), np.uint32)
    extent = np.empty((15, 2), np.int64)
    starts, ends = np.empty(15, np.uint32), np.empty(15, np.uint32)
    active, pixels = np.empty(15, np.int64), np.empty((2, MAX_CORNERS))
    rotation, hip, quad = np.empty((3, 3)), np.empty(3), np.empty((4, 3))
    upper, fore, origin = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for i in range(postures.shape[0]):
        _torso_pose(postures[i], place, view, rotation, hip)
        _put_trunk(rotation, hip, sizes, view, quad, pixels, spans, extent, rows, width)
        for arm in range(2):
            _put_arm(
                postures[i, 4 + 4 * arm : 8 + 4 * arm],
                1.0 - 2.0 * arm,
                rotation,
                hip,
                sizes,
                view,
                7 + 4 * arm,
                upper,
                fore,
                origin,
                quad,
                pixels,
                spans,
                extent,
                rows,
                width,
            )
        gain, area = _sum_union(spans, extent, 15, table, starts, ends, active)
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
def polygon_costs(corners: Any, view: Any, table: Any, total: int, costs: Any) -> None:
    """Costs (N,) of any quadrilaterals (N, K, 4, 3) of the optical frame, such as a box model's."""
    rows, width = table.shape[0], table.shape[1] - 1
    count = corners.shape[1]
    spans = np.empty((count, 2, rows), np.uint32)
    extent = np.empty((count, 2), np.int64)
    starts, ends = np.empty(count, np.uint32), np.empty(count, np.uint32)
    active, pixels = np.empty(count, np.int64), np.empty((2, MAX_CORNERS))
    for i in range(corners.shape[0]):
        for k in range(count):
            _put_quad(corners[i, k], pixels, view, k, spans, extent, rows, width)
        costs[i] = total + _sum_union(spans, extent, count, table, starts, ends, active)[0]


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
