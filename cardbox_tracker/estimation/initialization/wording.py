"""Numbers in texts: one that misses a bound is never rounded to the bound."""

from __future__ import annotations

import math

# What floating-point numbers are off by.
_TINY = 1e-9


def rounded_down(value: float, digits: int = 2) -> str:
    """Return a number that is too low, such as 0.598 of 0.60 as 0.59."""
    unit = 10**digits
    return f"{math.floor(value * unit + _TINY) / unit:.{digits}f}"


def rounded_up(value: float, digits: int = 2) -> str:
    """Return a number that is too high, such as 0.801 of 0.80 as 0.81."""
    unit = 10**digits
    return f"{math.ceil(value * unit - _TINY) / unit:.{digits}f}"
