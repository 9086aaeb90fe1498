"""What is done to the result of the whole-body filter; its particles know nothing of it.

1. It is fitted to the outlines of the silhouettes (:mod:`.outline_fit`).
2. It is corrected by what was learned (:mod:`.correction`).
3. How wrong it may be is estimated for such results (:mod:`.deviations`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.terms import Frame
from cardbox_tracker.estimation.cost.view import View
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.filtering.correction import Correction
from cardbox_tracker.estimation.filtering.deviations import DATA, deviations_of
from cardbox_tracker.estimation.filtering.networks import load_network
from cardbox_tracker.estimation.filtering.outline_fit import OutlineFit
from cardbox_tracker.estimation.filtering.result_features import Viewpoints, features_of
from cardbox_tracker.estimation.filtering.search_features import Search
from cardbox_tracker.estimation.filtering.whole_body_config import WholeBodyConfig
from cardbox_tracker.vision.camera import Camera

# The angles among the values of a state.
_ANGLES = slice(1, 12)


class Refinement:
    """Improves results of one body before one camera or several.

    Attributes:
        outline: the fit to the outlines.
        correction: what was learned; None if it is switched off.
        features: what the deviations are learned from, of the last corrected result, (2, F).
    """

    def __init__(
        self,
        cost: WholeBodyCost,
        camera: Camera,
        config: WholeBodyConfig,
        others: Sequence[tuple[WholeBodyCost, View]] = (),
    ) -> None:
        """Prepare for the body of ``cost`` before ``camera`` and ``others``."""
        self._cost = cost
        self.outline = OutlineFit(cost, camera, config.outline_steps, others)
        self._yaws_rad = [0.0, *(view.yaw_rad for _, view in others)]
        self.see(range(len(self._yaws_rad)))
        self.correction = (
            Correction(cost, camera, config.output_smoothing_s, 1 + len(others))
            if config.learned_correction
            else None
        )
        self._deviations = load_network(DATA) if config.learned_deviations else None

    def see(self, seeing: Sequence[int]) -> None:
        """Let only the cameras of these numbers count in this frame; the first one is 0."""
        self.outline.seeing = tuple(seeing)
        yaws_rad = [self._yaws_rad[number] for number in seeing]
        self._viewpoints = Viewpoints.of(self._cost.pitch_rad, yaws_rad, self._cost.is_measured)

    def forget(self) -> None:
        """Begin anew with the outline: the next state may be of another place.

        What was learned goes on: it has learned from people who leave and come back.
        """
        self.outline.forget()
        if self.correction is not None:
            self.correction.forget()

    def corrected(
        self, frame: Frame, fitted: FloatArray, stddev: FloatArray, iou: float, search: Search
    ) -> FloatArray:
        """Return the result (14,): what was learned moves the state that fits the outlines.

        Args:
            frame: what is seen.
            fitted: to the outlines, (14,).
            stddev: its deviations, (14,).
            iou: of model and silhouette.
            search: that has found it.
        """
        if self.correction is None:
            return fitted
        viewpoints = self._viewpoints_of(frame)
        return self.correction(frame, fitted, stddev, iou, search, viewpoints)

    def _viewpoints_of(self, frame: Frame) -> Viewpoints:
        # Beside a further camera a depth image adds little, and nothing was learned of both.
        has_depth = frame.depth_m is not None and len(self._yaws_rad) == 1
        return self._viewpoints._replace(has_depth=has_depth)

    def deviations(
        self,
        frame: Frame,
        state: FloatArray,
        stddev: FloatArray,
        keypoints_m: FloatArray,
        iou: float,
    ) -> FloatArray:
        """Return the deviations (14,) of the result: learned ones of the angles.

        Results that are not corrected keep those of the filter.

        Args:
            frame: what is seen.
            state: the result, (14,).
            stddev: the filter's deviations, (14,).
            keypoints_m: of the state, (6, 3), metres in the optical frame.
            iou: of model and silhouette.
        """
        if self.correction is None:
            return stddev
        row = state[None], stddev[None], keypoints_m[None], np.array([iou])
        self.features = features_of(*row, self._viewpoints_of(frame))[0]
        if self._deviations is None:
            return stddev
        learned = stddev.copy()
        learned[_ANGLES] = deviations_of(self._deviations, self.features[None])[0]
        return learned
