"""Medians in compiled code, which counts in vector instructions instead of sorting.

The bits of numbers that are not negative are ordered as the numbers are. A bisection of the bits
finds the element of any rank, and it is exact.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.array_checks import ANY, check_array
from cardbox_tracker.common.compiling import inlined_kernel, kernel

_i32 = np.int32
LARGEST_BITS = np.int32(0x7FFFFFFF)
"""No number has larger bits."""
# Fewer elements than this share are copied, so that the rest of the search is short.
_FEW = 16


def median(values: NDArray[np.float32]) -> float:
    """Return the median, or mean of the middle two, of any shape, or raise ValueError."""
    flat = np.ascontiguousarray(values).reshape(-1)
    check_array("values", flat, (ANY,), np.float32)
    if not flat.size:
        raise ValueError("the median of no values does not exist")
    found = _middle(flat.view(np.int32)).view(np.float32)
    if not found[0] >= 0.0:
        raise ValueError("a value is negative or not a number; expected neither")
    return float(found.mean())


@kernel
def _middle(bits: Any) -> Any:
    """Return the bits of the middle two elements, or of the middle one twice; -1 if impossible."""
    count, result = len(bits), np.empty(2, np.int32)
    least = most = bits[0]
    for i in range(count):
        least, most = min(least, bits[i]), max(most, bits[i])
    if least < 0 or most > _i32(0x7F800000):
        result[:] = -1
        return result
    low, high, below = _i32(least - 1), most, 0
    # Between the limits are the elements of both ranks.
    first, second = (count - 1) // 2, count // 2
    inside = count
    while inside > count // _FEW and high - low > 1:
        middle = _i32(low + (high - low) // 2)
        number = count_up_to(bits, middle)
        if number > second:
            high, inside = middle, number - below
        elif number <= first:
            low, inside, below = middle, inside - (number - below), number
        else:
            break
    few = np.empty(inside, np.int32)
    number = 0
    for i in range(count):
        if low < bits[i] <= high:
            few[number] = bits[i]
            number += 1
    result[0] = element(few, first - below, low, high)
    result[1] = element(few, second - below, low, high)
    return result


@inlined_kernel
def element(bits: Any, rank: Any, low: Any, high: Any) -> Any:
    """Return the element of a rank, counted from 0, which is in ``(low, high]``."""
    while high - low > 1:
        middle = _i32(low + (high - low) // 2)
        if count_up_to(bits, middle) > rank:
            high = middle
        else:
            low = middle
    return high


@inlined_kernel
def count_up_to(bits: Any, limit: Any) -> Any:
    """Return the number of elements that are at most ``limit``."""
    count = _i32(0)
    for i in range(len(bits)):
        count += _i32(bits[i] <= limit)
    return count
