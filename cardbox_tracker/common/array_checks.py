"""The check of arrays before they are given to compiled code, which reads without bounds."""

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
    if isinstance(array, np.ndarray) and array.dtype == kind:
        # The common case is kept short, since several arrays of each image are checked.
        flags = array.flags
        is_sound = flags.c_contiguous and flags.aligned and (flags.writeable or not is_written)
        if is_sound and (array.shape == shape or _fits(array.shape, shape)):
            return
    _refuse(name, array, shape, kind)


def _fits(found: tuple[int, ...], shape: tuple[int, ...]) -> bool:
    # Usually all lengths are fixed, or all are free.
    return len(found) == len(shape) and (
        max(shape, default=ANY) == ANY
        or all(one in (length, ANY) for length, one in zip(found, shape, strict=True))
    )


def _refuse(name: str, array: object, shape: tuple[int, ...], kind: type[np.generic]) -> None:
    """Raise the error that names the fault of an array."""
    if not isinstance(array, np.ndarray):
        raise ValueError(f"{name} is of the type {type(array).__name__}; expected an array")
    if not _fits(array.shape, shape) or array.dtype != kind:
        expected = ", ".join("any" if length == ANY else str(length) for length in shape)
        raise ValueError(
            f"{name} has the shape {array.shape} and the type {array.dtype}; expected ({expected}) "
            f"of {np.dtype(kind)}"
        )
    if not (array.flags.c_contiguous and array.flags.aligned):
        raise ValueError(f"{name} is not contiguous; give np.ascontiguousarray({name})")
    raise ValueError(f"{name} is read-only; give a copy")
