"""Points as a detector without errors finds them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import N_STATE
from cardbox_tracker.detection.image_points import ImagePoints
from cardbox_tracker.estimation.cost import joint_points_kernels as kernels
from cardbox_tracker.estimation.cost.drawn_body import body_tuple
from cardbox_tracker.estimation.cost.whole_body_config import WholeBodyCostConfig
from cardbox_tracker.vision.camera import Camera

Detect = Callable[..., ImagePoints]


def _rows() -> dict[str, int]:
    """Index of the projected joint by the name of a point."""
    rows = {"left_hip": 8, "right_hip": 8, "left_ear": 9, "right_ear": 9}
    for first, side in ((0, "left"), (4, "right")):
        for joint, name in enumerate(("shoulder", "elbow", "wrist", "index")):
            rows[f"{side}_{name}"] = first + joint
        rows[f"{side}_little_finger"] = first + 3
    return rows


def _detected(
    body: BodyModel,
    camera: Camera,
    state: np.ndarray,
    score: float = 0.9,
    stamp_ns: int | None = None,
) -> ImagePoints:
    """Return the points of a state (12,) or (14,) before a camera with the body's pitch."""
    whole, pixels = np.zeros(N_STATE), np.empty((kernels.N_POINTS, 3))
    whole[: len(state)] = state
    kernels.project(whole, body_tuple(body, camera, WholeBodyCostConfig()), pixels)
    found = {name: (pixels[row, 0], pixels[row, 1], score) for name, row in _rows().items()}
    return ImagePoints.of(found, stamp_ns)


@pytest.fixture(scope="session")
def detected() -> Detect:
    """See :func:`_detected`."""
    return _detected
