"""Follow one person's posture from silhouette to silhouette, and say how well it went.

States: ``tracking``; ``uncertain`` (a posture that may be wrong); ``lost`` (somebody is there, but
the model has not fitted for several frames); ``no_person`` (too few foreground pixels for anybody).
Only ``tracking`` and ``uncertain`` have a posture.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cardbox_tracker.body.cardbox import cardbox_patches
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import clip_to_limits, reference_posture
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.config import TrackerConfig
from cardbox_tracker.estimation.cost.compiled import CompiledKeypoints, CompiledSilhouette
from cardbox_tracker.estimation.cost.silhouette import SilhouetteTerm
from cardbox_tracker.estimation.cost.terms import (
    Image,
    Silhouette,
    SumOfTerms,
    Term,
    TermObservation,
)
from cardbox_tracker.estimation.filtering.hierarchy import HierarchicalFilter
from cardbox_tracker.estimation.filtering.pose_filter import PoseFilter
from cardbox_tracker.settings import restarts
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.rasterisation import render

TRACKING, UNCERTAIN, LOST, NO_PERSON = "tracking", "uncertain", "lost", "no_person"

# Somebody sideways shows about half the area of the front view, at the image's border less.
_PERSON_FRACTION = 0.25
_RECOVERY_CYCLES = 4
_RECOVERY_NOISE = 2.0


@dataclass(frozen=True)
class Estimate:
    """What one silhouette says.

    Attributes:
        state: ``tracking``, ``uncertain``, ``lost`` or ``no_person``; the rest is None unless it is
            one of the first two.
        posture: d1..d12, (12,), rad and metres.
        posture_stddev: standard deviation of each joint over the particles, weighted by fit, (12,).
        keypoints_m: shoulder, elbow, hand of the left, then the right arm, (6, 3), metres in the
            optical frame.
        cost_px: equation (2) of the posture.
        iou: intersection over union of model and silhouette, above the hips.
        offset_m: ``torso_x`` and ``torso_z``, (2,): how far the hips are nearer to the camera, and
            higher, than the body model's placement; None if the filter keeps them constant.
        offset_stddev_m: their standard deviations, (2,).
    """

    state: str
    posture: FloatArray | None = None
    posture_stddev: FloatArray | None = None
    keypoints_m: FloatArray | None = None
    cost_px: int | None = None
    iou: float | None = None
    offset_m: FloatArray | None = None
    offset_stddev_m: FloatArray | None = None

    def placed(self, body: BodyModel) -> BodyModel:
        """Return ``body`` where this estimate finds it."""
        if self.offset_m is None:
            return body
        x_m, z_m = self.offset_m.tolist()
        place = body.placement
        return body.with_values(
            distance_m=place.distance_m - x_m, hip_height_m=place.hip_height_m + z_m
        )


MakeFilter = Callable[[TrackerConfig, int, np.random.Generator], PoseFilter]
"""Takes settings, pixels of an image and the source of random numbers; returns a new filter."""


class Tracker:
    """Tracks one measured person before one camera (paper, algorithm "Online Motion Tracking")."""

    def __init__(
        self,
        body: BodyModel,
        camera: Camera,
        config: TrackerConfig | None = None,
        rng: np.random.Generator | None = None,
        silhouette: SilhouetteTerm | None = None,
        make_filter: MakeFilter = HierarchicalFilter,
    ) -> None:
        """Set up for ``body``; the camera is pitched as the body model says.

        Args:
            body: the measured person.
            camera: working camera, of the silhouettes' size.
            config: settings; the paper's by default.
            rng: source of all noise; seeded with 0 by default.
            silhouette: another implementation of the silhouette's term, for comparison.
            make_filter: another filter than the hierarchical one.
        """
        self.body = body
        self.camera = camera.with_pitch(body.camera_pose.pitch_rad)
        self.config = config or TrackerConfig()
        self._rng = rng or np.random.default_rng(0)
        self._silhouette = silhouette or CompiledSilhouette(body, self.camera)
        self._terms = self._built(self.config)
        self._make_filter = make_filter
        self._keypoints = CompiledKeypoints(body, self.camera)
        self._reference = reference_posture("front")
        self._reference[0] = body.placement.lateral_m
        model = render(cardbox_patches(body, self._reference), self.camera, self._silhouette.rows)
        self._min_person_px = max(1, int(_PERSON_FRACTION * np.count_nonzero(model)))
        self.reset()

    def _built(self, config: TrackerConfig) -> list[Term]:
        return [settings.build(self.body, self.camera) for settings in config.terms]

    def reset(self) -> None:
        """Forget the posture: the next silhouette is tracked from the front reference posture."""
        image_px = self.camera.width * self.camera.height
        self._filter = self._make_filter(self.config, image_px, self._rng.spawn(1)[0])
        self._started = False
        self._poor_frames = 0

    def configure(self, config: TrackerConfig) -> bool:
        """Use other settings from the next silhouette on.

        Returns:
            True if they need other particles, so that tracking starts again as after
            :meth:`reset`.
        """
        is_new_start = restarts(self.config, config)
        if config.terms != self.config.terms:
            self._terms = self._built(config)
        self.config = config
        if is_new_start:
            self.reset()
        return is_new_start

    def track(self, silhouette: Silhouette, image: Image | None = None) -> Estimate:
        """Estimate the posture behind a silhouette.

        Args:
            silhouette: (H, W), 0 or 255, of the camera's size.
            image: (H, W) grey or (H, W, 3) bgr of the same frame, for terms that use it.

        Raises:
            ValueError: silhouette or image has not the camera's size.
        """
        before = self._filter.estimate() if self._started else None
        frame = self._silhouette.frame(silhouette, image, before)
        if frame.foreground_px < self._min_person_px:
            if self.config.relocalize and self._started:
                # The person may come back elsewhere: search anew as soon as there is one.
                self._started = False
            return Estimate(NO_PERSON)
        seen = self._silhouette.observe(frame)
        observation = SumOfTerms((seen, *(term.observe(frame) for term in self._terms)))
        if self._started:
            self._follow(observation)
        else:
            self._start(observation, silhouette)
        posture = self._filter.estimate()
        cost_px, iou = seen.overlap(posture)
        self._poor_frames = self._poor_frames + 1 if iou < self.config.lost_iou else 0
        if self._poor_frames >= self.config.lost_frames:
            if self.config.relocalize:
                self._started = False
            return Estimate(LOST)
        return Estimate(
            TRACKING, posture, self._filter.stddev(), self._keypoints(posture), cost_px, iou
        )

    def _follow(self, observation: TermObservation) -> None:
        """Run the cycles of one frame, with falling noise; the first one explores."""
        for cycle in range(self.config.cycles):
            explore = self.config.explore if cycle == 0 else 0.0
            self._filter.iterate(observation, self.config.noise_decay**cycle, explore)

    def _start(self, observation: TermObservation, silhouette: Silhouette) -> None:
        """Start around the front reference where the person stands, then settle."""
        self._started = True
        reference = self._reference.copy()
        if self.config.relocalize:
            reference[0] = self._lateral_m(silhouette)
        self._filter.initialize(observation, clip_to_limits(reference))
        if self.config.relocalize:
            for cycle in range(_RECOVERY_CYCLES):
                noise_scale = _RECOVERY_NOISE * self.config.noise_decay**cycle
                self._filter.iterate(observation, noise_scale)

    def _lateral_m(self, silhouette: Silhouette) -> float:
        """``torso_y`` under which the silhouette's median column lies."""
        columns = np.count_nonzero(silhouette[: self._silhouette.rows], axis=0).cumsum()
        middle = int(np.searchsorted(columns, columns[-1] / 2))
        offset_m = (middle - self.camera.cx) / self.camera.fx * self.body.placement.distance_m
        return float(offset_m)
