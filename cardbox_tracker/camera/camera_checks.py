"""Checks of intrinsic matrix and distortion of a calibration, and the usual form of the latter."""

from __future__ import annotations

from numbers import Real
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cardbox_tracker.common.errors import CameraError, quoted

FloatArray = NDArray[np.float64]

DISTORTION_MODELS = ("plumb_bob", "rational_polynomial", "equidistant")

_OTHER_NAMES = MappingProxyType(
    {
        "": "plumb_bob",
        "plumb bob": "plumb_bob",
        "radtan": "plumb_bob",
        "radial tangential": "plumb_bob",
        "brown conrady": "plumb_bob",
        "opencv": "plumb_bob",
        "rational polynomial": "rational_polynomial",
        "rational": "rational_polynomial",
        "fisheye": "equidistant",
        "opencv fisheye": "equidistant",
        "kannala brandt": "equidistant",
        "kannala brandt4": "equidistant",
    }
)
_COUNTS = MappingProxyType(
    {
        # k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tx ty of OpenCV, of which plumb_bob is the beginning.
        "plumb_bob": (5, 8, 12, 14),
        "rational_polynomial": (5, 8, 12, 14),
        "equidistant": (4,),
    }
)


def normal_lens(model: str, coefficients: FloatArray) -> tuple[str, FloatArray]:
    """Return the usual name of a distortion model, and as many coefficients (n,) as it needs.

    Coefficients that are missing or zero at the end make no difference. A ``plumb_bob`` with more
    than five is a ``rational_polynomial``. What is unknown stays as it is.
    """
    values = np.asarray(coefficients, np.float64).ravel()
    plain = model.strip().lower().replace("_", " ").replace("-", " ")
    model = _OTHER_NAMES.get(plain, plain if plain in _COUNTS else model)
    used = int(np.max(np.nonzero(values != 0)[0], initial=-1)) + 1
    count = next((count for count in _COUNTS.get(model, ()) if count >= used), None)
    # Of three coefficients, the third may be p1 or k3.
    if count is None or (model != "equidistant" and used == len(values) == 3):
        return model, values
    if model != "equidistant":
        model = "plumb_bob" if count == 5 else "rational_polynomial"
    return model, np.pad(values[:used], (0, count - used))


def lens_problem(model: str, coefficients: FloatArray) -> str:
    """Return the problem of a lens of :func:`normal_lens`; empty if there is none."""
    if len(coefficients) in _COUNTS.get(model, ()):
        return ""
    expected = "4" if model == "equidistant" else "4 or 5, or OpenCV's 8, 12 or 14"
    return (
        f"distortion model '{model}' has {len(coefficients)} coefficients; expected {expected}: "
        "calibrate with the model that the coefficients are of"
    )


# Limits of the focal length as multiples of the image's width: fields of view from 177 degrees down
# to a twentieth of a degree.
_SHORTEST, _LONGEST = 0.02, 1000.0
# The principal point lies outside the image if a driver crops a region of interest.
_FARTHEST = 100.0
# What rounding may leave below its diagonal.
_ROUNDED = 1e-6
# Beyond it, a number cannot be the side of an image.
_MOST = 1e9


def matrix_problem(k: NDArray[Any], width: int, height: int) -> str:
    """Return the problem of a matrix K (3, 3) for an image size, px, as "is all zero"; or ""."""
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
    if np.abs(values[[1, 2, 2], [0, 0, 1]]).max() > _ROUNDED:
        return f"has numbers below its diagonal ({_shown(values)}), as if it were transposed"
    return ""


def whole_pixels(name: str, value: object) -> int:
    """Return a camera's ``width`` or ``height``, px, as ``int``, or raise CameraError."""
    number = real_number(name, value)
    if not abs(number) < _MOST or number % 1 != 0:
        raise CameraError(
            f"the camera's {name} is {quoted(value)}; expected a whole number of px, at most "
            f"{_MOST:.0e}: give the size of the silhouettes"
        )
    return int(number)


def real_number(name: str, value: object) -> float:
    """Return one of a camera's other values as ``float``, or raise CameraError."""
    try:
        if isinstance(value, Real):
            return float(value)
    except OverflowError:
        pass
    raise CameraError(f"the camera's {name} is {quoted(value)}; expected a number")


def numbers_of(name: str, given: ArrayLike, shape: tuple[int, ...] | None = None) -> FloatArray:
    """Return numbers of a camera as an array, by default of any shape, or raise CameraError."""
    try:
        values = np.asarray(given, np.float64)
    except Exception:  # of what programs give
        values = None
    if values is None or (shape is not None and values.shape != shape):
        expected = "numbers" if shape is None else f"numbers of the shape {shape}"
        raise CameraError(f"the camera's {name} is {quoted(given)}; expected {expected}")
    return values


def distortion_problem(distortion: NDArray[Any]) -> str:
    """Return the problem of distortion coefficients (n,); empty if there is none."""
    values = np.asarray(distortion, dtype=np.float64)
    if np.isfinite(values).all():
        return ""
    return f"have values that are not finite numbers ({_shown(values)})"


def _shown(values: NDArray[np.float64]) -> str:
    return ", ".join(f"{value:g}" for value in values.ravel().tolist())
