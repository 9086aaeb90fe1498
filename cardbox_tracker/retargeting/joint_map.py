"""Retargeting of single joints by a map from the person's joints to the robot's.

    joints:
      - {from: right_shoulder_flexion, to: shoulder_pitch, scale: -1.0, offset_deg: 0.0}
      - {from: right_elbow_bend, to: elbow_pitch}
      - {to: wrist_pitch, offset_deg: 10.0}

Each row sets ``to = scale * from + offset``; the default scale is 1, the default offset 0. A row
without ``from`` keeps a joint at its offset, because a controller may want all joints of an arm.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.errors import CardboxError, quoted
from cardbox_tracker.retargeting.followed import ANGLES, angles_of, joints_behind
from cardbox_tracker.small_yaml import SmallYamlError, parse_small_yaml, read_small_text

_KEYS = {"from", "to", "scale", "offset_deg"}


@dataclass(frozen=True)
class JointMap:
    """A :class:`~.retargeter.Method`: each of ``joints`` follows an angle of the person.

    Attributes:
        angles: one of :data:`~.followed.ANGLES` for each joint; None for a joint that stays.
        joints: the robot's joints without repetition.
        scale: (n,).
        offset_rad: (n,).
    """

    angles: tuple[str | None, ...]
    joints: tuple[str, ...]
    scale: FloatArray
    offset_rad: FloatArray

    @property
    def sources(self) -> tuple[str, ...]:
        """See :class:`~.retargeter.Method`."""
        return tuple(dict.fromkeys(j for a in self.angles if a for j in joints_behind(a)))

    def target(self, _: BodyModel, posture: FloatArray, now: FloatArray) -> FloatArray:
        """See :class:`~.retargeter.Method`; a joint stays while its angle is unknown."""
        known = angles_of(posture)
        chosen = np.array([known[angle] if angle else 0.0 for angle in self.angles])
        return np.where(np.isnan(chosen), now, self.scale * chosen + self.offset_rad)


def load_joint_map(path: str | os.PathLike[str]) -> JointMap:
    """Read a joint map from a YAML file.

    Raises:
        CardboxError: the file cannot be read, or is not a valid joint map.
    """
    try:
        rows = parse_small_yaml(read_small_text(path))["joints"]
        if not isinstance(rows, list) or not rows:
            raise ValueError("'joints' is an empty list, or not a list")
        for row in rows:
            if not isinstance(row, dict) or not {"to"} <= set(row) <= _KEYS:
                raise ValueError(
                    f"{quoted(row)} needs 'to', and may have 'from', 'scale' and 'offset_deg'"
                )
            if row.get("from", ANGLES[0]) not in ANGLES:
                raise ValueError(f"{quoted(row['from'])} is not one of {', '.join(ANGLES)}")
        targets = tuple(str(row["to"]) for row in rows)
        if len(set(targets)) < len(targets):
            raise ValueError("a joint of the robot is in two rows")
        scale = np.array([float(row.get("scale", 1.0)) for row in rows])
        offset = np.array([math.radians(float(row.get("offset_deg", 0.0))) for row in rows])
        if not (np.isfinite(scale).all() and np.isfinite(offset).all()):
            raise ValueError("a scale or an offset is not a finite number")
    except (SmallYamlError, KeyError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise CardboxError(
            f"{path} is not a joint map: {reason}; see the example config/example_joint_map.yaml"
        ) from None
    return JointMap(tuple(row.get("from") for row in rows), targets, scale, offset)
