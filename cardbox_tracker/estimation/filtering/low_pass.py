"""First-order low-pass filter."""

from __future__ import annotations

from math import exp

from cardbox_tracker.body.sizes import FloatArray


class LowPass:
    """First-order low-pass filter (exponential smoothing) over time.

    y = a y_before + (1 - a) x with a = exp(-dt / time constant) for values x that are dt apart. A
    ramp comes out dt a / (1 - a) later, a little less than the time constant.
    """

    def __init__(self, time_constant_s: float) -> None:
        """Begin; a time constant of 0 changes nothing."""
        self._time_constant_s = time_constant_s
        self.forget()

    def forget(self) -> None:
        """Begin anew: the next value is taken as it is."""
        self._last: FloatArray | None = None

    def __call__(self, values: FloatArray, interval_s: float) -> FloatArray:
        """Return the filtered values, of any shape, ``interval_s`` after those before."""
        if self._time_constant_s == 0.0:
            return values
        if self._last is not None:
            kept = exp(-max(interval_s, 0.0) / self._time_constant_s)
            values = kept * self._last + (1.0 - kept) * values
        self._last = values
        return values
