"""Compiled sums of (1 - 2 f) over pixels under any patch, S(v, b) - S(v, a) of each run."""

from __future__ import annotations

from typing import Any

import numpy as np

from cardbox_tracker.common.compiling import inlined_kernel, kernel
from cardbox_tracker.terms.kernel_arguments import Counts, Whole
from cardbox_tracker.terms.rasterisation import Workspace
from cardbox_tracker.terms.row_sums import RowSums

# With an unsigned index, numba compiles no code for negative indices.
_index = np.uint64
_Index = int | np.integer[Any]


@inlined_kernel
def _insert(runs: Whole, n: int, start: np.int32, end: np.int32) -> None:
    """Insert a run into the first ``n`` runs, which are ordered by start."""
    i = n
    while i > 0 and runs[0, i - 1] > start:
        runs[0, i] = runs[0, i - 1]
        runs[1, i] = runs[1, i - 1]
        i -= 1
    runs[0, i] = start
    runs[1, i] = end


@inlined_kernel
def _run(sides: Whole, p: _Index, row: _Index) -> tuple[np.int32, np.int32]:
    """Return first and end column of a patch in a row."""
    a, b = sides[p, 0, row], sides[p, 1, row]
    return min(a, b), max(a, b)


@inlined_kernel
def _gain(row_sums: RowSums, row: _Index, start: _Index, end: _Index) -> np.int64:
    """Return the sum of (1 - 2 f) over a run of a row: S(row, end) - S(row, start)."""
    return np.int64(row_sums[row, _index(end)]) - np.int64(row_sums[row, _index(start)])


@kernel
def _join(
    sides: Whole, one: np.uint64, other: np.uint64, first: np.uint64, count: int, joined: Whole
) -> np.int32:
    """Write joined runs of two patches to ``joined``; return a value > 0 if there is a gap."""
    gap = np.int32(0)
    for i in range(count):
        row = first + _index(i)
        begin, stop = _run(sides, one, row)
        start, end = _run(sides, other, row)
        gap = max(gap, np.int32(max(begin, start) - min(stop, end)))
        joined[0, _index(i)] = min(begin, start)
        joined[1, _index(i)] = max(stop, end)
    return gap


@inlined_kernel
def _packed(sides: Whole, p: _Index, row: _Index) -> np.uint64:
    """Return a run as one number that orders runs by their start."""
    start, end = _run(sides, p, row)
    return (_index(start) << _index(32)) | _index(end)


@kernel
def _sum_four(
    sides: Whole,
    patches: tuple[np.uint64, np.uint64, np.uint64, np.uint64],
    v: int,
    end_row: int,
    row_sums: RowSums,
) -> tuple[np.int64, np.int64]:
    """Return sum of (1 - 2 f) and area of the union of four patches, in rows that all four meet."""
    total = np.int64(0)
    area = np.int64(0)
    a, b, c, d = patches
    half, ends = _index(32), _index(0xFFFFFFFF)
    for row in range(_index(v), _index(end_row)):
        k, m = _packed(sides, a, row), _packed(sides, b, row)
        n, o = _packed(sides, c, row), _packed(sides, d, row)
        # A sorting network has no branches that are hard to predict.
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


@kernel
def _sum_many(
    sides: Whole,
    active: Counts,
    n: int,
    v: int,
    end_row: int,
    row_sums: RowSums,
    runs: Whole,
) -> tuple[np.int64, np.int64]:
    """Return sum of (1 - 2 f) and area of the union of ``n`` patches, in rows that all meet.

    The patches of one part are consecutive and overlap, so in most rows each run is joined to the
    previous one; other runs are sorted for a sweep.
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
                        _insert(runs, kept, begin, stop)
                        kept += 1
                    begin, stop = start, end
        if kept > 0:
            _insert(runs, kept, begin, stop)
            begin, stop = runs[0, 0], runs[1, 0]
            for i in range(1, kept + 1):
                if runs[0, i] <= stop:
                    stop = max(stop, runs[1, i])
                else:
                    total += _gain(row_sums, row, begin, stop)
                    area += np.int64(stop) - np.int64(begin)
                    begin, stop = runs[0, i], runs[1, i]
        total += _gain(row_sums, row, begin, stop)
        area += np.int64(stop) - np.int64(begin)
    return total, area


@inlined_kernel
def sum_union(work: Workspace, row_sums: RowSums) -> tuple[np.int64, np.int64]:
    """Return sum of (1 - 2 f) and area, px, of the union of all patches.

    The rows are divided into bands that meet the same patches, so that no row has to test all
    patches.
    """
    sides, extent, active, joined = work.sides, work.extent, work.active, work.joined
    rows, count = row_sums.shape[0], extent.shape[0]
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
            gain, covered = _sum_many(sides, active, n_active, v, band_end, row_sums, work.runs)
            total += gain
            area += covered
        elif n_active > 2:
            # A patch that is given twice has no effect.
            one, other = _index(active[0]), _index(active[1])
            third, fourth = _index(active[2]), _index(active[n_active - 1])
            gain, covered = _sum_four(sides, (one, other, third, fourth), v, band_end, row_sums)
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
                # The patches are apart in some row, and the gap does not count.
                for between in range(_index(v), _index(band_end)):
                    begin, stop = _run(sides, one, between)
                    start, end = _run(sides, other, between)
                    left = min(stop, end)
                    right = max(left, max(begin, start))
                    total -= _gain(row_sums, between, left, right)
                    area -= np.int64(right) - np.int64(left)
        v = band_end
    return total, area


@kernel
def cover_patches(sides: Whole, extent: Counts, row_sums: RowSums, covered: RowSums) -> int:
    """Write the row sums without the pixels under the patches; return their sum of (1 - 2 f).

    They are constant over a run, and behind it they are lower by the sum of the run.
    """
    rows, columns = row_sums.shape
    last = _index(columns - 1)
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
    total = 0
    for v in range(_index(rows)):
        total += int(row_sums[v, last]) - int(covered[v, last])
    return total
