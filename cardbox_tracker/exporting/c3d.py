"""The C3D file of a tracked motion, with the optional library ezc3d."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.exporting.markers import markers_of
from cardbox_tracker.exporting.motion import Motion
from cardbox_tracker.files import atomic_path

_MM = 1000.0
_INVALID = -1.0


def library() -> Any:
    """Return the module ezc3d.

    Raises:
        CardboxError: it is not installed.
    """
    try:
        import ezc3d
    except ImportError as error:
        raise CardboxError(
            f"C3D needs the library ezc3d ({error}); install it with "
            "'pip install cardbox_tracker[export]', or export --to trc"
        ) from None
    return ezc3d


def write_c3d(path: Path, motion: Motion, body: BodyModel | None) -> None:
    """Write the markers as C3D in millimetres at a constant rate.

    Points in gaps have the residual -1, which the format defines as invalid.

    Raises:
        CardboxError: ezc3d is missing, or the file cannot be written.
    """
    even = motion.evenly()
    names, points_m = markers_of(even, body)
    is_gap = ~even.is_seen
    points = np.ones((4, len(names), len(points_m)))
    points[:3] = np.moveaxis(np.nan_to_num(points_m) * _MM, -1, 0).swapaxes(1, 2)
    residuals = np.zeros((1, len(names), len(points_m)))
    residuals[..., is_gap] = _INVALID

    file = library().c3d()
    values = file["parameters"]["POINT"]
    values["UNITS"]["value"] = ["mm"]
    values["RATE"]["value"] = [even.rate_hz]
    values["LABELS"]["value"] = list(names)
    # These name the axes of a view from the person's side: forwards, then up.
    file.add_parameter("POINT", "X_SCREEN", ["+X"])
    file.add_parameter("POINT", "Y_SCREEN", ["+Y"])
    file["data"]["points"] = points
    file["data"]["meta_points"]["residuals"] = residuals
    with atomic_path(path) as temporary:
        file.write(str(temporary))
