"""Adapter of the hierarchical filter to the tracker: cycles per frame, start, recovery, fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from cardbox_tracker.camera.rasterisation import render
from cardbox_tracker.camera.view import View
from cardbox_tracker.person.cardbox import cardbox_patches
from cardbox_tracker.person.kinematics import pose
from cardbox_tracker.person.posture import TORSO_Y, clip_to_limits, reference_posture
from cardbox_tracker.search import doubt
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.search.hierarchy import HierarchicalFilter, SumOfTerms
from cardbox_tracker.search.pose_filter import Fit, Presence
from cardbox_tracker.terms.kernel_arguments import body_tuple
from cardbox_tracker.terms.silhouette import SilhouetteTerm
from cardbox_tracker.terms.term import Frame, Silhouette, Term

# A person from the side has about half the area of the front view, and less at the border.
_PERSON_FRACTION = 0.25
_RECOVERY_CYCLES = 4
_RECOVERY_NOISE = 2.0

MakeHierarchy = Callable[[TrackerConfig, int, np.random.Generator], HierarchicalFilter]


class Cycles:
    """The paper's algorithm "Online Motion Tracking" as a :class:`~.pose_filter.PoseFilter`."""

    def __init__(
        self,
        config: TrackerConfig,
        silhouette: SilhouetteTerm,
        rng: np.random.Generator,
        views: Sequence[View] = (),
        make_hierarchy: MakeHierarchy = HierarchicalFilter,
    ) -> None:
        """Prepare as ``MakeFilter``; raise ValueError if there are ``views``, as it has one camera.

        ``make_hierarchy`` takes settings, pixels of an image and random numbers.
        """
        if views:
            raise ValueError("the filter hierarchical has one camera; whole_body takes several")
        self._config, self._term = config, silhouette
        body, camera = silhouette.body, silhouette.camera
        self.hierarchy = make_hierarchy(config, camera.width * camera.height, rng)
        self._rigid = body.rigid
        self._posable = body_tuple(self._rigid, camera)
        self._reference = reference_posture("front")
        self._reference[TORSO_Y] = body.placement.lateral_m
        model = render(cardbox_patches(body, self._reference), camera, silhouette.rows)
        self._person_px = max(1, int(np.count_nonzero(model)))
        self._min_person_px = max(1, int(_PERSON_FRACTION * np.count_nonzero(model)))
        self._doubt = doubt.Doubt()
        self._started = False
        self._iou: float | None = None

    def ious(self) -> list[float | None]:
        """See :class:`PoseFilter`."""
        return [self._iou]

    def look(self, frames: Sequence[Frame]) -> Presence:
        """See :class:`PoseFilter`."""
        self._iou = None
        is_there = frames[0].foreground_px >= self._min_person_px
        return Presence.PERSON if is_there else Presence.NOBODY

    def forget(self) -> None:
        """See :class:`PoseFilter`."""
        self._started = False
        self._doubt.forget()

    def recover(self) -> None:
        """See :class:`PoseFilter`."""
        self._started = False

    def configure(self, config: TrackerConfig) -> None:
        """See :class:`PoseFilter`."""
        self._config = config

    def follow(self, frames: Sequence[Frame], terms: Sequence[Sequence[Term]]) -> Fit:
        """See :class:`PoseFilter`."""
        (frame,), (further,) = frames, terms
        seen = self._term.observe(frame)
        observed = (term.observe(frame) for term in further)
        observation = SumOfTerms(seen, [one for one in observed if one is not None], self._posable)
        if self._started:
            for _ in range(self._config.cycles):
                self.hierarchy.iterate(observation)
        else:
            self._start(frame, observation)
        posture = self.hierarchy.estimate()
        cost_px, iou = seen.overlap(posture)
        self._iou = iou
        is_poor = iou < self._config.lost_iou
        keypoints_m = pose(self._rigid, posture, self._term.camera.pitch_rad).keypoints_m
        stddev = self.hierarchy.stddev()
        area = frame.foreground_px / self._person_px
        evidence = doubt.evidence_of_particles(iou, area, posture, stddev, self._posable)
        judged = self._doubt.judge(evidence, doubt.Source.PAPER, np.zeros(6, np.bool_))
        return Fit(posture, stddev, keypoints_m, cost_px, iou, is_poor, judged=judged)

    def _start(self, frame: Frame, observation: SumOfTerms) -> None:
        """Start around the front reference at the person's place, then run the first cycles."""
        self._started = True
        reference = self._reference.copy()
        if self._config.relocalize:
            reference[TORSO_Y] = self._lateral_m(frame.silhouette)
        self.hierarchy.initialize(observation, clip_to_limits(reference))
        if self._config.relocalize:
            for _ in range(_RECOVERY_CYCLES):
                self.hierarchy.iterate(observation, _RECOVERY_NOISE)

    def _lateral_m(self, silhouette: Silhouette) -> float:
        """Return ``torso_y`` of the silhouette's median column, metres."""
        camera = self._term.camera
        columns = np.count_nonzero(silhouette[: self._term.rows], axis=0).cumsum()
        middle = int(np.searchsorted(columns, columns[-1] / 2))
        offset_m = (middle - camera.cx) / camera.fx * self._term.body.placement.distance_m
        return float(offset_m)
