"""Interface of correctors, which improve a result's keypoints; see the setting ``corrector``."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.terms import Frame
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.filtering.result_features import Viewpoints
from cardbox_tracker.estimation.filtering.search_features import Search
from cardbox_tracker.vision.camera import Camera


class Result(NamedTuple):
    """A result of the whole-body filter in one frame.

    Attributes:
        frame: silhouette, image, depth image, stamp and the interval to the previous frame.
        state: d1..d12, ``torso_x`` and ``torso_z``, (14,), rad and metres.
        stddev: standard deviations (14,) of the state, from the spread of the particles.
        keypoints_m: left shoulder, elbow, hand, then the right ones, (6, 3), metres in the optical
            frame of the first camera.
        iou: intersection over union of model and silhouette.
        search: the rated states, and the evidence for the result.
        viewpoints: directions of the cameras, and quality of the body model.
    """

    frame: Frame
    state: FloatArray
    stddev: FloatArray
    keypoints_m: FloatArray
    iou: float
    search: Search
    viewpoints: Viewpoints


class Corrector(Protocol):
    """Corrects the results of one body; it may keep a state over frames."""

    def __call__(self, found: Result) -> FloatArray:
        """Return the corrected keypoints (6, 3), metres in the optical frame.

        The tracker smooths them and fits the posture to them; the bones keep their lengths.
        """

    def chances_of_error(self) -> FloatArray | None:
        """Return the probability (6,) that each keypoint of the last frame is off by over 30 cm.

        None lets the filter estimate it from the deviations.
        """

    def deviations(self, corrected: Result) -> FloatArray | None:
        """Return standard deviations (14,) of the corrected result; None keeps the filter's."""


MakeCorrector = Callable[[WholeBodyCost, Camera, int], Corrector]
"""Takes the body's cost before the first camera, this camera, and the number of cameras."""
