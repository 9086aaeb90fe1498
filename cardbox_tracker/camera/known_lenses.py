"""Lenses of usual webcams and phones by their names, as data sheets and others state them.

Data sheets of webcams state the diagonal of images of 16:9. Images of 4:3 are cut at the sides
(a C920 shows the same height in both, wimsworld.wordpress.com/2013/09/26; a B910 has 70 degrees
across in 16:9 and 61 in 4:3, Android's emulated camera).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import atan, degrees, hypot, radians, tan
from types import MappingProxyType

from cardbox_tracker.common.errors import CameraError, quoted

# Diagonal fields of view, degrees, by the words of the name that tell the model: data sheets of
# Logitech and Microsoft.
_WEBCAMS: Mapping[str, float] = MappingProxyType(
    {
        "c270": 55.0,
        "c310": 60.0,
        "c505": 60.0,
        "c525": 69.0,
        "c615": 78.0,
        "c920": 78.0,
        "c922": 78.0,
        "c925e": 78.0,
        "c930e": 90.0,
        "hd-3000": 68.5,
        "lifecam cinema": 73.0,
    }
)
_ASPECT = 16 / 9
NAMED_STDDEV = 0.05
"""Relative standard deviation of a focal length by a name: of rounded angles, lenses and modes."""

# Widths of the sensors, mm, by the model in EXIF: openMVG's CameraSensorSizeDatabase.
_SENSORS_MM: Mapping[str, float] = MappingProxyType(
    {
        "iphone 4": 4.54,
        "iphone 4s": 4.54,
        "iphone 5": 4.54,
        "iphone 5s": 4.89,
        "iphone 6": 4.89,
        "iphone 6 plus": 4.89,
    }
)


def webcam_fov_deg(name: str, width: int, height: int) -> float:
    """Return the field of view, degrees, across a webcam's images of ``width`` x ``height`` px.

    ``name`` is that of the device, such as "HD Pro Webcam C920". Raises CameraError if no webcam
    of that name is known.
    """
    for words, diagonal_deg in _WEBCAMS.items():
        if re.search(rf"\b{words}(?!\d)", name.lower()):
            # Of images of 16:9 with the height 1, also if the webcam is held upright.
            focal = hypot(_ASPECT, 1.0) / 2 / tan(radians(diagonal_deg) / 2)
            focal_px = focal * max(min(width, height), max(width, height) / _ASPECT)
            return 2 * degrees(atan(width / 2 / focal_px))
    raise CameraError(
        f"no webcam {quoted(name)} is known; expected a name with one of {', '.join(_WEBCAMS)}; "
        "or give --fov DEG, the field of view across the width of the image"
    )


def sensor_width_mm(model: str) -> float | None:
    """Return the width of the sensor of a phone by its name in EXIF, mm; None if not known."""
    return _SENSORS_MM.get(model.strip("\0 ").lower())
