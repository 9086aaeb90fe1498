"""The unknown values of a body, from a few images of the person in any posture.

The fit to one silhouette (:mod:`.first_sight`) errs with the posture that the person happens to
have. So it is repeated in further images, and of each size the median of all fits counts. A fit
takes as long as tracking about a hundred images.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.measuring.first_sight import FirstSight, fit_first_sight, upper_body
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.terms.term import Image, Silhouette

MOST_SIGHTS = 7
"""Images to which a body is fitted."""
# Time until another image is tried after one to which no body fits, s.
_AGAIN_S = 1.0


class SeenBody:
    """Measures one person while images come.

    Attributes:
        body: the body by all images so far; its values are still unknown before the first fit, or
            if no fit is good.
    """

    def __init__(
        self,
        guess: BodyModel,
        camera: Camera,
        config: TrackerConfig,
        rng: np.random.Generator,
        pause_s: float = 1.0,
    ) -> None:
        """Prepare for a person of whom ``guess`` has ``unknown`` values, before a working camera.

        ``pause_s`` is the time between the first two images that are used; each further pause is
        twice as long.
        """
        self._camera, self._config, self._rng = camera, config, rng
        self._guess, self._pause_s = guess, pause_s
        self.forget()

    def forget(self) -> None:
        """Expect another person."""
        self.body, self._next_s, self._poor_iou = self._guess, float("-inf"), 0.0
        self._wait_s = self._pause_s
        self._fits: list[FirstSight] = []

    def see(
        self,
        silhouette: Silhouette,
        image: Image | None,
        time_s: float,
        is_detected: bool = False,
    ) -> bool:
        """Fit a silhouette (H, W), and colours of its image, if due; return if ``body`` changed."""
        if time_s < self._next_s or len(self._fits) == MOST_SIGHTS:
            return False
        seen = upper_body(silhouette, is_detected)
        if seen is None:
            return False
        self._next_s = time_s + _AGAIN_S
        try:
            fit = fit_first_sight(self._guess, self._camera, seen, image, self._config, self._rng)
        except InitializationError:
            return False
        if not fit.body.unknown:
            self._fits.append(fit)
            self._next_s = time_s + self._wait_s
            self._wait_s *= 2.0
            self.body = self._median()
        elif not self._fits and fit.iou > self._poor_iou:
            # A body that fits poorly serves until one fits well.
            self.body, self._poor_iou = fit.body, fit.iou
        else:
            return False
        return True

    def _median(self) -> BodyModel:
        """Return the median sizes, at the first place, with the colours of the best fit."""
        best = max(self._fits, key=lambda fit: fit.iou).body
        sizes = np.median([fit.body.sizes for fit in self._fits], axis=0)
        first = self._fits[0].body
        found = first.with_values(sizes=sizes, appearance=best.appearance)
        return replace(found, is_distance_found="distance_m" in self._guess.unknown)
