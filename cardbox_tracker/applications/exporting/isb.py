"""Files of joint angles by the recommendations of the International Society of Biomechanics."""

from __future__ import annotations

from pathlib import Path

import numpy as np

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
