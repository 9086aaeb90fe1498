"""Checks of the reference silhouettes, and the person's lateral place in them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.person.posture import REFERENCE_NAMES

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


Silhouette = NDArray[np.uint8]

COARSE_PX = 80
"""Columns of images in which many outlines are compared, or where a person is expected."""

MIN_PERSON_FRACTION = 0.02
"""Least fraction of the image that is covered by a person near enough to be measured."""

MAX_PERSON_FRACTION = 0.6
"""Largest fraction of foreground; beyond it the light or the background has changed."""

MAX_LIKENESS = 0.80
"""Largest IoU of two different reference postures after their alignment."""

POSTURE_TEXT = {
    "front": "face the camera, arms 20 degrees away from the body",
    "side": "turn by 90 degrees, arms as before",
    "arms": "face the camera, both arms stretched sideways, hands open",
}
"""Instruction for each reference."""


def average_silhouette(silhouettes: Sequence[Silhouette]) -> Silhouette:
    """Return the majority (H, W) of silhouettes; raise InitializationError if there are none."""
    if not silhouettes:
        raise InitializationError(
            "no silhouette was captured; check the times, or that the background node runs"
        )
    votes = np.sum([silhouette > 0 for silhouette in silhouettes], axis=0)
    return np.where(2 * votes > len(silhouettes), 255, 0).astype(np.uint8)


def check_reference(name: str, silhouette: Silhouette) -> None:
    """Raise InitializationError if a silhouette (H, W) cannot show the posture ``name``."""
    if name not in REFERENCE_NAMES:
        raise ValueError(f"reference {name!r} is unknown; it is one of {REFERENCE_NAMES}")
    share = np.count_nonzero(silhouette) / silhouette.size
    if share < MIN_PERSON_FRACTION:
        raise InitializationError(
            f"reference '{name}': nobody is in the image ({rounded_down(100 * share, 1)} % "
            f"foreground, expected {100 * MIN_PERSON_FRACTION:.0f} % or more); step in front of "
            f"the camera and {POSTURE_TEXT[name]}",
            "Step into the picture",
        )
    if share > MAX_PERSON_FRACTION:
        raise InitializationError(
            f"reference '{name}': {rounded_up(100 * share, 0)} % of the image is foreground, "
            f"expected at most {100 * MAX_PERSON_FRACTION:.0f} %; the background was learned in "
            "another light or with a person in the image: leave the image and learn it again "
            "(background/learn)",
            "Step out of the picture",
        )
    for border, pixels in (
        ("left", silhouette[:, 0]),
        ("right", silhouette[:, -1]),
        ("upper", silhouette[0]),
    ):
        if np.any(pixels):
            raise InitializationError(
                f"reference '{name}': the person is cut off at the {border} border of the "
                f"image; step back or to the middle, and {POSTURE_TEXT[name]}",
                "Step back, please",
            )


def check_references(references: Mapping[str, Silhouette]) -> None:
    """Raise InitializationError if silhouettes are missing, of several sizes, or of one posture."""
    missing = [name for name in REFERENCE_NAMES if name not in references]
    if missing:
        raise InitializationError(f"missing references: {', '.join(missing)}; capture them first")
    sizes = {references[name].shape for name in REFERENCE_NAMES}
    if len(sizes) > 1:
        raise InitializationError(
            f"the references have different sizes {sorted(sizes)}; capture all with one camera"
        )
    for name in REFERENCE_NAMES:
        check_reference(name, references[name])
    for name in ("side", "arms"):
        likeness = aligned_iou(references["front"], references[name])
        if likeness > MAX_LIKENESS:
            action = "the person did not turn" if name == "side" else "the arms were not raised"
            raise InitializationError(
                f"references 'front' and '{name}' are too alike (IoU {rounded_up(likeness)}, "
                f"expected below {MAX_LIKENESS:.2f}): {action}; capture '{name}' again: "
                f"{POSTURE_TEXT[name]}"
            )


def aligned_iou(first: Silhouette, second: Silhouette) -> float:
    """Return the IoU of two silhouettes after horizontal alignment."""
    shift = round(_middle_column(first) - _middle_column(second))
    moved = np.zeros_like(second)
    width = second.shape[1]
    moved[:, max(0, shift) : width + min(0, shift)] = second[
        :, max(0, -shift) : width - max(0, shift)
    ]
    union = np.count_nonzero(first | moved)
    return np.count_nonzero(first & moved) / union if union else 0.0


def _middle_column(silhouette: Silhouette) -> float:
    return float(np.mean(np.nonzero(silhouette)[1]))


def lateral_m(silhouette: Silhouette, camera: Camera, distance_m: float) -> float:
    """Return ``torso_y`` of the middle of a silhouette's head and chest, metres."""
    rows = np.nonzero(np.any(silhouette, axis=1))[0]
    upper = silhouette[rows[0] : rows[0] + max(1, (rows[-1] - rows[0]) // 3)]
    columns = np.count_nonzero(upper, axis=0).cumsum()
    middle = float(np.searchsorted(columns, columns[-1] / 2))
    return (middle - camera.cx) / camera.fx * distance_m
