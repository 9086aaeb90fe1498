"""Charts of the page as SVG: the score over time, and the shares of a part's scores."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.ergonomics.markup import Element, add, element
from cardbox_tracker.ergonomics.recording import LONGEST_STEP, RulaRow
from cardbox_tracker.ergonomics.tables import ACTION_LEVELS, HIGHEST
from cardbox_tracker.estimation.estimate import UNCERTAIN

ACTION_COLOURS = ("#d9ecd5", "#fdf1c4", "#fbd5ac", "#f2aaa0")
"""Backgrounds of the ``ACTION_LEVELS``."""
UNCERTAIN_COLOUR, NOTHING_COLOUR = "#e69f00", "#9a9a9a"
_LINE_COLOUR, _RANGE_COLOUR = "#1b4f8a", "#9db9da"
_LIGHTEST, _DARKEST = np.array([222, 235, 247]), np.array([8, 69, 148])

_WIDTH, _HEIGHT = 900, 250
_LEFT, _RIGHT, _TOP, _BOTTOM = 34, 890, 22, 200
_STRIP = (204, 8)
_TICKS = 10
_BAR_WIDTH, _BAR_HEIGHT = 240, 18
_LEAST_LABEL = 14


def timeline(rows: Sequence[RulaRow], moments: Sequence[RulaRow]) -> Element:
    """Return the expected grand score over the time of the recording.

    Up to one point a pixel is drawn: the mean, and the range where images differ. Numbers mark the
    ``moments`` in their order.

    Args:
        rows: one image each, in order; at least one.
        moments: the worst ones of them.
    """
    times_s = np.array([row.time_s for row in rows])
    begin_s, end_s = float(times_s[0]), max(float(times_s[-1]), float(times_s[0]) + 1e-3)
    svg = element("svg", viewBox=f"0 0 {_WIDTH} {_HEIGHT}", role="img", class_="timeline")
    add(svg, "title", "Expected RULA score over time")
    for (low, high, _), colour in zip(ACTION_LEVELS, ACTION_COLOURS, strict=True):
        top, bottom = _y(high + 0.5), _y(low - 0.5)
        _box(svg, _LEFT, top, _RIGHT - _LEFT, bottom - top, colour)
    for score in range(1, HIGHEST + 1):
        add(svg, "text", str(score), x=_LEFT - 8, y=f"{_y(score) + 4:.1f}", text_anchor="end")
    for time_s in _ticks(begin_s, end_s):
        at = f"{_x(time_s, begin_s, end_s):.1f}"
        add(svg, "path", d=f"M{at} {_BOTTOM}v18", stroke="#555")
        add(svg, "text", f"{time_s:g}", x=at, y=_BOTTOM + 31, text_anchor="middle")
    add(svg, "text", "seconds", x=_RIGHT, y=_HEIGHT - 4, text_anchor="end")
    x = np.array([_x(time_s, begin_s, end_s) for time_s in times_s.tolist()])
    _strip(svg, rows, x)
    for run in _runs(rows, times_s):
        _line(svg, x[run], np.array([_y(_mean(rows[number])) for number in run]))
    for number, row in enumerate(moments, 1):
        at, y = f"{_x(row.time_s, begin_s, end_s):.1f}", _y(_mean(row))
        add(svg, "circle", cx=at, cy=f"{y:.1f}", r=4, fill=_LINE_COLOUR)
        add(svg, "text", str(number), x=at, y=f"{y - 8:.1f}", text_anchor="middle")
    return svg


def share_bar(shares: FloatArray) -> Element:
    """Return one bar that is divided by the ``shares`` (n,) of the scores 1 to n, dark for high."""
    svg = element("svg", viewBox=f"0 0 {_BAR_WIDTH} {_BAR_HEIGHT}", class_="bar")
    svg.attrib |= {"width": str(_BAR_WIDTH), "height": str(_BAR_HEIGHT)}
    left = 0.0
    for score, share in enumerate(np.nan_to_num(shares).tolist(), 1):
        wide = share * _BAR_WIDTH
        if wide:
            depth = (score - 1) / max(1, len(shares) - 1)
            _box(svg, left, 0, wide, _BAR_HEIGHT, _shade(depth))
            if wide >= _LEAST_LABEL:
                ink = "#fff" if depth > 0.5 else "#000"
                at = f"{left + wide / 2:.1f}"
                add(svg, "text", str(score), fill=ink, x=at, y=13, text_anchor="middle")
        left += wide
    return svg


def _strip(svg: Element, rows: Sequence[RulaRow], x: FloatArray) -> None:
    """Mark below the axis where the posture may be wrong, or is missing."""
    top, high = _STRIP
    number = 0
    for colour, group in groupby(rows, _strip_colour):
        first, number = number, number + len(list(group))
        end = x[number] if number < len(x) else _RIGHT
        if colour:
            _box(svg, x[first], top, max(1.0, end - x[first]), high, colour)


def _strip_colour(row: RulaRow) -> str:
    if row.scores is None:
        return NOTHING_COLOUR
    return UNCERTAIN_COLOUR if row.state == UNCERTAIN else ""


def _runs(rows: Sequence[RulaRow], times_s: FloatArray) -> Iterator[NDArray[np.int64]]:
    """Yield the numbers of the images of each span without a gap."""
    scored = np.array([n for n, row in enumerate(rows) if row.scores is not None], np.int64)
    if not len(scored):
        return
    usual_s = float(np.median(np.diff(times_s))) if len(times_s) > 1 else 0.0
    is_gap = (np.diff(scored) > 1) | (np.diff(times_s[scored]) > LONGEST_STEP * usual_s)
    yield from np.split(scored, np.flatnonzero(is_gap) + 1)


def _line(svg: Element, x: FloatArray, y: FloatArray) -> None:
    columns = np.floor(x).astype(np.int64)
    begins = np.flatnonzero(np.diff(columns, prepend=columns[0] - 1))
    counts = np.diff(np.append(begins, len(x)))
    at, mean = np.add.reduceat(x, begins) / counts, np.add.reduceat(y, begins) / counts
    low, high = np.minimum.reduceat(y, begins), np.maximum.reduceat(y, begins)
    ranges = [
        f"M{one:.1f} {top:.1f}V{bottom:.1f}"
        for one, top, bottom in zip(at, low, high, strict=True)
        if bottom - top > 1.0
    ]
    if ranges:
        add(svg, "path", d="".join(ranges), stroke=_RANGE_COLOUR)
    points = " ".join(f"{one:.1f},{other:.1f}" for one, other in zip(at, mean, strict=True))
    line = add(svg, "polyline", points=points, fill="none", stroke=_LINE_COLOUR)
    line.attrib |= {"stroke-width": "1.6", "stroke-linecap": "round"}


def _ticks(begin_s: float, end_s: float) -> Iterator[float]:
    least = (end_s - begin_s) / _TICKS
    power = 10.0 ** np.floor(np.log10(least))
    step = next(power * factor for factor in (1, 2, 5, 10) if power * factor >= least)
    for number in range(int(np.ceil(begin_s / step)), int(np.floor(end_s / step)) + 1):
        yield round(float(number * step), 6)


def _mean(row: RulaRow) -> float:
    return float("nan") if row.scores is None else row.scores.mean


def _x(time_s: float, begin_s: float, end_s: float) -> float:
    return _LEFT + (time_s - begin_s) / (end_s - begin_s) * (_RIGHT - _LEFT)


def _y(score: float) -> float:
    return _BOTTOM - (score - 0.5) / HIGHEST * (_BOTTOM - _TOP)


def _box(svg: Element, left: float, top: float, width: float, height: float, colour: str) -> None:
    box = add(svg, "rect", x=f"{left:.1f}", y=f"{top:.1f}", fill=colour)
    box.attrib |= {"width": f"{width:.1f}", "height": f"{height:.1f}"}


def _shade(depth: float) -> str:
    red, green, blue = np.round(_LIGHTEST + depth * (_DARKEST - _LIGHTEST)).astype(int)
    return f"#{red:02x}{green:02x}{blue:02x}"
