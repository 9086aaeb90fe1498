"""Rounding of numbers in texts, so that a number below a bound never shows as the bound."""

from __future__ import annotations

import math

# Tolerance of floating-point errors.
_TINY = 1e-9


def rounded_down(value: float, digits: int = 2) -> str:
    """Return a number rounded down, for values below a bound."""
    unit = 10**digits
    return f"{math.floor(value * unit + _TINY) / unit:.{digits}f}"


def rounded_up(value: float, digits: int = 2) -> str:
    """Return a number rounded up, for values above a bound."""
    unit = 10**digits
    return f"{math.ceil(value * unit - _TINY) / unit:.{digits}f}"
