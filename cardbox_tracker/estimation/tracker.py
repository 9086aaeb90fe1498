"""Follow one person's posture from silhouette to silhouette, and say how well it went.

States: ``tracking``; ``no_person`` (too few foreground pixels for anybody); ``lost`` (somebody is
there, but the model has not fitted for several frames). Only ``tracking`` has a posture.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cardbox_tracker.body.cardbox import cardbox_patches
from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import clip_to_limits, reference_posture
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.config import TrackerConfig
from cardbox_tracker.estimation.cost.compiled import CompiledCost, CompiledKeypoints
from cardbox_tracker.estimation.cost.silhouette import Silhouette, SilhouetteCost
from cardbox_tracker.estimation.filtering.hierarchy import HierarchicalFilter
from cardbox_tracker.settings import restarts
from cardbox_tracker.vision.camera import Camera
from cardbox_tracker.vision.rasterisation import render

TRACKING, NO_PERSON, LOST = "tracking", "no_person", "lost"

# Somebody sideways shows about half the area of the front view, at the image's border less.
_PERSON_FRACTION = 0.25
_RECOVERY_CYCLES = 4
_RECOVERY_NOISE = 2.0


@dataclass(frozen=True)
class Estimate:
    """What one silhouette says.

    Attributes:
        state: ``tracking``, ``no_person`` or ``lost``; the rest is None unless ``tracking``.
        posture: d1..d12, (12,), rad and metres.
        posture_stddev: standard deviation of each joint over the particles, weighted by fit, (12,).
        keypoints_m: shoulder, elbow, hand of the left, then the right arm, (6, 3), metres in the
            optical frame.
        cost_px: equation (2) of the posture.
        iou: intersection over union of model and silhouette, above the hips.
    """

    state: str
    posture: FloatArray | None = None
    posture_stddev: FloatArray | None = None
    keypoints_m: FloatArray | None = None
    cost_px: int | None = None
    iou: float | None = None


class Tracker:
    """Tracks one measured person before one camera (paper, algorithm "Online Motion Tracking")."""

    def __init__(
        self,
        body: BodyModel,
        camera: Camera,
        config: TrackerConfig | None = None,
        rng: np.random.Generator | None = None,
        cost: SilhouetteCost | None = None,
    ) -> None:
        """Set up for ``body``; the camera is pitched as the body model says.

        Args:
            body: the measured person.
            camera: working camera, of the silhouettes' size.
            config: settings; the paper's by default.
            rng: source of all noise; seeded with 0 by default.
            cost: another implementation of the cost, for comparison.
        """
        self.body = body
        self.camera = camera.with_pitch(body.camera_pitch_rad)
        self.config = config or TrackerConfig()
        self._rng = rng or np.random.default_rng(0)
        self._cost = cost or CompiledCost(body, self.camera)
        self._keypoints = CompiledKeypoints(body, self.camera)
        self._reference = reference_posture("front")
        self._reference[0] = body.lateral_m
        model = render(cardbox_patches(body, self._reference), self.camera, self._cost.rows)
        self._min_person_px = max(1, int(_PERSON_FRACTION * np.count_nonzero(model)))
        self.reset()

    def reset(self) -> None:
        """Forget the posture: the next silhouette is tracked from the front reference posture."""
        self._filter = HierarchicalFilter(
            self._cost, self.config, self.camera.width * self.camera.height, self._rng.spawn(1)[0]
        )
        self._started = False
        self._poor_frames = 0

    def configure(self, config: TrackerConfig) -> bool:
        """Use other settings from the next silhouette on.

        Returns:
            True if they need other particles, so that tracking starts again as after
            :meth:`reset`.
        """
        is_new_start = restarts(self.config, config)
        self.config = config
        if is_new_start:
            self.reset()
        return is_new_start

    def track(self, silhouette: Silhouette) -> Estimate:
        """Estimate the posture behind ``silhouette`` (H, W), 0 or 255.

        Raises:
            ValueError: the silhouette has not the camera's size.
        """
        self._cost.observe(silhouette)
        if self._cost.silhouette_px < self._min_person_px:
            if self.config.relocalize and self._started:
                # Whoever comes back may stand elsewhere: begin again when somebody is there.
                self._started = False
            return Estimate(NO_PERSON)
        posture = self._start(silhouette) if not self._started else self._follow()
        cost_px, iou = self._cost.overlap(posture)
        self._poor_frames = self._poor_frames + 1 if iou < self.config.lost_iou else 0
        if self._poor_frames >= self.config.lost_frames:
            if self.config.relocalize:
                self._started = False
            return Estimate(LOST)
        return Estimate(
            TRACKING,
            posture,
            self._filter.stddev(posture),
            self._keypoints(posture),
            cost_px,
            iou,
        )

    def _follow(self) -> FloatArray:
        for cycle in range(self.config.cycles):
            explore = self.config.explore if cycle == 0 else 0.0
            posture = self._filter.cycle(self.config.noise_decay**cycle, explore)
        return posture

    def _start(self, silhouette: Silhouette) -> FloatArray:
        """Scatter around the front reference where the person stands, then settle."""
        self._started = True
        reference = self._reference.copy()
        if self.config.relocalize:
            reference[0] = self._lateral_m(silhouette)
        posture = self._filter.scatter(clip_to_limits(reference))
        if self.config.relocalize:
            for cycle in range(_RECOVERY_CYCLES):
                posture = self._filter.cycle(_RECOVERY_NOISE * self.config.noise_decay**cycle)
        return posture

    def _lateral_m(self, silhouette: Silhouette) -> float:
        """``torso_y`` under which the silhouette's median column lies."""
        columns = np.count_nonzero(silhouette[: self._cost.rows], axis=0).cumsum()
        middle = int(np.searchsorted(columns, columns[-1] / 2))
        return float((middle - self.camera.cx) / self.camera.fx * self.body.distance_m)
