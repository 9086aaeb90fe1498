"""The unknown values of a body, from a few images of the person in any posture.

The fit to one silhouette (:mod:`.first_sight`) errs with the posture that the person happens to
have. So it is repeated in further images, and of each size the median of all fits counts. A fit
takes as long as tracking about a hundred images. One outline hardly shows the scale, so what all
images of a film show of the distance (:mod:`.people_camera`) corrects it.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import replace
from functools import partial

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.tilt import tilted_body
from cardbox_tracker.common.errors import BodyModelError, InitializationError
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.measuring.first_sight import FirstSight, fit_first_sight, upper_body
from cardbox_tracker.measuring.people_camera import Distances
from cardbox_tracker.measuring.scale import scaled
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.terms.term import Image, Silhouette

MOST_SIGHTS = 7
"""Images to which a body is fitted."""
# Deviation of the logarithm of a fitted body's scale; images that show the same place, s.
_SCALE, _SAME_IMAGE_S = 0.05, 0.3
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
        beside: Executor | None = None,
    ) -> None:
        """Prepare for a person of whom ``guess`` has ``unknown`` values, before a working camera.

        ``pause_s`` is the time between the first two images that are used; each further pause is
        twice as long. Fits after the first one are made by ``beside``, if given, and count in
        the first image after them.
        """
        self._beside = beside
        self._camera, self._config, self._rng = camera, config, rng
        self._guess, self._pause_s = guess, pause_s
        self.forget()

    def forget(self) -> None:
        """Expect another person."""
        self.body, self._next_s, self._poor_iou = self._guess, float("-inf"), 0.0
        self._wait_s = self._pause_s
        self._begun: tuple[Future[FirstSight], float] | None = None
        self._fits: list[FirstSight] = []
        self._times_s: list[float] = []
        self._far: Distances | None = None

    def tilt(self, guess: BodyModel) -> None:
        """Go on with all fits before the camera of another ``guess``, with another pitch."""
        self._begun = None
        pose = guess.camera_pose
        self._camera = self._camera.with_pitch(pose.pitch_rad)
        self.body = guess if self.body is self._guess else tilted_body(self.body, pose)
        self._guess = guess
        self._fits = [replace(fit, body=tilted_body(fit.body, pose)) for fit in self._fits]

    def see(
        self,
        silhouette: Silhouette,
        image: Image | None,
        time_s: float,
        points: ImagePoints | None = None,
    ) -> bool:
        """Fit a silhouette (H, W) with points, and colours of its image, if due.

        Return whether ``body`` changed.
        """
        if self._begun is not None:
            fitting, begun_s = self._begun
            if not fitting.done():
                return False
            self._begun = None
            return self._add(fitting.result, begun_s)
        if time_s < self._next_s or len(self._fits) == MOST_SIGHTS:
            return False
        if points is not None and not points.are_certain:
            points = None
        seen = upper_body(silhouette, points is not None)
        if seen is None:
            return False
        given = self._guess, self._camera, seen, image, self._config, self._rng, points
        if self._beside is None or not self._fits:
            return self._add(partial(fit_first_sight, *given), time_s)
        self._begun = self._beside.submit(fit_first_sight, *given), time_s
        return False

    def _add(self, fitted: Callable[[], FirstSight], time_s: float) -> bool:
        """Use the fit to the image of a time; return whether ``body`` changed."""
        self._next_s = time_s + _AGAIN_S
        try:
            fit = fitted()
        except InitializationError:
            return False
        if not fit.body.unknown:
            self._fits.append(fit)
            self._times_s.append(time_s)
            self._next_s = time_s + self._wait_s
            self._wait_s *= 2.0
            self.body = self._scaled(self._median())
        elif not self._fits and fit.iou > self._poor_iou:
            # A body that fits poorly serves until one fits well.
            self.body, self._poor_iou = fit.body, fit.iou
        else:
            return False
        return True

    def in_film(self, far: Distances | None) -> BodyModel:
        """Return the body at the place of the first fit, where the film begins.

        Distances ``far``, m, correct its scale.
        """
        self._far = far
        return self._scaled(self._median(self._fits[0].body) if self._fits else self.body)

    def correct(self, far: Distances | None) -> bool:
        """Correct the scale by distances, m, of images so far; return if ``body`` changed."""
        self._far, before = far, self.body
        if self._fits:
            self.body = self._scaled(self._median())
        return self.body != before

    def _scaled(self, body: BodyModel) -> BodyModel:
        """Return a body with the mean scale of fits and distances, weighted by their variances.

        A distance that is given stays.
        """
        far = self._far
        if far is None:
            return body
        away = np.abs(np.subtract.outer(self._times_s, far.times_s))
        near = away.min(axis=1) < _SAME_IMAGE_S if len(self._fits) else np.zeros(0, bool)
        if not near.any() or "distance_m" not in self._guess.unknown:
            return body
        fitted = np.array([fit.body.placement.distance_m for fit in self._fits])
        ratios = np.log(far.distances[away.argmin(axis=1)] / fitted)[near]
        share = _SCALE**2 / (_SCALE**2 + far.stddev**2)
        try:
            return scaled(body, float(np.exp(share * np.median(ratios))))
        except BodyModelError:
            return body

    def _median(self, place: BodyModel | None = None) -> BodyModel:
        """Return the median sizes, the colours of the best fit, and its place or that of a body."""
        best = max(self._fits, key=lambda fit: fit.iou).body
        sizes = np.median([fit.body.sizes for fit in self._fits], axis=0)
        found = (place or best).with_values(sizes=sizes, appearance=best.appearance)
        return replace(found, is_distance_found="distance_m" in self._guess.unknown)
