"""How much later one camera shows the motion of a person than another, by its cross-correlation.

Heights about the baseline of two cameras, of joints or of the top of a silhouette, are the same in
both images at one time, whatever the person does. Where images of different moments are paired,
they agree best after a shift in time. Those of different people, or of times that are far apart, do
not agree after any: the largest concordance (Lin, "A concordance correlation coefficient to
evaluate reproducibility", 1989) is small.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from cardbox_tracker.common.health import WATCHES, Verdict
from cardbox_tracker.person.sizes import FloatArray

# Time whose motion is compared, between two comparisons, and the largest lag that is looked for.
_WINDOW_NS, _EVERY_NS, _MOST_NS = 2_000_000_000, 200_000_000, 500_000_000
# Least correlation at a lag, and how much larger it is than without; fewest pairs of heights.
# Slow motions correlate at any lag, and so does what moves the top less than a pixel, rad.
_LEAST, _MORE, _FEWEST, _STILL_RAD = 0.9, 0.1, 10, np.radians(0.1)
# Deviation of the heights of joints that is motion, rad; time after which it is first compared.
_MOTION_RAD, _SHORTEST_NS = np.radians(1.0), 600_000_000


class MotionLag:
    """Compares the motion in two cameras' images of the last seconds.

    Attributes:
        verdict: the lag, s. Its median is positive if the second camera is late. A lag of one image
            is none, since cameras that are not synchronized are paired within an image.
        concordance: the largest one of joints that move.
        is_suspected: whether that is too small in the first images, which are too few to tell it.
    """

    def __init__(self) -> None:
        """Begin without images."""
        self.verdict, self.concordance = Verdict("late", abs), Verdict("other motion")
        self.is_suspected = False
        self._seen = deque[tuple[int, FloatArray, FloatArray]]()
        self._due_ns = 0

    def add(self, stamp_ns: int, here: FloatArray, there: FloatArray) -> None:
        """Add heights (n,) in both cameras' images of one time, in the same order; nan if unknown.

        The last one is that of the top, the others are those of joints. Times that go back begin
        anew.
        """
        seen = self._seen
        if seen and stamp_ns <= seen[-1][0]:
            seen.clear()
            self._due_ns = 0
        seen.append((stamp_ns, here, there))
        while (span_ns := stamp_ns - seen[0][0]) > _WINDOW_NS:
            seen.popleft()
        if stamp_ns < self._due_ns or span_ns < _SHORTEST_NS:
            return
        self._due_ns = stamp_ns + _EVERY_NS
        _, *both = zip(*seen, strict=True)
        first, other = map(np.array, both)
        period_ns = span_ns / (len(seen) - 1)
        most = round(min(_MOST_NS, span_ns / 4) / period_ns)
        alike = _concordance(first[:, :-1], other[:, :-1], most)
        is_whole = span_ns >= 0.9 * _WINDOW_NS
        is_other = alike is not None and WATCHES["other motion"].is_beyond(alike)
        self.is_suspected = is_other and not is_whole
        if not is_whole:
            return
        if alike is not None:
            self.concordance.see(alike)
        lag = lag_of(first, other, most)
        if lag is not None:
            self.verdict.see(lag * period_ns / 1e9 if abs(lag) > 1 else 0.0)

    def remark(self, name: str) -> str:
        """Return a warning that a camera of this name is late or early; empty if it is not."""
        is_late = any(lag_s > 0.0 for lag_s in self.verdict.medians)
        return self.verdict.remark(name=name, than="later" if is_late else "earlier")


def lag_of(here: FloatArray, there: FloatArray, most: int) -> int | None:
    """Return by how many images the second series (N, n) is late; None if no motion shows it."""
    alike = {lag: _correlation(here, there, lag) for lag in range(-most, most + 1)}
    best = max(alike, key=lambda lag: alike[lag])
    is_clear = alike[best] > _LEAST and (best == 0 or alike[best] > alike[0] + _MORE)
    return best if is_clear else None


def _concordance(here: FloatArray, there: FloatArray, most: int) -> float | None:
    """Return the largest concordance of two series (N, n); None if hardly anything moves."""
    found = list[float]()
    for lag in range(-most, most + 1):
        one, two, count = _moved(here, there, lag)
        power = [float(np.sum(series**2)) for series in (one, two)]
        if count >= _FEWEST and max(power) > count * _MOTION_RAD**2:
            found.append(2.0 * float(np.sum(one * two)) / sum(power))
    return max(found, default=None)


def _correlation(here: FloatArray, there: FloatArray, lag: int) -> float:
    one, two, count = _moved(here, there, lag)
    powers = [float(np.linalg.norm(series)) for series in (one, two)]
    if count < _FEWEST or min(powers) < _STILL_RAD * np.sqrt(count):
        return -1.0
    return float(np.sum(one * two)) / (powers[0] * powers[1])


def _moved(here: FloatArray, there: FloatArray, lag: int) -> tuple[FloatArray, FloatArray, int]:
    """Return both series less their means, 0 where one is unknown, and how many are known."""
    end = len(here) - abs(lag)
    one, two = here[max(-lag, 0) :][:end], there[max(lag, 0) :][:end]
    known = np.isfinite(one) & np.isfinite(two)
    moved = []
    for series in (one, two):
        of = np.where(known, series, 0.0)
        of -= known * (of.sum(axis=0) / np.maximum(known.sum(axis=0), 1))
        moved.append(of)
    return moved[0], moved[1], int(np.count_nonzero(known))
