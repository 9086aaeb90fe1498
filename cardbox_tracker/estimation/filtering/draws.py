"""Random numbers drawn at once and handed out in pieces: a call costs more than the numbers."""

from __future__ import annotations

from cardbox_tracker.body.sizes import FloatArray


class Draws:
    """Hands out the numbers of one search."""

    def __init__(self, values: FloatArray) -> None:
        """Hand out ``values``, (N,)."""
        self._values, self._next = values, 0

    def take(self, rows: int, columns: int) -> FloatArray:
        """Return the next numbers as (rows, columns)."""
        start, self._next = self._next, self._next + rows * columns
        return self._values[start : self._next].reshape(rows, columns)
