"""Arrays as people have them become the arrays that the core takes, or are refused in words.

Every public function that takes silhouettes, images or depth images passes them through this
module first, because compiled code does not check what it reads.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from cardbox_tracker.common.errors import reason_of

ImageArray = NDArray[np.uint8]
DepthImage = NDArray[np.float32]
Size = tuple[int, int]

_GREY_LIMIT = 127
_BRIGHTEST = 255
# Depth cameras measure less than this in metres, and more than this in millimetres.
_FARTHEST_M = 100.0


def silhouette_from(
    given: ArrayLike, name: str = "silhouette", size: Size | None = None
) -> ImageArray:
    """Return a mask (H, W) or (H, W, 1) of any numeric type as a silhouette (H, W), 0 or 255.

    If the largest value of the mask is at most 1, the person is where a value is 0.5 or more, as in
    masks of bool, of 0 and 1, and of probabilities. Otherwise, the person is where a value is 128
    or more. The silhouette is a C-contiguous copy.

    Raises ValueError, with the ``name``, if the height and width are not ``size``, or values are
    not numeric, negative, above 255 or nan.
    """
    mask = _array(given, name)
    if mask.ndim != 2 or not mask.size:
        raise ValueError(
            f"{name} has the shape {mask.shape}; expected {size or '(height, width)'}: give one "
            "person's mask, one value for each pixel"
        )
    _check_size(mask, name, size)
    if mask.dtype == np.bool_:
        return np.ascontiguousarray(mask).view(np.uint8) * np.uint8(_BRIGHTEST)
    highest = _check_range(mask, name, "bool, 0 and 1, or 0 and 255")
    if mask.dtype == np.uint8:
        limit = 0 if highest <= 1 else _GREY_LIMIT
        _, silhouette = cv2.threshold(mask, limit, _BRIGHTEST, cv2.THRESH_BINARY)
        return np.asarray(silhouette, np.uint8)
    person = mask >= (0.5 if highest <= 1 else _GREY_LIMIT + 1)
    return np.ascontiguousarray(person).view(np.uint8) * np.uint8(_BRIGHTEST)


def image_from(given: ArrayLike, name: str = "image", size: Size | None = None) -> ImageArray:
    """Return an image (H, W), (H, W, 1) or (H, W, 3), bgr, of any numeric type as 8 bits a channel.

    Values are levels of 0 to 255; floats of which none is above 1 are levels of 0 to 1. The result
    is C-contiguous, the same array if it is such a one. Raises ValueError, with the ``name``, if
    the height and width are not ``size``, or values are not numeric, negative, above 255 or nan.
    """
    image = _array(given, name)
    if not (image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 3)) or not image.size:
        remedy = "convert it to grey or to bgr"
        if image.ndim == 3 and image.shape[2] == 4:
            remedy = "leave out its fourth channel, as image[..., :3] does"
        raise ValueError(
            f"{name} has the shape {image.shape}; expected {size or '(height, width)'} grey or the "
            f"same with 3 channels, bgr: {remedy}"
        )
    _check_size(image, name, size)
    if image.dtype == np.bool_:
        raise ValueError(f"{name} has the type bool; expected levels of 0 to 255: this is a mask")
    if image.dtype != np.uint8:
        highest = _check_range(image, name, "levels of 0 to 255 (16 bits: divide by 257)")
        if not np.issubdtype(image.dtype, np.integer):
            image = np.rint(image * _BRIGHTEST if highest <= 1 else image)
        image = image.astype(np.uint8)
    return np.ascontiguousarray(image)


def depth_from(given: ArrayLike, name: str = "depth_m", size: Size | None = None) -> DepthImage:
    """Return a depth image (H, W) or (H, W, 1) of floats, metres; 0 where it is not above 0.

    Raises ValueError, with the ``name``, if the height and width are not ``size``, the type is none
    of floats, or half of the known depths are above 100, which looks like millimetres.
    """
    depth = _array(given, name)
    if depth.ndim != 2:
        raise ValueError(
            f"{name} has the shape {depth.shape}; expected {size or '(height, width)'}"
        )
    _check_size(depth, name, size)
    if not np.issubdtype(depth.dtype, np.floating):
        raise ValueError(
            f"{name} has the type {depth.dtype}, which usually holds millimetres; expected metres "
            "as float32: divide them by 1000.0"
        )
    with np.errstate(over="ignore"):
        depth = depth.astype(np.float32, order="C")
    depth = np.where((depth > 0) & (depth < np.inf), depth, np.float32(0))
    far = depth > _FARTHEST_M
    if far.any() and 2 * np.count_nonzero(far) >= np.count_nonzero(depth):
        middle = float(np.median(depth[depth > 0]))
        raise ValueError(
            f"half of {name} is {middle:.3g} or more, which looks like millimetres; expected "
            "metres: divide them by 1000"
        )
    return depth


def _array(given: ArrayLike, name: str) -> NDArray[Any]:
    """Return numbers as an array; (H, W, 1) becomes (H, W)."""
    try:
        array = np.asarray(given)
    except (TypeError, ValueError, RuntimeError, OverflowError) as error:
        raise ValueError(
            f"{name} is no array of numbers: {reason_of(error)}; expected one"
        ) from None
    if array.dtype.kind not in "biuf":
        raise ValueError(
            f"{name} is of the type {type(given).__name__}, of {array.dtype}; expected an array "
            "of numbers"
        )
    return array[..., 0] if array.ndim == 3 and array.shape[2] == 1 else array


def _check_size(array: NDArray[Any], name: str, size: Size | None) -> None:
    if size is not None and array.shape[:2] != size:
        raise ValueError(
            f"{name} has shape {array.shape}; the camera's is {size}: resize it, or give a Camera "
            "of this size"
        )


def _check_range(array: NDArray[Any], name: str, expected: str) -> float:
    """Return the largest value; refuse values below 0, above 255 or not a number."""
    if array.dtype == np.uint8:
        return float(array.max())
    lowest, highest = array.min(), array.max()
    if not (lowest >= 0 and highest <= _BRIGHTEST):
        is_number = lowest == lowest
        found = f"values from {lowest:g} to {highest:g}" if is_number else "values that are nan"
        raise ValueError(f"{name} has {found}; expected {expected}")
    return float(highest)
