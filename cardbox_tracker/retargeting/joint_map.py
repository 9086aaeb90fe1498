"""Retargeting of single joints by a map from the person's joints to the robot's.

    joints:
      - {from: right_shoulder_flexion, to: shoulder_pitch, scale: -1.0, offset_deg: 0.0}
      - {from: right_elbow_flexion, to: elbow_pitch}

Each row sets ``to = scale * from + offset``; the default scale is 1, the default offset 0.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import JOINT_NAMES
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.errors import CardboxError, quoted
from cardbox_tracker.small_yaml import SmallYamlError, parse_small_yaml, read_small_text

_KEYS = {"from", "to", "scale", "offset_deg"}


@dataclass(frozen=True)
class JointMap:
    """A :class:`~.retargeter.Method`: ``joints`` of the robot follow ``sources`` of the person.

    Attributes:
        sources: the person's joint for each joint of the robot.
        joints: the robot's joints without repetition.
        scale: (n,).
        offset_rad: (n,).
    """

    sources: tuple[str, ...]
    joints: tuple[str, ...]
    scale: FloatArray
    offset_rad: FloatArray

    def target(self, _: BodyModel, posture: FloatArray, __: FloatArray) -> FloatArray:
        """See :class:`~.retargeter.Method`."""
        chosen = posture[[JOINT_NAMES.index(name) for name in self.sources]]
        return self.scale * chosen + self.offset_rad


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
            if not isinstance(row, dict) or not {"from", "to"} <= set(row) <= _KEYS:
                raise ValueError(
                    f"{quoted(row)} needs 'from' and 'to', and may have 'scale' and 'offset_deg'"
                )
            if row["from"] not in JOINT_NAMES:
                raise ValueError(f"{quoted(row['from'])} is not one of {', '.join(JOINT_NAMES)}")
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
    return JointMap(tuple(str(row["from"]) for row in rows), targets, scale, offset)
