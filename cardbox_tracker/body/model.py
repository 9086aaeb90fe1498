"""A measured person: the 18 sizes and the constants of position (paper, section II-A)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from cardbox_tracker.body.posture import SIDE_TURNS
from cardbox_tracker.body.sizes import (
    DEFAULT_SIZES,
    N_SIZES,
    SIZE_INDEX,
    SIZE_NAMES,
    SIZES,
    FloatArray,
)
from cardbox_tracker.errors import BodyModelError

# name: (lowest, highest, unit, meaning)
CONSTANTS = {
    "distance_m": (0.3, 20.0, "m", "level distance from the camera to the middle of the hips"),
    "hip_height_m": (-5.0, 5.0, "m", "height of the middle of the hips above the camera's centre"),
    "lateral_m": (-5.0, 5.0, "m", "torso_y in the front reference posture"),
    "camera_pitch_rad": (-1.4, 1.4, "rad", "how far the camera looks down"),
}


@dataclass(frozen=True)
class BodyModel:
    """One person before one camera; everything of it that tracking keeps constant.

    Attributes:
        sizes: shape (18,), metres, ordered as ``SIZE_NAMES``; kept read-only.
        distance_m: level distance from the camera to mid-hip.
        hip_height_m: height of mid-hip above the camera's centre (usually negative).
        lateral_m: ``torso_y`` in the front reference posture, where tracking starts.
        camera_pitch_rad: how far the camera looks down.
        side_turn: the way the person turned for the side reference, ``left`` or ``right``.

    Raises:
        BodyModelError: a value is not finite or absurd; the text names it and its range.
    """

    sizes: FloatArray = field(default_factory=lambda: DEFAULT_SIZES.copy())
    distance_m: float = 2.0
    hip_height_m: float = -0.5
    lateral_m: float = 0.0
    camera_pitch_rad: float = 0.0
    side_turn: str = "left"

    def __post_init__(self) -> None:
        """Check every value and freeze the size vector."""
        sizes = np.array(self.sizes, dtype=np.float64)
        if sizes.shape != (N_SIZES,):
            raise BodyModelError(f"sizes has shape {sizes.shape}; expected ({N_SIZES},)")
        for size, value in zip(SIZES, sizes, strict=True):
            _check_range(size.name, float(value), size.minimum_m, size.maximum_m, "m")
        for name, (lowest, highest, unit, _) in CONSTANTS.items():
            _check_range(name, getattr(self, name), lowest, highest, unit)
        if self.side_turn not in SIDE_TURNS:
            raise BodyModelError(f"side_turn is {self.side_turn!r}; expected one of {SIDE_TURNS}")
        sizes.setflags(write=False)
        object.__setattr__(self, "sizes", sizes)

    def size(self, name: str) -> float:
        """Return the size of that name in metres."""
        return float(self.sizes[SIZE_INDEX[name]])

    def __eq__(self, other: object) -> bool:
        """Two models are equal when every number is."""
        if not isinstance(other, BodyModel):
            return NotImplemented
        return np.array_equal(self.sizes, other.sizes) and all(
            getattr(self, name) == getattr(other, name) for name in (*CONSTANTS, "side_turn")
        )

    def __hash__(self) -> int:
        """Hash of every number, in step with equality."""
        return hash((self.sizes.tobytes(), *(getattr(self, n) for n in (*CONSTANTS, "side_turn"))))

    def __str__(self) -> str:
        """Return one line a size, in centimetres."""
        return "\n".join(
            f"{name:20s} {100 * value:6.1f} cm"
            for name, value in zip(SIZE_NAMES, self.sizes, strict=True)
        )


def _check_range(name: str, value: float, lowest: float, highest: float, unit: str) -> None:
    if not np.isfinite(value):
        raise BodyModelError(f"{name} is {value}; expected a finite number of {unit}")
    if not lowest <= value <= highest:
        hint = ""
        if unit == "m" and lowest <= value / 100 <= highest and value > 1:
            hint = " (is it given in centimetres?)"
        elif unit == "m" and lowest <= value / 1000 <= highest and value > 10:
            hint = " (is it given in millimetres?)"
        raise BodyModelError(
            f"{name} is {value:g} {unit}; expected {lowest:g} to {highest:g} {unit}{hint}"
        )
