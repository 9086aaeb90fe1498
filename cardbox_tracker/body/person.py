"""Sizes of a person: the 18 sizes of the cardbox model, independent of place and camera."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from cardbox_tracker.body.ranges import check_range
from cardbox_tracker.body.sizes import (
    DEFAULT_SIZES,
    N_SIZES,
    SIZE_INDEX,
    SIZE_NAMES,
    SIZES,
    FloatArray,
)
from cardbox_tracker.errors import BodyModelError


@dataclass(frozen=True, eq=False)
class Person:
    """Sizes of one person, independent of place and camera.

    Attributes:
        sizes: shape (18,), metres, ordered as ``SIZE_NAMES``; kept read-only.

    Raises:
        BodyModelError: a size is not finite or outside of its range; the text names it.
    """

    sizes: FloatArray = field(default_factory=lambda: DEFAULT_SIZES.copy())

    def __post_init__(self) -> None:
        """Check every size and freeze a copy of the vector."""
        sizes = np.array(self.sizes, dtype=np.float64)
        if sizes.shape != (N_SIZES,):
            raise BodyModelError(f"sizes has shape {sizes.shape}; expected ({N_SIZES},)")
        for size, value in zip(SIZES, sizes, strict=True):
            check_range(size.name, float(value), size.minimum_m, size.maximum_m, "m")
        sizes.setflags(write=False)
        object.__setattr__(self, "sizes", sizes)

    def size(self, name: str) -> float:
        """Return the size of that name in metres."""
        return float(self.sizes[SIZE_INDEX[name]])

    def __eq__(self, other: object) -> bool:
        """Return whether all sizes are equal."""
        if not isinstance(other, Person):
            return NotImplemented
        return np.array_equal(self.sizes, other.sizes)

    def __hash__(self) -> int:
        """Return a hash of all sizes."""
        return hash(self.sizes.tobytes())

    def __str__(self) -> str:
        """Return a line per size, in centimetres."""
        return "\n".join(
            f"{name:20s} {100 * value:6.1f} cm"
            for name, value in zip(SIZE_NAMES, self.sizes, strict=True)
        )
