"""First-order low-pass filter."""

from __future__ import annotations

from math import exp

from cardbox_tracker.person.sizes import FloatArray

_MOST_KEPT = 0.5
"""Share of the last output that delays a ramp by one interval."""


class LowPass:
    """First-order low-pass filter (exponential smoothing) over time.

    The output is y = a y_before + (1 - a) x with a = exp(-dt / time constant), but at most 1/2, for
    inputs x at intervals dt. A ramp is delayed by dt a / (1 - a): slightly less than the time
    constant, and never more than one interval.
    """

    def __init__(self, time_constant_s: float) -> None:
        """Begin without a value; with a time constant of 0 the output is the input."""
        self._time_constant_s = time_constant_s
        self.forget()

    def forget(self) -> None:
        """Forget the last output; the next output is the input."""
        self._last: FloatArray | None = None

    def __call__(self, values: FloatArray, interval_s: float) -> FloatArray:
        """Return the filtered values, of any shape, ``interval_s`` after the previous ones."""
        if self._time_constant_s == 0.0:
            return values
        if self._last is not None:
            kept = min(exp(-max(interval_s, 0.0) / self._time_constant_s), _MOST_KEPT)
            values = kept * self._last + (1.0 - kept) * values
        self._last = values
        return values
