"""The formats of ``cardbox export`` by name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cardbox_tracker.applications.exporting.bvh import write_bvh
from cardbox_tracker.applications.exporting.markers import ezc3d_or_error, write_c3d, write_trc
from cardbox_tracker.applications.exporting.mot import write_mot
from cardbox_tracker.applications.exporting.motion import Motion
from cardbox_tracker.common.files import write_table
from cardbox_tracker.person.isb_angles import ISB_NAMES, isb_angles
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.skeleton import JOINT_NAMES, NECK_NAMES, PLACE_NAMES, UNITS


def write_isb(path: Path, motion: Motion, body: BodyModel | None = None) -> None:
    """Write a CSV file with the angles of the ISB in degrees, then our own joints.

    Args:
        path: file to write.
        motion: the results; a row for each image, empty in gaps.
        body: not needed.

    Raises:
        CardboxError: the file cannot be written.
    """
    names = (*JOINT_NAMES, *PLACE_NAMES, *NECK_NAMES)
    values = np.hstack([np.degrees(isb_angles(motion.states)), motion.states, motion.neck])
    rows = (
        (str(stamp_ns), f"{time_s:.6f}", state, *("" if v != v else f"{v:.6f}" for v in row))
        for stamp_ns, time_s, state, row in zip(
            motion.stamp_ns.tolist(), motion.time_s, motion.state, values.tolist(), strict=True
        )
    )
    units = (f"{name}_{UNITS[name]}" for name in names)
    header = ("stamp_ns", "time_s", "state", *(f"{name}_deg" for name in ISB_NAMES), *units)
    write_table(path, header, rows)


class Format(NamedTuple):
    """One format.

    Attributes:
        suffix: end of the names of its files.
        write: writes a motion of a body to a file; the body may be unknown.
        check: raises CardboxError if a library is missing.
        has_places: whether it depends on the pitch of the camera.
    """

    suffix: str
    write: Callable[[Path, Motion, BodyModel | None], None]
    check: Callable[[], object] = lambda: None
    has_places: bool = True


FORMATS: dict[str, Format] = {
    "trc": Format(".trc", write_trc),
    "bvh": Format(".bvh", write_bvh),
    "c3d": Format(".c3d", write_c3d, ezc3d_or_error),
    "mot": Format(".mot", write_mot),
    "isb": Format(".isb.csv", write_isb, has_places=False),
}
