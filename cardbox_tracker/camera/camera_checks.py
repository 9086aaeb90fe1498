"""Checks of the intrinsic matrix and the distortion coefficients of a calibration."""

from __future__ import annotations

from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.errors import CameraError, quoted

# Limits of the focal length as multiples of the image's width: fields of view from 177 degrees down
# to a twentieth of a degree.
_SHORTEST, _LONGEST = 0.02, 1000.0
# The principal point lies outside the image if a driver crops a region of interest.
_FARTHEST = 100.0
# Beyond it, a number cannot be the side of an image.
_MOST = 1e9


def matrix_problem(k: NDArray[Any], width: int, height: int) -> str:
    """Return the problem of a matrix K (3, 3) for images of a size in px; empty if there is none.

    The text continues a sentence whose subject is the matrix, such as "is all zero".
    """
    values = np.asarray(k, dtype=np.float64)
    if not values.any():
        return "is all zero"
    if not np.isfinite(values).all():
        return f"has values that are not finite numbers ({_shown(values)})"
    size = np.array([width, height])
    focal, center = np.array([values[0, 0], values[1, 1]]), np.array([values[0, 2], values[1, 2]])
    names = ("fx", "fy")
    for name, length, pixels in zip(names, focal.tolist(), size.tolist(), strict=True):
        if not _SHORTEST * pixels <= length <= _LONGEST * pixels:
            return (
                f"has the focal length {name} = {length:g} px; expected {_SHORTEST * pixels:g} to "
                f"{_LONGEST * pixels:g} px for images of {width}x{height}"
            )
    if (np.abs(center) > _FARTHEST * size).any():
        return (
            f"has its principal point at ({center[0]:g}, {center[1]:g}) px; expected it near the "
            f"image of {width}x{height}"
        )
    return ""


def whole_pixels(name: str, value: object) -> int:
    """Return a camera's ``width`` or ``height``, px, as ``int``.

    Raises:
        CameraError: the value is no whole number.
    """
    number = real_number(name, value)
    if not abs(number) < _MOST or number % 1 != 0:
        raise CameraError(
            f"the camera's {name} is {quoted(value)}; expected a whole number of px: give the size "
            "of the silhouettes"
        )
    return int(number)


def real_number(name: str, value: object) -> float:
    """Return one of a camera's other values as ``float``.

    Raises:
        CameraError: the value is no number, or too large for ``float``.
    """
    try:
        if isinstance(value, Real):
            return float(value)
    except OverflowError:
        pass
    raise CameraError(f"the camera's {name} is {quoted(value)}; expected a number")


def distortion_problem(distortion: NDArray[Any]) -> str:
    """Return the problem of distortion coefficients (n,); empty if there is none."""
    values = np.asarray(distortion, dtype=np.float64)
    if np.isfinite(values).all():
        return ""
    return f"have values that are not finite numbers ({_shown(values)})"


def _shown(values: NDArray[np.float64]) -> str:
    return ", ".join(f"{value:g}" for value in values.ravel().tolist())
