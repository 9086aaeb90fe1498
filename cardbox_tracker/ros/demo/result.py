"""The result of a run of the demo."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.applications.evaluation.truth import GroundTruth
from cardbox_tracker.person.model import BodyModel


@dataclass(frozen=True)
class DemoResult:
    """Published data and ground truth.

    Attributes:
        body: the measured person.
        truth: ground truth of the session.
        start_ns: stamp of the first image after the initialization.
        postures: (12,) by stamp.
        keypoints_m: (6, 3) by stamp, metres in the optical frame.
        silhouettes: (H, W) by stamp.
        fps: received joint states per second.
        initialization_iou: mean fit of the references, as the initializer reported it.
        places_m: ``torso_x`` and ``torso_z`` (2,) by stamp; empty if they are kept constant.
        states: tracking state by stamp; a missing state means ``tracking``.
    """

    body: BodyModel
    truth: GroundTruth
    start_ns: int
    postures: dict[int, NDArray[np.float64]]
    keypoints_m: dict[int, NDArray[np.float64]]
    silhouettes: dict[int, NDArray[np.uint8]] = field(repr=False)
    fps: float
    initialization_iou: float
    places_m: dict[int, NDArray[np.float64]] = field(default_factory=dict)
    states: dict[int, str] = field(default_factory=dict)
