"""States of single keypoints."""

from __future__ import annotations

from enum import StrEnum


class KeypointState(StrEnum):
    """Whether a keypoint can be relied upon."""

    TRACKED = "tracked"
    UNCERTAIN = "uncertain"
    HIDDEN = "hidden"
    LOST = "lost"
