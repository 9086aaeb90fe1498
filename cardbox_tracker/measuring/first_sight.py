"""Fit of a body from proportions to the first silhouette of a person in any posture.

A body that was not measured (:mod:`cardbox_tracker.person.proportions`) has unknown values: the
height of the hips, the breadths of the person with clothes, and possibly the distance. They are
estimated by an alternating search, which uses the points of a detector for the distance:

1. The whole-body filter searches for postures of the current body.
2. Random bodies around the current one are rated in the best of these postures, with a prior
   that keeps them near the proportions of people; the best body is kept.

Lengths along the bones are not searched, because one outline in an unknown posture does not
determine them. With an image, colours are learned, too (:mod:`.part_colors`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import InitializationError
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.measuring.outline import filled
from cardbox_tracker.measuring.part_colors import seen_appearance
from cardbox_tracker.measuring.references import (
    MAX_PERSON_FRACTION,
    MIN_PERSON_FRACTION,
    lateral_m,
    rounded_down,
)
from cardbox_tracker.measuring.stature import at_height_of
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import N_STATE, PLACE, POSTURE, TORSO_Y
from cardbox_tracker.person.proportions import BREADTHS
from cardbox_tracker.person.sizes import SIZE_INDEX, SIZE_LIMITS, FloatArray
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.search.pose_filter import Presence
from cardbox_tracker.search.whole_body import WholeBodyFilter
from cardbox_tracker.terms.compiled import CompiledSilhouette
from cardbox_tracker.terms.joint_points import JointPoints
from cardbox_tracker.terms.term import Image, Silhouette, TermObservation
from cardbox_tracker.terms.whole_body import WholeBodyCost, iou_of

MIN_IOU, TOUCHING_IOU = 0.6, 0.2
"""Least IoU of a fitted body; below it the silhouette may not be a person. Least IoU of a body that
at least stands where the silhouette is."""

# Least share of the image of a person whom a detector finds.
_LEAST_DETECTED = 0.001
# Share of a person's rows in which a side of the image cuts them, from which it cuts the trunk.
_CUT = 0.3
# Distances that are tried if none is given, beside that of the body.
_DISTANCES_M = 0.9 * 1.2 ** np.arange(9)
_BREADTHS = [SIZE_INDEX[name] for name in BREADTHS]
_ROUNDS, _BODIES, _POSTURES = 6, 60, 12
# Standard deviations of the prior: of the logarithmic distance, the hip height, and the
# logarithmic breadths. Those between the shoulders' joints vary by 6 % among people (biacromial
# breadth of ANSUR II, both sexes), outlines with their clothes by more. The noise of a round is a
# fraction of them that shrinks.
_DISTANCE_SD, _HEIGHT_SD_M = 0.25, 0.10
_BREADTH_SD = {name: 0.06 if name == "shoulder_breadth" else 0.20 for name in BREADTHS}
_NOISE, _SHRINK = 0.5, 0.75
# Unit of the prior of a step along the line of sight, m.
_X_STEP_M = 0.06
# Cost of one standard deviation as a share of the silhouette's pixels.
_PRIOR = 0.003


def upper_body(
    silhouette: Silhouette, is_detected: bool = False, covered: Silhouette | None = None
) -> Silhouette | None:
    """Return the person of a silhouette (H, W), 0 or 255, which is its largest region, or None.

    It is None if the head is cut off, or a side of the image cuts the trunk, as of somebody who
    comes in, or the region is too large or too small; whom a detector finds may be smaller, and cut
    by a side. Nobody may be cut by a side of ``covered`` pixels (H, W), where the camera did not
    look: models have no side there.
    """
    seen = filled(silhouette)
    share = np.count_nonzero(seen) / seen.size
    least = _LEAST_DETECTED if is_detected else MIN_PERSON_FRACTION
    may_be_cut = is_detected and covered is None
    is_half = not may_be_cut and is_cut(seen, covered)
    if is_half or not least <= share <= MAX_PERSON_FRACTION or seen[0].any():
        return None
    return seen


def is_cut(seen: Silhouette, covered: Silhouette | None = None) -> bool:
    """Return whether a side of the image, or of ``covered`` pixels (H, W), cuts a trunk (H, W)."""
    sides = seen[:, [0, -1]]
    if covered is not None:
        before, after = seen[:, 1:] & covered[:, :-1], seen[:, :-1] & covered[:, 1:]
        sides = np.column_stack([before.any(axis=1), after.any(axis=1)])
    rows = np.count_nonzero(seen.any(axis=1))
    return bool(np.count_nonzero(sides, axis=0).max() > _CUT * rows)


@dataclass(frozen=True)
class FirstSight:
    """Result of a fit."""

    #: fitted body without unknown values; all are still unknown if the IoU is below ``MIN_IOU``.
    body: BodyModel
    iou: float  #: IoU of the fitted body and the silhouette


def fit_first_sight(
    body: BodyModel,
    camera: Camera,
    silhouette: Silhouette,
    image: Image | None,
    config: TrackerConfig,
    rng: np.random.Generator,
    points: ImagePoints | None = None,
) -> FirstSight:
    """Estimate the unknown values of a body from one silhouette (H, W) of :func:`upper_body`.

    The ``image``, (H, W, 3) bgr or (H, W), of the same frame teaches the colours. Its ``points``
    show a distance that is not given better than an outline with clothes does. Raises
    InitializationError if no body stands where the silhouette is.
    """
    camera = camera.with_pitch(body.camera_pose.pitch_rad)
    found, posture, iou = _Search(body, camera, (silhouette, points), config, rng).run()
    if iou < TOUCHING_IOU:
        raise InitializationError(
            f"no body of these proportions fits the silhouette (IoU {rounded_down(iou)}, expected "
            f"{MIN_IOU:.2f} or more)"
        )
    if image is not None and found.appearance is None:
        seen = image, silhouette, found, camera, posture
        found = found.with_values(appearance=seen_appearance(*seen))
    unknown = () if iou >= MIN_IOU else body.unknown
    return FirstSight(found.with_values(unknown=unknown), iou)


class _Search:
    """Alternating search of body and posture for one silhouette."""

    def __init__(
        self,
        body: BodyModel,
        camera: Camera,
        seen: tuple[Silhouette, ImagePoints | None],
        config: TrackerConfig,
        rng: np.random.Generator,
    ) -> None:
        self._prior, self._camera, (self._seen, self._points) = body, camera, seen
        terms = (one.build(body, camera) for one in config.terms if isinstance(one, JointPoints))
        # Points that contradict a given distance would keep all bodies from the outline.
        is_used = self._points is not None and "distance_m" in body.unknown
        self._terms = [*terms] if is_used else []
        self._observed: tuple[TermObservation, ...] = ()
        # A broad person must not be taken for a near one.
        cost = replace(config.whole_body.cost, x_step_m=_X_STEP_M)
        self._config = replace(config, whole_body=replace(config.whole_body, cost=cost))
        self._rng = rng
        unknown = body.unknown
        # Standard deviations of distance, hip height and breadths; 0 for known values.
        self._spread = np.array(
            [
                _DISTANCE_SD if "distance_m" in unknown else 0.0,
                _HEIGHT_SD_M if "hip_height_m" in unknown else 0.0,
                *[sd if name in unknown else 0.0 for name, sd in _BREADTH_SD.items()],
            ]
        )

    def run(self) -> tuple[BodyModel, FloatArray, float]:
        """Return the fitted body, its posture (12,), and its IoU."""
        self._base = self._prior
        if "distance_m" in self._prior.unknown:
            tried_m = [self._prior.placement.distance_m, *_DISTANCES_M.tolist()]
            placed = [self._standing(distance_m) for distance_m in tried_m]
            self._base = min(placed, key=lambda body: self._postures(body)[1][0])
        else:
            self._base = self._standing(self._prior.placement.distance_m)
        best, noise = np.zeros(len(self._spread)), _NOISE
        for _ in range(_ROUNDS):
            postures, _ = self._postures(self._body(best))
            steps = best + noise * self._rng.standard_normal((_BODIES, len(best)))
            steps[0] = best
            ratings = [self._rate(step, postures) for step in steps]
            best = steps[int(np.argmin(ratings))]
            noise *= _SHRINK
        body = self._body(best)
        postures, _ = self._postures(body)
        cost = self._cost(body, postures)
        rated = cost.bodies(postures)
        iou = iou_of(cost.silhouette_px, rated.areas_px[0], rated.costs_px[0])
        x_m, z_m = postures[0, PLACE].tolist()
        place, unknown = body.placement, body.unknown
        # Doubt and presence compare with the front posture there, which has to be in the image.
        sides_px = np.array([-self._camera.cx, self._camera.width - 1 - self._camera.cx])
        room_m = place.distance_m * np.abs(sides_px) / self._camera.fx
        most_m = np.sign(sides_px) * np.maximum(room_m - body.size("shoulder_breadth"), 0.0)
        body = body.with_values(
            distance_m=place.distance_m - (x_m if "distance_m" in unknown else 0.0),
            hip_height_m=place.hip_height_m + (z_m if "hip_height_m" in unknown else 0.0),
            lateral_m=float(np.clip(postures[0, TORSO_Y], *most_m)),
        )
        return body, postures[0, POSTURE], iou

    def _standing(self, distance_m: float) -> BodyModel:
        """Return the body at a distance, aligned with the silhouette's head."""
        body = self._prior.with_values(
            distance_m=distance_m, lateral_m=lateral_m(self._seen, self._camera, distance_m)
        )
        if "hip_height_m" not in self._prior.unknown:
            return body
        return at_height_of(self._seen, body, self._camera)

    def _body(self, steps: FloatArray) -> BodyModel:
        """Return the initial body changed by ``steps`` standard deviations."""
        values = steps * self._spread
        sizes = self._base.sizes.copy()
        sizes[_BREADTHS] *= np.exp(values[2:])
        place = self._base.placement
        return self._base.with_values(
            sizes=np.clip(sizes, SIZE_LIMITS[:, 0], SIZE_LIMITS[:, 1]),
            distance_m=float(place.distance_m * np.exp(values[0])),
            hip_height_m=float(place.hip_height_m + values[1]),
        )

    def _rate(self, steps: FloatArray, postures: FloatArray) -> float:
        own = np.sum(np.where(self._spread > 0, steps, 0.0) ** 2)
        return float(self._cost(self._body(steps), postures).bodies(postures).ratings.min()) + (
            _PRIOR * float(own)
        )

    def _cost(self, body: BodyModel, postures: FloatArray) -> WholeBodyCost:
        cost = WholeBodyCost(body, self._camera, self._config.whole_body.cost)
        cost.see(self._seen, postures[0])
        cost.terms = self._observed
        return cost

    def _postures(self, body: BodyModel) -> tuple[FloatArray, FloatArray]:
        """Return the best states (n, 14) of a body, best first, and their costs (n,)."""
        silhouette = CompiledSilhouette(body, self._camera)
        search = WholeBodyFilter(self._config, silhouette, self._rng)
        search.approach.is_fixed = True
        frame = silhouette.frame(self._seen)
        frame = frame.changed(channels={**frame.channels, "points": self._points})
        if search.look([frame]) is not Presence.PERSON:
            return np.zeros((1, N_STATE)), np.array([np.inf])
        observed = (term.observe(frame) for term in self._terms)
        self._observed = tuple(one for one in observed if one is not None)
        search.follow([frame], [self._terms])
        rated = search.rated
        order = np.argsort(rated.ratings, kind="stable")[:_POSTURES]
        return rated.states[order], rated.ratings[order]
