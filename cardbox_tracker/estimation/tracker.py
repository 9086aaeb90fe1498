"""Follow one person's posture from silhouette to silhouette, and say how well it went."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType

import numpy as np

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.sizes import FloatArray
from cardbox_tracker.estimation.camera_agreement import CameraAgreement
from cardbox_tracker.estimation.config import TrackerConfig
from cardbox_tracker.estimation.cost.compiled import CompiledSilhouette
from cardbox_tracker.estimation.cost.silhouette import SilhouetteTerm
from cardbox_tracker.estimation.cost.terms import (
    USUAL_INTERVAL_S,
    DepthImage,
    Image,
    Silhouette,
    Term,
)
from cardbox_tracker.estimation.cost.view import OtherCamera, View
from cardbox_tracker.estimation.estimate import (
    LOST,
    NO_PERSON,
    TRACKING,
    UNCERTAIN,
    Estimate,
)
from cardbox_tracker.estimation.filtering.cycles import Cycles
from cardbox_tracker.estimation.filtering.multi_view import MultiViewFilter
from cardbox_tracker.estimation.filtering.particles import Particles
from cardbox_tracker.estimation.filtering.pose_filter import MakeFilter, PoseFilter, Sight
from cardbox_tracker.estimation.filtering.whole_body import WholeBodyFilter
from cardbox_tracker.estimation.fitting import Fitting
from cardbox_tracker.estimation.further_camera import FurtherCamera
from cardbox_tracker.estimation.person_region import PersonRegion
from cardbox_tracker.estimation.sampling import likely_postures
from cardbox_tracker.settings import restarts
from cardbox_tracker.vision.camera import Camera

FILTERS: MappingProxyType[str, MakeFilter] = MappingProxyType(
    {"hierarchical": Cycles, "whole_body": WholeBodyFilter}
)
"""The filters by the names that ``TrackerConfig.filter`` may have."""


class Tracker:
    """Tracks one measured person (paper, algorithm "Online Motion Tracking").

    Attributes:
        agreement: whether several cameras stand where their extrinsics say; None of one camera.
    """

    def __init__(
        self,
        body: BodyModel,
        camera: Camera,
        config: TrackerConfig | None = None,
        rng: np.random.Generator | None = None,
        silhouette: SilhouetteTerm | None = None,
        make_filter: MakeFilter | None = None,
        others: Sequence[OtherCamera] = (),
    ) -> None:
        """Set up for ``body``; the camera is pitched as the body model says.

        Args:
            body: the person. What is unknown of them is fitted while tracking, which replaces
                the attribute ``body``. Until then, no estimate is better than ``uncertain``.
            camera: working camera, of the silhouettes' size.
            config: settings; the paper's by default.
            rng: source of all noise; seeded with 0 by default.
            silhouette: another implementation of the silhouette's term, for comparison.
            make_filter: another filter than that of the settings.
            others: further cameras, for :meth:`track_views`; they need the filter ``whole_body``.

        Raises:
            CameraError: the person was not measured in front of one of ``others``.
            ValueError: there are ``others``, and another filter.
        """
        self.camera = camera.with_pitch(body.camera_pose.pitch_rad)
        self.config = config or TrackerConfig()
        self._rng = rng or np.random.default_rng(0)
        self._make_filter = make_filter
        self._others = tuple(others)
        if others and (make_filter or not self.config.has_several_views):
            raise ValueError("several cameras need the filter whole_body: the preset default")
        self._fitting = None
        if body.unknown:
            fits = self._rng.spawn(1)[0]
            self._fitting = Fitting(body, self.camera, self.config, fits)
        self._use(body, silhouette or CompiledSilhouette(body, self.camera))

    def _use(self, body: BodyModel, silhouette: SilhouetteTerm) -> None:
        """Track ``body`` from the next silhouette on."""
        self.body, self._silhouette = body, silhouette
        self._terms = self._built(self.config)
        self._further = [
            FurtherCamera(body, self.camera, other, self.config) for other in self._others
        ]
        views = [further.view for further in self._further]
        self.agreement = CameraAgreement(body, self.camera, views) if views else None
        self.reset()

    def _built(self, config: TrackerConfig) -> list[Term]:
        return [settings.build(self.body, self.camera) for settings in config.terms]

    def reset(self) -> None:
        """Forget the posture: the next silhouette is tracked from the front reference posture."""
        make_filter = self._make_filter or FILTERS[self.config.filter]
        if self._further:
            make_filter = partial(MultiViewFilter, self._further)
        for further in self._further:
            further.reset(self.config)
        self._filter = make_filter(self.config, self._silhouette, self._rng.spawn(1)[0])
        self._region = PersonRegion(self.body, self.camera) if self.config.select_person else None
        self._poor_frames = 0
        self._stamp_ns: int | None = None
        self._particles: Particles | None = None
        # What terms may know of the frame before: d1..d12, and torso_x, torso_z where estimated.
        self._before: FloatArray | None = None
        # How well the last result fitted before it was corrected.
        self._seen_iou = 0.0

    def configure(self, config: TrackerConfig) -> bool:
        """Use other settings from the next silhouette on.

        Returns:
            True if they need other particles, so that tracking starts again as after
            :meth:`reset`.
        """
        is_new_start = restarts(self.config, config)
        if config.terms != self.config.terms:
            self._terms = self._built(config)
            for further in self._further:
                further.configure(config)
        self.config = config
        if is_new_start:
            self.reset()
        else:
            self._filter.configure(config)
        return is_new_start

    @property
    def filter(self) -> PoseFilter:
        """What searches the postures; for tools that want to know more than the estimate."""
        return self._filter

    @property
    def views(self) -> tuple[View, ...]:
        """How the further cameras see the body."""
        return tuple(further.view for further in self._further)

    def camera_ious(self) -> list[float | None]:
        """Return how well the last estimate fits what each of several cameras saw.

        Returns:
            IoU by camera, the first camera's first; None of one that saw nobody. Empty of one
            camera, of which the estimate has it.
        """
        return self._filter.ious() if isinstance(self._filter, MultiViewFilter) else []

    def _person_in(self, silhouette: Silhouette, image: Image | None) -> Silhouette:
        """Return what of a silhouette can be the person; raises ValueError for a wrong size."""
        if self._region is None:
            return silhouette
        self._silhouette.frame(silhouette, image)
        return self._region.select(silhouette, self._before, self._poor_frames == 0, image)

    def track(
        self, silhouette: Silhouette, image: Image | None = None, stamp_ns: int | None = None
    ) -> Estimate:
        """Estimate the posture behind a silhouette.

        Args:
            silhouette: (H, W), 0 or 255, of the camera's size.
            image: (H, W) grey or (H, W, 3) bgr of the same frame, for terms that use it.
            stamp_ns: when it was taken; None: 1/15 s after the one before.

        Raises:
            ValueError: silhouette or image has not the camera's size.
        """
        return self.track_views([silhouette], [image], stamp_ns=stamp_ns)

    def track_views(
        self,
        silhouettes: Sequence[Silhouette | None],
        images: Sequence[Image | None],
        depth_m: DepthImage | None = None,
        stamp_ns: int | None = None,
    ) -> Estimate:
        """Estimate the posture behind what all cameras see at one time.

        Args:
            silhouettes: of the first camera, then of ``others``, each as for :meth:`track`; None
                of a camera that has none for this time. It is left out, and so is one that sees
                nobody. Without any for the last cameras they may be missing.
            images: of the same cameras.
            depth_m: (H, W) of the first camera, metres along its optical axis, for the term
                ``Depth``; not finite or 0 where it is not known.
            stamp_ns: as for :meth:`track`.

        Raises:
            ValueError: a silhouette or an image has not its camera's size.
        """
        is_sure, missing = self._poor_frames == 0, [None] * len(self._further)
        self._others_now = tuple(
            further.frame(seen, picture, self._before, is_sure)
            for further, seen, picture in zip(
                self._further, [*silhouettes[1:], *missing], [*images[1:], *missing], strict=False
            )
        )
        self._depth_m = depth_m
        before_ns, self._stamp_ns = self._stamp_ns, stamp_ns
        self._interval_s = USUAL_INTERVAL_S
        if stamp_ns is not None and before_ns is not None and stamp_ns > before_ns:
            self._interval_s = (stamp_ns - before_ns) / 1e9
        silhouette, image = silhouettes[0], images[0]
        if silhouette is None:
            silhouette, image = np.zeros((self.camera.height, self.camera.width), np.uint8), None
        else:
            silhouette = self._person_in(silhouette, image)
        if self._fitting is None:
            return self._track(silhouette, image)
        fitted = self._fitting.before(silhouette, image)
        if fitted is not None:
            self._use(fitted, CompiledSilhouette(fitted, self.camera))
        estimate = self._track(silhouette, image)
        iou = None if estimate.iou is None else self._seen_iou
        self._fitting.after(estimate.state != NO_PERSON, iou)
        if estimate.posture is not None:
            there = estimate.placed(self.body)
            self._fitting.compare(silhouette, image, there, estimate.posture)
        if self.body.unknown and estimate.state == TRACKING:
            return replace(estimate, state=UNCERTAIN)
        return estimate

    def sample(self, estimate: Estimate, count: int, rng: np.random.Generator) -> FloatArray:
        """Return postures (count, 12) as likely as the last ``estimate``: ``likely_postures``."""
        found = estimate.posture, estimate.posture_stddev, estimate.offset_m
        return likely_postures(*found, self._particles, count, rng)

    def _track(self, silhouette: Silhouette, image: Image | None) -> Estimate:
        frame = self._silhouette.frame(silhouette, image, self._before)
        frame = replace(
            frame,
            others=self._others_now,
            depth_m=self._depth_m,
            interval_s=self._interval_s,
            stamp_ns=self._stamp_ns,
        )
        sight = self._filter.look(frame)
        if sight is Sight.NOBODY:
            self._before = None
            if self.config.relocalize:
                # The person may come back elsewhere.
                self._filter.forget()
            return Estimate(NO_PERSON)
        if sight is Sight.TOO_MUCH:
            # A lamp goes on, a door opens: soon the person is where they were.
            return Estimate(LOST)
        fit = self._filter.follow(self._terms)
        self._particles = fit.particles
        if not fit.is_finite:
            # Particles that are not numbers would stay so for ever.
            self.reset()
            return Estimate(LOST)
        self._before, self._seen_iou = fit.seen, fit.seen_iou
        self._poor_frames = self._poor_frames + 1 if fit.is_poor else 0
        if self._poor_frames >= self.config.lost_frames:
            if self.config.relocalize:
                self._filter.recover()
            return Estimate(LOST)
        if self.agreement is not None and fit.offset_m is not None:
            seen = [other.silhouette for other in self._others_now]
            self.agreement.see(self._before, frame.silhouette, seen)
        return Estimate(
            UNCERTAIN if fit.is_uncertain else TRACKING,
            fit.posture,
            fit.posture_stddev,
            fit.keypoints_m,
            fit.cost_px,
            fit.iou,
            fit.offset_m,
            fit.offset_stddev_m,
        )
