"""The check of arrays before they are given to compiled code.

Code without bounds checks reads and writes beyond an array whose shape is not the expected one.
"""

from __future__ import annotations

import numpy as np

ANY = -1
"""Any number of rows, columns or planes."""


def check_array(
    name: str,
    array: object,
    shape: tuple[int, ...],
    kind: type[np.generic] = np.uint8,
    is_written: bool = False,
) -> None:
    """Refuse an array that a kernel would read or write beyond its end.

    Args:
        name: name of the array in the error.
        array: the array.
        shape: its expected shape, with ``ANY`` for any length.
        kind: its expected type.
        is_written: whether the kernel writes to it.

    Raises:
        ValueError: it is no array, its shape or type is another one, or its elements do not follow
            each other in memory, for which numba would compile another version.
    """
    if not isinstance(array, np.ndarray):
        raise ValueError(f"{name} is of the type {type(array).__name__}; expected an array")
    fits = array.ndim == len(shape) and all(
        length in (found, ANY) for length, found in zip(shape, array.shape, strict=True)
    )
    if not fits or array.dtype != kind:
        expected = ", ".join("any" if length == ANY else str(length) for length in shape)
        raise ValueError(
            f"{name} has the shape {array.shape} and the type {array.dtype}; expected ({expected}) "
            f"of {np.dtype(kind)}"
        )
    if not (array.flags.c_contiguous and array.flags.aligned):
        raise ValueError(f"{name} is not contiguous; give np.ascontiguousarray({name})")
    if is_written and not array.flags.writeable:
        raise ValueError(f"{name} is read-only; give a copy")
