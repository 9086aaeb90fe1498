"""When a body with unknown values is fitted: at first sight of somebody, and again.

Fitting takes about as long as a hundred frames, so it happens once a person: on the first
silhouette that shows a whole upper body, after the image was empty, for somebody else may have
come, where the torso has other colours than it had, and where the model fits clearly worse than it
did. What fails is tried again after a pause, which doubles. Who bows or turns away fits worse, too,
and then a fit is wrong: where the new body usually fits clearly worse than the one before did, that
one is taken again.
"""

from __future__ import annotations

import numpy as np

from cardbox_tracker.body.appearance import TORSO
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.errors import InitializationError
from cardbox_tracker.estimation.config import TrackerConfig
from cardbox_tracker.estimation.cost.terms import Image, Silhouette
from cardbox_tracker.estimation.initialization.first_sight import fit_first_sight, upper_body
from cardbox_tracker.estimation.initialization.part_colors import torso_colors
from cardbox_tracker.vision.camera import Camera

# Frames without anybody after which somebody else may come.
_ABSENT_FRAMES = 5
# Frames after a fit over which it is seen how well the model usually fits, as IoU; how much worse
# is clearly worse, and for how many frames.
_USUAL_FRAMES, _WORSE, _WORSE_FRAMES = 10, 0.08, 5
# The torso's colours are compared every so many frames; somebody else wears others: Bhattacharyya
# distances are below 0.1 in 95 % of the frames of one person and above it between 95 % of the pairs
# of different ones (five people, ``shared/data/real_signs``), and so often in a row. The brightness
# counts, for dark and light shirts differ in nothing else; a lamp costs a fit that does no harm.
_COMPARE_EVERY, _OTHER_CLOTHES, _OTHER_TIMES = 4, 0.2, 2
# Frames from one attempt to the next, at first and at most; and those after which a fit has proved
# itself, so that the next pause is short again.
_SHORTEST_PAUSE, _LONGEST_PAUSE, _PROVED_FRAMES = 15, 1000, 40


class Fitting:
    """Decides from frame to frame whether to fit, for one tracker."""

    def __init__(
        self, body: BodyModel, camera: Camera, config: TrackerConfig, rng: np.random.Generator
    ) -> None:
        """Keep the guesses to begin with.

        Args:
            body: with ``unknown`` values.
            camera: working camera.
            config: settings of the tracker.
            rng: source of the fits' noise.
        """
        self._guess, self._camera, self._config, self._rng = body, camera, config, rng
        self._expect()

    def _expect(self) -> None:
        """Expect somebody who was not seen yet."""
        self._is_due, self._pause, self._wait, self._absent = True, _SHORTEST_PAUSE, 0, 0
        self._ious: list[float] = []
        self._fitted: BodyModel | None = None
        self._last: tuple[BodyModel, float] | None = None

    def before(self, silhouette: Silhouette, image: Image | None) -> BodyModel | None:
        """Return a body to use from this frame on, or None to go on.

        Args:
            silhouette: (H, W), 0 or 255.
            image: of the same frame.
        """
        self._wait = max(0, self._wait - 1)
        if (body := self._last_that_fitted()) is not None:
            return body
        if not self._is_due or self._wait > 0:
            return None
        seen = upper_body(silhouette)
        if seen is None:
            return None
        self._wait, self._pause = self._pause, min(2 * self._pause, _LONGEST_PAUSE)
        try:
            fit = fit_first_sight(self._guess, self._camera, seen, image, self._config, self._rng)
        except InitializationError:
            return None
        # Of the same person, whom it fitted; None of a person who is new.
        self._last = (self._fitted, self._usual) if self._fitted and self._ious else None
        self._fitted = fit.body
        self._is_due, self._worse, self._ious = False, 0, []
        worn = fit.body.appearance
        self._clothes = None if worn is None else worn.histograms[TORSO]
        self._frames = self._other = 0
        return fit.body

    def _last_that_fitted(self) -> BodyModel | None:
        """Return the body before the last fit if that was one for the worse, and go on with it."""
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
        """How well the fitted body usually fits, as IoU."""
        return float(np.mean(self._ious)) if self._ious else 1.0

    def after(self, is_somebody: bool, iou: float | None) -> None:
        """Take note of how well the frame was tracked.

        Args:
            is_somebody: whether anybody was in it.
            iou: of model and silhouette, before what was learned has corrected the result; None if
                the person was lost.
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
        """Look whether it is still the same person, by the colours of the torso.

        Args:
            silhouette: (H, W), 0 or 255.
            image: of the same frame.
            body: the person, where they are.
            posture: theirs, (12,).
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
