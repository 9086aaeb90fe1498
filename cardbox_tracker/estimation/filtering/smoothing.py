"""Corrections smoothed over time: what they have in common from image to image counts."""

from __future__ import annotations

from cardbox_tracker.body.sizes import FloatArray


class Smoothed:
    """Exponential moving average of arrays of one shape."""

    def __init__(self, kept: float) -> None:
        """Begin without a value; ``kept`` is the share of the last average in the next one."""
        self._kept = kept
        self.forget()

    def forget(self) -> None:
        """Begin anew: the next value is taken as it is."""
        self._average: FloatArray | None = None

    def __call__(self, value: FloatArray) -> FloatArray:
        """Return the average with this value in it."""
        before = value if self._average is None else self._average
        self._average = self._kept * before + (1.0 - self._kept) * value
        return self._average
