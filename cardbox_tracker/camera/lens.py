"""Names and coefficients of lens distortion, as drivers and calibration programs write them."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

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
