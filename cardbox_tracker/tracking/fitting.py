"""Decides when the unknown values of a body are fitted.

A fit takes as long as about a hundred frames. It is made on the first silhouette with a whole upper
body, and again when another person may have come: after the image was empty, when the colours of
the torso have changed, or when the model fits clearly worse than before. A failed fit is repeated
after a pause, which doubles each time. A fit to a person who bows or turns away can be wrong, so
the previous body is restored if the new one fits clearly worse.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.measuring.first_sight import fit_first_sight, upper_body
from cardbox_tracker.measuring.part_colors import torso_colors
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.terms.term import Image, Silhouette

# Empty frames after which another person is expected.
_ABSENT_FRAMES = 5
# Frames over which the usual IoU is averaged; loss of IoU, and number of frames with it, that
# count as clearly worse.
_USUAL_FRAMES, _WORSE, _WORSE_FRAMES = 10, 0.08, 5
# Frames between two comparisons of the torso's colours; Bhattacharyya distance that indicates other
# clothes; consecutive comparisons with this result that indicate another person.
_COMPARE_EVERY, _OTHER_CLOTHES, _OTHER_TIMES = 4, 0.2, 2
# Shortest and longest pause between attempts in frames, and frames of tracking after which the
# pause is the shortest again.
_SHORTEST_PAUSE, _LONGEST_PAUSE, _PROVED_FRAMES = 15, 1000, 40


class Fitting:
    """Decides at each frame of one tracker whether the body is fitted."""

    def __init__(
        self, body: BodyModel, camera: Camera, config: TrackerConfig, rng: np.random.Generator
    ) -> None:
        """Store the initial body.

        Args:
            body: body model with ``unknown`` values.
            camera: working camera.
            config: settings of the tracker.
            rng: random numbers of the fits.
        """
        self._guess, self._camera, self._config, self._rng = body, camera, config, rng
        self._expect()

    def _expect(self) -> None:
        """Expect a new person."""
        self._is_due, self._pause, self._wait, self._absent = True, _SHORTEST_PAUSE, 0, 0
        self._ious: list[float] = []
        self._fitted: BodyModel | None = None
        self._last: tuple[BodyModel, float] | None = None
        # IoU of the body that was fitted so poorly that it is only used until a better one is.
        self._poor_iou = 0.0

    def before(
        self, silhouette: Silhouette, image: Image | None, is_detected: bool = False
    ) -> BodyModel | None:
        """Return the body from this frame on, or None if it does not change.

        Args:
            silhouette: (H, W), 0 or 255.
            image: image of the same frame; None without one.
            is_detected: whether a detector finds the person.
        """
        self._wait = max(0, self._wait - 1)
        if (body := self._last_that_fitted()) is not None:
            return body
        if not self._is_due or self._wait > 0:
            return None
        seen = upper_body(silhouette, is_detected)
        if seen is None:
            return None
        self._wait, self._pause = self._pause, min(2 * self._pause, _LONGEST_PAUSE)
        try:
            fit = fit_first_sight(self._guess, self._camera, seen, image, self._config, self._rng)
        except InitializationError:
            return None
        if fit.body.unknown:
            if self._fitted is not None or fit.iou <= self._poor_iou:
                return None
            self._poor_iou = fit.iou
            return fit.body
        # The previous body of the same person; None for a new person.
        self._last = (self._fitted, self._usual) if self._fitted and self._ious else None
        self._fitted = fit.body
        self._is_due, self._worse, self._ious = False, 0, []
        self._clothes = fit.clothes
        self._frames = self._other = 0
        return fit.body

    def _last_that_fitted(self) -> BodyModel | None:
        """Return and restore the body before the last fit if that one fits clearly worse."""
        if self._last is None or (len(self._ious) < _USUAL_FRAMES and not self._is_due):
            return None
        body, usual = self._last
        self._last = None
        if self._usual >= usual - _WORSE:
            return None
        self._fitted, self._ious = body, [usual] * _USUAL_FRAMES
        self._is_due, self._worse = False, 0
        return body

    @property
    def _usual(self) -> float:
        """Mean IoU of the first frames after the fit."""
        return float(np.mean(self._ious)) if self._ious else 1.0

    def after(self, is_somebody: bool, iou: float | None) -> None:
        """Store the result of the frame.

        Args:
            is_somebody: whether the image shows a person.
            iou: IoU of model and silhouette before any correction; None if the person was lost.
        """
        self._absent = 0 if is_somebody else self._absent + 1
        if self._absent == _ABSENT_FRAMES:
            self._expect()
        if self._is_due or not is_somebody:
            return
        self._frames += 1
        if self._frames == _PROVED_FRAMES:
            self._pause = _SHORTEST_PAUSE
        if iou is not None and len(self._ious) < _USUAL_FRAMES:
            self._ious.append(iou)
        self._worse = self._worse + 1 if iou is None or iou < self._usual - _WORSE else 0
        self._is_due = self._worse >= _WORSE_FRAMES

    def compare(
        self, silhouette: Silhouette, image: Image | None, body: BodyModel, posture: FloatArray
    ) -> None:
        """Compare the torso's colours with those at the fit to detect another person.

        Args:
            silhouette: (H, W), 0 or 255.
            image: image of the same frame; None without one.
            body: the person at the current place.
            posture: the person's posture, (12,).
        """
        if self._is_due or self._clothes is None or image is None:
            return
        if self._frames % _COMPARE_EVERY:
            return
        now = torso_colors(image, silhouette, body, self._camera, posture)
        if now is None or len(now) != len(self._clothes):
            return
        before = self._clothes
        alike = np.sum(np.sqrt(before * now)) / np.sqrt(before.sum() * now.sum())
        self._other = self._other + 1 if -np.log(alike) > _OTHER_CLOTHES else 0
        if self._other >= _OTHER_TIMES:
            self._is_due, self._fitted, self._last = True, None, None
