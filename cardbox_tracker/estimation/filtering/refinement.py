"""Post-processing of the whole-body filter's result; the particles are not changed.

1. The result is fitted to the outlines of the silhouettes (:mod:`.outline_fit`).
2. A corrector improves the keypoints (:mod:`.corrector`).
3. The posture is fitted to these keypoints, smoothed over time (:mod:`.posing`).
"""

from __future__ import annotations

from collections.abc import Sequence

from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.cost.terms import Frame
from cardbox_tracker.estimation.cost.view import View
from cardbox_tracker.estimation.cost.whole_body import WholeBodyCost
from cardbox_tracker.estimation.filtering.corrector import Result
from cardbox_tracker.estimation.filtering.corrector_loading import load_corrector
from cardbox_tracker.estimation.filtering.outline_fit import OutlineFit
from cardbox_tracker.estimation.filtering.posing import SmoothedPosing
from cardbox_tracker.estimation.filtering.result_features import Viewpoints
from cardbox_tracker.estimation.filtering.search_features import Search
from cardbox_tracker.estimation.filtering.whole_body_config import WholeBodyConfig
from cardbox_tracker.vision.camera import Camera


class Refinement:
    """Improves results of one body before one camera or several.

    Attributes:
        outline: the fit to the outlines.
        corrector: corrector of the settings; None without a corrector.
        found: result before the last correction; None before the first correction.
    """

    def __init__(
        self,
        cost: WholeBodyCost,
        camera: Camera,
        config: WholeBodyConfig,
        others: Sequence[tuple[WholeBodyCost, View]] = (),
    ) -> None:
        """Prepare for the body of ``cost`` before ``camera`` and ``others``.

        Raises:
            CardboxError: the corrector cannot be loaded.
        """
        self._cost = cost
        self.outline = OutlineFit(cost, camera, config.outline_steps, others)
        self._yaws_rad = [0.0, *(view.yaw_rad for _, view in others)]
        self.see(range(len(self._yaws_rad)))
        make = load_corrector(config.corrector)
        self.corrector = make and make(cost, camera, len(self._yaws_rad))
        self._has_own_deviations = config.learned_deviations
        self._posing = SmoothedPosing(cost, config.output_smoothing_s)
        self.found: Result | None = None

    def see(self, seeing: Sequence[int]) -> None:
        """Use only the cameras with these indices in this frame; the first camera is 0."""
        self.outline.seeing = tuple(seeing)
        yaws_rad = [self._yaws_rad[number] for number in seeing]
        self._viewpoints = Viewpoints.of(self._cost.pitch_rad, yaws_rad, self._cost.is_measured)

    def forget(self) -> None:
        """Forget outline and smoothing, because the next state may be at another place.

        The corrector keeps its state: the learned one is trained with people who come back.
        """
        self.outline.forget()
        self._posing.forget()

    def corrected(
        self, frame: Frame, fitted: FloatArray, stddev: FloatArray, iou: float, search: Search
    ) -> FloatArray:
        """Return the corrected result (14,).

        Args:
            frame: silhouette and, if there are any, image and depth image.
            fitted: the state that fits the outlines, (14,).
            stddev: standard deviations of the state, (14,).
            iou: intersection over union of model and silhouette.
            search: result of the search.
        """
        if self.corrector is None:
            return fitted
        keypoints_m = self._cost.keypoints(fitted)
        # The networks are not trained with a depth image in addition to a further camera.
        has_depth = frame.depth_m is not None and len(self._yaws_rad) == 1
        viewpoints = self._viewpoints._replace(has_depth=has_depth)
        self.found = Result(frame, fitted, stddev, keypoints_m, iou, search, viewpoints)
        return self._posing(fitted, self.corrector(self.found), frame.interval_s)

    def chances_of_error(self) -> FloatArray | None:
        """Return the corrector's probability (6,) that each keypoint is wrong; None without one."""
        return None if self.corrector is None else self.corrector.chances_of_error()

    def deviations(
        self,
        frame: Frame,
        state: FloatArray,
        stddev: FloatArray,
        keypoints_m: FloatArray,
        iou: float,
    ) -> FloatArray:
        """Return the standard deviations (14,) of the last result from corrector or filter.

        Args:
            frame: see :meth:`corrected`.
            state: the corrected result, (14,).
            stddev: standard deviations from the filter, (14,).
            keypoints_m: keypoints of the state, (6, 3), metres in the optical frame.
            iou: intersection over union of model and silhouette.
        """
        if self.corrector is None or self.found is None:
            return stddev
        result = Result(
            *(frame, state, stddev, keypoints_m, iou),
            *(self.found.search, self.found.viewpoints),
        )
        own = self.corrector.deviations(result)
        return own if self._has_own_deviations and own is not None else stddev
