"""Tracking of one person's posture over silhouettes, with a confidence for each frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import zip_longest
from types import MappingProxyType

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.tilt import tilted_states
from cardbox_tracker.camera.view import OtherCamera, View
from cardbox_tracker.common.settings import all_of_kind, of_kind, restarts, settings_or
from cardbox_tracker.person.kinematics import clavicles
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.search.doubt import BACK, doubted
from cardbox_tracker.search.hierarchy import Cycles
from cardbox_tracker.search.particles import Particles, likely_postures
from cardbox_tracker.search.pose_filter import MakeFilter, PoseFilter, Presence
from cardbox_tracker.search.whole_body import WholeBodyFilter
from cardbox_tracker.terms.compiled import CompiledSilhouette
from cardbox_tracker.terms.inner_cue import InnerCueTerm
from cardbox_tracker.terms.silhouette import SilhouetteTerm
from cardbox_tracker.terms.term import USUAL_INTERVAL_S, Frame, Image, Posed, Silhouette
from cardbox_tracker.tracking.camera_agreement import CameraAgreement
from cardbox_tracker.tracking.camera_faults import CameraFaults
from cardbox_tracker.tracking.estimate import (
    CONTRADICTED,
    LOST,
    NO_PERSON,
    TRACKING,
    UNCERTAIN,
    Estimate,
)
from cardbox_tracker.tracking.facing import Facing
from cardbox_tracker.tracking.hands import HandReader, Look
from cardbox_tracker.tracking.head import HeadTracker
from cardbox_tracker.tracking.legs import LegReader
from cardbox_tracker.tracking.observation import Observation, Observations, listed, stamp_of
from cardbox_tracker.tracking.place import PlaceWatch
from cardbox_tracker.tracking.tracked_camera import TrackedCamera

FILTERS: MappingProxyType[str, MakeFilter] = MappingProxyType(
    {"hierarchical": Cycles, "whole_body": WholeBodyFilter}
)
"""Filter classes by the values of ``TrackerConfig.filter``."""

# A model that overlaps the silhouette less than this is somewhere else.
_TOUCHING_IOU = 0.05


class Tracker:
    """Tracks one person of a known body (paper, algorithm "Online Motion Tracking").

    Attributes:
        body: the person's present version.
        cameras: the body before each camera, the first one first.
        agreement: check of the extrinsics of several cameras; None with one camera.
        faults: cameras that are left out for a while.
        images: number of times that were tracked.
        used: in how many of them each optional input told of the posture, by its name.
        empty: number of last images in a row in which nobody was.
        place: how surely it is known where the person is.
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
        look: Look | None = None,
    ) -> None:
        """Set up for ``body``; the camera, of the silhouettes' size, gets the pitch of the model.

        Settings are the paper's by default, and noise is seeded with 0. ``silhouette`` and
        ``make_filter`` replace the compiled term and the filter of the settings. ``look`` finds
        the points of hands in images of the first camera. ``others``, the further cameras, need
        the filter ``whole_body``. If the body is not known, estimates are at best ``uncertain``.

        Raises CameraError if the person was not measured in front of one of ``others``, and
        ValueError if there are others, but the filter takes one camera, or if body, camera or
        settings are of another class.
        """
        body = of_kind("body", body, BodyModel)
        self.camera = of_kind("camera", camera, Camera).with_pitch(body.camera_pose.pitch_rad)
        self.config = settings_or(TrackerConfig(), config)
        self._rng = settings_or(np.random.default_rng(0), rng, "rng")
        others = all_of_kind("others", others, OtherCamera)
        self._make_filter, self._look, self._is_alone = make_filter, look, not others
        if others and (make_filter or not self.config.has_several_views):
            raise ValueError("several cameras need the filter whole_body: the preset default")
        self.body = self.config.with_shoulders(body)
        self.cameras = [
            TrackedCamera(self.body, self.camera, self.config, other) for other in (None, *others)
        ]
        self.place = PlaceWatch(body, self.camera)
        self.agreement: CameraAgreement | None = None
        self.faults = CameraFaults(len(self.cameras))
        self.images, self.used, self.empty = 0, dict[str, int](), 0
        self._silhouette = silhouette or CompiledSilhouette(body, self.camera)
        self._compare()
        self.reset()

    def _compare(self) -> None:
        """Compare cameras and floor with the present body."""
        if views := self.views:
            self.agreement = CameraAgreement(self.body, self.camera, views, self.agreement)
        self._legs = LegReader(self.body, self.camera)

    def reset(self) -> None:
        """Forget the posture; the next frame is tracked from the front reference posture."""
        make_filter = self._make_filter or FILTERS[self.config.filter]
        for camera in self.cameras:
            camera.reset(self.config)
        self._now_ns = 0
        rng = self._rng.spawn(1)[0]
        self._filter = make_filter(self.config, self._silhouette, rng, self.views)
        self._head = HeadTracker(self.body, self.camera)
        self._legs.forget()
        self._hands = None if self._look is None else HandReader(self._look)
        # The outlines of several cameras determine the direction; the paper has no such doubt.
        has_doubt = self.config.has_several_views and self._is_alone
        self._facing = Facing(self.body) if has_doubt else None
        self._poor_frames = 0
        self._last_ns: int | None = None
        self._particles: Particles | None = None
        # State (14,) of the previous frame for the terms.
        self._before: FloatArray | None = None

    def use(self, body: BodyModel, stamp_ns: int | None = None, is_new_start: bool = False) -> None:
        """Track the next version of the body from the image of a stamp on.

        The posture goes on, at the same place before the camera if its pitch or the placement is
        another one, unless ``is_new_start`` says that it is somebody else or somewhere else, or
        the filter is the paper's.
        """
        before, pose = self.body, body.camera_pose
        body = replace(body, version=before.version + 1, stamp_ns=stamp_ns or 0)
        self.body = self.config.with_shoulders(body)
        moved = partial(tilted_states, before=before, after=self.body)
        is_moved = (pose, body.placement) != (before.camera_pose, before.placement)
        if is_moved:
            self.camera = self.camera.with_pitch(pose.pitch_rad)
            is_same = pose == before.camera_pose and not is_new_start
            self.place = PlaceWatch(self.body, self.camera, self.place if is_same else None)
            if self._before is not None:
                self._before = moved(self._before[None])[0]
        self._silhouette = CompiledSilhouette(self.body, self.camera)
        for camera in self.cameras:
            camera.use(self.body, self.camera, self.config)
        self._compare()
        if is_new_start or not isinstance(self._filter, WholeBodyFilter):
            self.reset()
            return
        self._filter.use(self._silhouette, self.views)
        self._head = HeadTracker(self.body, self.camera)
        if is_moved:
            self._filter.move(moved)

    def configure(self, config: TrackerConfig) -> bool:
        """Use other settings from the next frame on; return whether tracking starts again."""
        is_new_start = restarts(self.config, of_kind("config", config, TrackerConfig))
        if config.terms != self.config.terms:
            for camera in self.cameras:
                camera.configure(config)
        self.config = config
        if is_new_start:
            self.reset()
        else:
            self._filter.configure(config)
        return is_new_start

    @property
    def arm_m(self) -> float:
        """Length of an arm of the body, m, which is proportional to the stature."""
        return self.body.size("upper_arm_length") + self.body.size("forearm_length")

    @property
    def filter(self) -> PoseFilter:
        """The particle filter, for tools that need more than the estimate."""
        return self._filter

    @property
    def views(self) -> tuple[View, ...]:
        """Views of the body from the further cameras."""
        return tuple(camera.view for camera in self.cameras if camera.view is not None)

    def remarks(self, names: Sequence[str] = (), is_all: bool = False) -> list[str]:
        """Return warnings about images that contradict each other, see :class:`.CameraFaults`."""
        depths = (camera.depth.remark() for camera in self.cameras)
        found = *self.faults.remarks(names, is_all), *depths, self.place.contradiction
        return [text for text in found if text]

    def track(
        self,
        observations: Observations | Observation | Silhouette,
        image: Image | None = None,
        stamp_ns: int | None = None,
    ) -> Estimate:
        """Estimate the posture from the observations of all cameras at one time.

        There is one for each camera, the first one first. A camera without data has None or an
        observation without a silhouette, and may be missing at the end. A single observation or
        silhouette (H, W) belongs to the first camera; ``image``, (H, W) grey or (H, W, 3) bgr, and
        ``stamp_ns`` go with a bare silhouette. Masks of any numeric type are silhouettes, see
        :func:`~cardbox_tracker.camera.given_arrays.silhouette_from`. Without a stamp, the interval
        to the previous frame is 1/15 s.

        Raises ValueError if the size of an array is not its camera's, its type or values are
        impossible, points are no ImagePoints, or the arguments do not go together.
        """
        if self.body.unknown:
            raise ValueError(
                f"the body has unknown values ({', '.join(self.body.unknown)}), which a Session "
                "measures: Session([body], camera).track(observations)"
            )
        return self.follow(self.frames(listed(observations, len(self.cameras), image, stamp_ns)))

    def frames(self, observations: Observations) -> list[Frame]:
        """Return what the cameras show of the person: checked, upright, without other people.

        The frame of a camera without data, or that is wrong, is empty. Raises what :meth:`track`
        does.
        """
        if not self._is_alone:
            observations = self.faults.without(observations, stamp_of(observations))
        stamp_ns, before_ns = stamp_of(observations), self._last_ns
        self._last_ns, interval_s = stamp_ns, USUAL_INTERVAL_S
        if stamp_ns is not None and before_ns is not None and stamp_ns > before_ns:
            interval_s = (stamp_ns - before_ns) / 1e9
        self._now_ns = self._now_ns + round(1e9 * interval_s) if stamp_ns is None else stamp_ns
        given = self._before, self._poor_frames == 0, interval_s, self._now_ns
        frames = [
            camera.frame(observation, *given)
            for camera, observation in zip_longest(self.cameras, observations)
        ]
        if self.agreement is not None:
            frames = self.faults.agreeing(frames, self.agreement)
        return frames

    def again(self, frames: Sequence[Frame]) -> list[Frame]:
        """Return :meth:`frames` that were made before :meth:`use` for the present body."""
        first, *others = frames
        before = None if self._before is None else first.before
        return [self.cameras[0].counted(first.changed(before=before)), *others]

    def follow(self, frames: Sequence[Frame]) -> Estimate:
        """Return the estimate of the posture in :meth:`frames`."""
        expected = frames[0].changed(lean_rad=self._legs.lean_rad)
        estimate, first = self._found([expected, *frames[1:]]), self.cameras[0]
        is_found = estimate.posture is not None
        reason = self._doubt_about(frames[0]) if is_found else ""
        found = self._before if is_found else None
        is_sure = estimate.state == TRACKING
        if self._is_alone and first.shows_other(frames[0], found, self._now_ns, is_sure):
            estimate = Estimate(LOST)
            if is_found:
                self._before = None
                self._filter.forget()
        estimate = self.place.placed(estimate, self.body, frames)
        estimate = self._doubted(estimate, reason)
        self._count(frames, estimate)
        estimate = self._legs.see(frames[0], self._head.see(frames[0], estimate))
        if self._hands is None:
            return estimate
        given = first.picture, frames[0].points, estimate, self.body, self.camera
        estimate = self._hands.see(*given, self._now_ns / 1e9)
        self.used["hands"] = self.used.get("hands", 0) + any(estimate.hands or ())
        return estimate

    def _doubted(self, estimate: Estimate, reason: str) -> Estimate:
        """Return an estimate that is no surer than body, distance, person and limits."""
        place, camera = estimate.place, self.body.camera_pose
        wrong = camera.contradiction or ("the camera moves" if camera.moves else "")
        if self.faults.is_contradicted:
            wrong = wrong or reason
        if place is not None and wrong:
            place = replace(place, contradiction=place.contradiction or wrong)
            estimate = replace(estimate, place=place)
        if estimate.posture is None:
            return estimate
        reason = reason or camera.contradiction
        if self.place.is_too_large:
            reason = "the body is too large for the distance"
        if self._is_alone and self.cameras[0].identity.is_doubtful:
            reason = "it may be somebody else"
        state, states = estimate.state, estimate.keypoint_states
        if reason and states is not None:
            states = doubted(states)
        if not reason and self.body.unknown:
            reason = "the sizes are not known yet"
        if state == TRACKING and reason:
            state = UNCERTAIN
        return replace(
            estimate,
            state=state,
            reason=(reason or estimate.reason) if state == UNCERTAIN else "",
            keypoint_states=states,
            pitch_stddev_rad=camera.pitch_stddev_rad,
        )

    def _count(self, frames: Sequence[Frame], estimate: Estimate) -> None:
        """Count which of the optional inputs that were given told of a posture."""
        self.images += 1
        given = set[str]().union(*(camera.given for camera in self.cameras))
        is_coloured = any(isinstance(term, InnerCueTerm) for term in self.cameras[0].terms)
        inputs = {
            "points": (
                "points" in given,
                any(one.points is not None and not one.points.is_empty for one in frames),
            ),
            "depth": ("depth_m" in given, any(one.depth_m is not None for one in frames)),
            "colours": (is_coloured, frames[0].image is not None and frames[0].before is not None),
        }
        for number, frame in enumerate(frames[1:], 2):
            inputs[f"camera {number}"] = True, frame.foreground_px > 0
        for name, (is_given, is_used) in inputs.items():
            if is_given or name in self.used:
                found = is_used and estimate.posture is not None
                self.used[name] = self.used.get(name, 0) + found

    def sample(self, estimate: Estimate, count: int, rng: np.random.Generator) -> FloatArray:
        """Sample postures (count, 12) for the last ``estimate``; see ``likely_postures``."""
        found = estimate.posture, estimate.posture_stddev, estimate.offset_m
        return likely_postures(*found, self._particles, count, rng)

    def _found(self, frames: Sequence[Frame]) -> Estimate:
        """Return the estimate of search and doubt alone."""
        presence = self._filter.look(frames)
        self.empty = self.empty + 1 if presence is Presence.NOBODY else 0
        if presence is Presence.NOBODY:
            # The next person is not lost after one poor image.
            self._before, self._poor_frames = None, 0
            if self._facing is not None:
                self._facing.forget()
            if self.config.relocalize:
                # The person may come back at another place.
                self._filter.forget()
            return Estimate(NO_PERSON)
        if presence is Presence.TOO_MUCH:
            # After a short change of the light, the person is still at the same place.
            return Estimate(LOST)
        fit = self._filter.follow(frames, [camera.terms for camera in self.cameras])
        self._particles = fit.particles
        if not fit.is_finite:
            # Without a reset, values that are not finite would stay in the particles.
            self.reset()
            return Estimate(LOST)
        is_known = len(frames) > 1 or any(frame.points is not None for frame in frames)
        if self.config.has_several_views and is_known and fit.iou < _TOUCHING_IOU:
            # The person is there, but not where the model is.
            if self.config.relocalize:
                self._before = None
                self._filter.forget()
            return Estimate(LOST)
        self._before = np.append(fit.posture, np.zeros(2) if fit.offset_m is None else fit.offset_m)
        self._poor_frames = self._poor_frames + 1 if fit.is_poor else 0
        if self._poor_frames >= self.config.lost_frames:
            if self.config.relocalize:
                self._filter.recover()
            return Estimate(LOST)
        if self.agreement is not None and fit.offset_m is not None:
            self.agreement.see(self._before, frames, [one.column for one in self.cameras[1:]])
        judged = fit.judged
        clavicles_m, clavicles_stddev_m = clavicles(self.body, fit.posture, fit.posture_stddev)
        return Estimate(
            UNCERTAIN if judged is not None and judged.is_uncertain else TRACKING,
            fit.posture,
            fit.posture_stddev,
            fit.keypoints_m,
            fit.cost_px,
            fit.iou,
            fit.offset_m,
            fit.offset_stddev_m,
            keypoint_states=None if judged is None else judged.states,
            keypoint_chances=None if judged is None else judged.chances,
            evidence=None if judged is None else judged.evidence,
            reason="" if judged is None else judged.reason,
            clavicles_m=clavicles_m,
            clavicles_stddev_m=clavicles_stddev_m,
        )

    def _doubt_about(self, frame: Frame) -> str:
        """Return why a person's back or poses of cameras make the whole result doubtful, or ""."""
        if self._facing is not None and self._before is not None:
            self._facing.see(frame, Posed(self.cameras[0].posable, self._before[None]))
            return BACK if self._facing.shows_back else ""
        return CONTRADICTED if self.faults.is_contradicted else ""
