"""Tracking of one person's posture over silhouettes, with a confidence for each frame."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from itertools import zip_longest
from types import MappingProxyType

import numpy as np

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.camera.tilt import tilted_body, tilted_states
from cardbox_tracker.camera.view import OtherCamera, View
from cardbox_tracker.common.settings import restarts
from cardbox_tracker.detectors.figure import Figure, figure_of_points
from cardbox_tracker.detectors.identity import Identity, colours_in
from cardbox_tracker.measuring.people_camera import FOUND_STDDEV
from cardbox_tracker.measuring.seen_body import SeenBody
from cardbox_tracker.person.kinematics import clavicles
from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.posture import (
    LEFT_ARM,
    PITCH,
    RIGHT_ARM,
    TORSO_Y,
    TURNING_LIMITS,
    TURNS,
)
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.search.cycles import Cycles
from cardbox_tracker.search.doubt import doubted
from cardbox_tracker.search.particles import Particles, likely_postures
from cardbox_tracker.search.pose_filter import (
    MakeFilter,
    PoseFilter,
    Presence,
)
from cardbox_tracker.search.whole_body import WholeBodyFilter
from cardbox_tracker.terms.compiled import CompiledSilhouette
from cardbox_tracker.terms.inner_cue import InnerCueTerm
from cardbox_tracker.terms.joint_points import projected
from cardbox_tracker.terms.joint_points_kernels import HIPS, POINTS_OF_ARM, SHOULDER
from cardbox_tracker.terms.silhouette import SilhouetteTerm
from cardbox_tracker.terms.term import USUAL_INTERVAL_S, Frame, Image, Posed, Silhouette
from cardbox_tracker.tracking.camera_agreement import CameraAgreement
from cardbox_tracker.tracking.camera_faults import POSE, TURNED, CameraFaults, facing_rad
from cardbox_tracker.tracking.estimate import (
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
from cardbox_tracker.tracking.observation import Observation, Observations, stamp_of
from cardbox_tracker.tracking.place import PlaceWatch
from cardbox_tracker.tracking.tracked_camera import TrackedCamera

FILTERS: MappingProxyType[str, MakeFilter] = MappingProxyType(
    {"hierarchical": Cycles, "whole_body": WholeBodyFilter}
)
"""Filter classes by the values of ``TrackerConfig.filter``."""

# Frames without anybody after which another person is expected.
_ABSENT_FRAMES = 5
# A model that overlaps the silhouette less than this is somewhere else.
_TOUCHING_IOU = 0.05
# A joint is at its limit within this angle, rad.
_AT_LIMIT_RAD = np.radians(0.5)


class Tracker:
    """Tracks one measured person (paper, algorithm "Online Motion Tracking").

    Attributes:
        cameras: the body before each camera, the first one first.
        agreement: check of the extrinsics of several cameras; None with one camera.
        faults: cameras that are left out for a while.
        images: number of times that were tracked.
        used: in how many of them each optional input told of the posture, by its name.
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
        beside: Executor | None = None,
    ) -> None:
        """Set up for ``body``; the camera, of the silhouettes' size, gets the pitch of the model.

        Unknown values are measured while tracking: the attribute ``body`` has a few versions, see
        :class:`~cardbox_tracker.measuring.seen_body.SeenBody`. Before the first one, or if the
        camera's pitch is not known to 10 degrees, estimates are at best ``uncertain``. Settings are
        the paper's by default, and noise is seeded with 0. ``silhouette`` and ``make_filter``
        replace the compiled term and the filter of the settings. ``look`` finds the points of hands
        in images of the first camera. ``beside`` measures further versions while tracking goes on.
        ``others``, the further cameras, need the filter ``whole_body``.

        Raises CameraError if the person was not measured in front of one of ``others``, and
        ValueError if there are others, but the filter takes one camera.
        """
        self.camera = camera.with_pitch(body.camera_pose.pitch_rad)
        self.config = config or TrackerConfig()
        self._rng = rng or np.random.default_rng(0)
        self._make_filter, self._look = make_filter, look
        self._others = tuple(others)
        if others and (make_filter or not self.config.has_several_views):
            raise ValueError("several cameras need the filter whole_body: the preset default")
        self._place = PlaceWatch(body, self.camera)
        self.agreement: CameraAgreement | None = None
        self.faults = CameraFaults(1 + len(self._others))
        # Whether two cameras contradict each other, so that nobody knows which one is wrong.
        self._is_contradicted = False
        self.images, self.used = 0, dict[str, int]()
        self._measuring: SeenBody | None = None
        self._absent, self._seconds, self._is_first = 0, 0.0, True
        if body.unknown:
            # The paper's filter cannot go on with another version of a body.
            pause_s = 1.0 if self.config.has_several_views else np.inf
            fits = self._rng.spawn(1)[0]
            self._measuring = SeenBody(body, self.camera, self.config, fits, pause_s, beside)
        self._use(body, silhouette or CompiledSilhouette(body, self.camera))

    def _use(self, body: BodyModel, silhouette: SilhouetteTerm, is_new_start: bool = True) -> None:
        """Track ``body`` from the next frame on, else with the states that were found so far."""
        self.body = self.config.with_shoulders(body)
        self._silhouette = silhouette
        self.cameras = [
            TrackedCamera(self.body, self.camera, self.config, other)
            for other in (None, *self._others)
        ]
        views = self.views
        earlier = self.agreement
        self.agreement = CameraAgreement(body, self.camera, views, earlier) if views else None
        self._legs = LegReader(self.body, self.camera)
        if is_new_start or not isinstance(self._filter, WholeBodyFilter):
            self.reset()
            return
        for camera in self.cameras:
            camera.reset(self.config)
        self._filter.use(silhouette, views)
        self._head = HeadTracker(self.body, self.camera)

    def reset(self) -> None:
        """Forget the posture; the next frame is tracked from the front reference posture."""
        make_filter = self._make_filter or FILTERS[self.config.filter]
        for camera in self.cameras:
            camera.reset(self.config)
        self._identities = [Identity() for _ in self.cameras]
        self._now_ns, self._sees_other = 0, False
        rng = self._rng.spawn(1)[0]
        self._filter = make_filter(self.config, self._silhouette, rng, self.views)
        self._head = HeadTracker(self.body, self.camera)
        self._legs.forget()
        self._hands = None if self._look is None else HandReader(self._look)
        # The outlines of several cameras determine the direction; the paper has no such doubt.
        is_alone = self.config.has_several_views and not self._others
        self._facing = Facing(self.body) if is_alone else None
        self._poor_frames = 0
        self._last_ns: int | None = None
        self._particles: Particles | None = None
        # State (14,) of the previous frame for the terms.
        self._before: FloatArray | None = None

    def tilt(self, guess: BodyModel, stamp_ns: int = 0) -> None:
        """Go on before the same camera with the pitch of ``guess``, from the image of a stamp on.

        The person stays in the same place of the image, as a new version of the body.
        """
        body = tilted_body(self.body, guess.camera_pose)
        body = replace(body, version=self.body.version + 1, stamp_ns=stamp_ns)
        moved = partial(tilted_states, before=self.body, after=body)
        self.camera = self.camera.with_pitch(body.camera_pose.pitch_rad)
        self._place = PlaceWatch(body, self.camera)
        if self._measuring is not None:
            self._measuring.tilt(guess)
        if self._before is not None:
            self._before = moved(self._before[None])[0]
        self._use(body, CompiledSilhouette(body, self.camera), is_new_start=False)
        if isinstance(self._filter, WholeBodyFilter):
            self._filter.move(moved)

    def configure(self, config: TrackerConfig) -> bool:
        """Use other settings from the next frame on; return whether tracking starts again."""
        is_new_start = restarts(self.config, config)
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
    def filter(self) -> PoseFilter:
        """The particle filter, for tools that need more than the estimate."""
        return self._filter

    @property
    def views(self) -> tuple[View, ...]:
        """Views of the body from the further cameras."""
        return tuple(camera.view for camera in self.cameras if camera.view is not None)

    def remarks(self, names: Sequence[str] = (), is_all: bool = False) -> list[str]:
        """Return warnings about images that contradict each other, see :class:`.CameraFaults`."""
        depths = (camera.depth.remark for camera in self.cameras)
        found = *self.faults.remarks(names, is_all), *depths, self._place.contradiction
        return [text for text in found if text]

    def used_texts(self) -> dict[str, str]:
        """Return for the diagnostics in how many images each optional input was used."""
        return {f"{name} used": f"{count} of {self.images}" for name, count in self.used.items()}

    def camera_ious(self) -> list[float | None]:
        """Return the IoU of the last estimate in each camera; None in one without a person."""
        return self._filter.ious()

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
        if isinstance(observations, np.ndarray):
            observations = Observation(observations, image, stamp_ns=stamp_ns)
        elif image is not None or stamp_ns is not None:
            raise ValueError("give image and stamp_ns in the observations, not beside them")
        if isinstance(observations, Observation):
            observations = (observations,)
        if not isinstance(observations, Sequence):
            raise ValueError(
                f"the observations are of the type {type(observations).__name__}; expected a "
                "silhouette as a numpy array, an Observation, or a list with one for each camera"
            )
        if not 1 <= len(observations) <= len(self.cameras):
            raise ValueError(
                f"there are {len(observations)} observations; expected one for each of "
                f"{len(self.cameras)} cameras"
            )
        for one in observations:
            if one is not None and not isinstance(one, Observation):
                raise ValueError(
                    f"an observation is of the type {type(one).__name__}; expected an Observation, "
                    "such as Observation(silhouette), or None"
                )
        if self._others:
            observations = self.faults.without(observations, stamp_of(observations))
        frames = [self._of_person(*one) for one in enumerate(self._frames_of(observations))]
        if self.agreement is not None:
            frames = self._agreeing(self.agreement, frames)
        estimate = self._placed(frames, self._same(frames[0], self._track(frames)))
        # The posture of an unsure pitch is unsure, too.
        is_tilt_unknown = self.body.camera_pose.pitch_stddev_rad > FOUND_STDDEV
        if estimate.state == TRACKING and (self.body.unknown or is_tilt_unknown):
            estimate = replace(estimate, state=UNCERTAIN)
        posture = estimate.posture
        if self.config.has_several_views and posture is not None and is_at_two_limits(posture):
            estimate = _unsure(estimate)
        self._count(observations, frames, estimate)
        estimate = self._legs.see(frames[0], self._head.see(frames[0], estimate))
        if self._hands is None:
            return estimate
        seen, person = observations[0], (self.body, self.camera)
        picture = None if seen is None else seen.picture
        given = picture, frames[0].points, estimate, *person, self._now_ns / 1e9
        estimate = self._hands.see(*given)
        self.used["hands"] = self.used.get("hands", 0) + any(estimate.hands or ())
        return estimate

    def _agreeing(self, agreement: CameraAgreement, frames: Sequence[Frame]) -> list[Frame]:
        """Return the frames, empty ones of cameras that contradict the others.

        If all of several further cameras contradict the first one, that is left out.
        """
        is_whole = _are_whole(frames)
        if is_whole:
            agreement.look(*_silhouettes(frames))
        before_rad = facing_rad(frames[0].points, frames[0].camera) if is_whole else np.nan
        reasons = [POSE if fault else "" for fault in agreement.are_contradicted]
        for number, (frame, view) in enumerate(zip(frames[1:], self.views, strict=True)):
            turned_rad = facing_rad(frame.points, frame.camera) + view.yaw_rad - before_rad
            if self.faults.is_turned(number + 1, turned_rad):
                reasons[number] = reasons[number] or TURNED
        self._is_contradicted = len(reasons) == 1 and bool(reasons[0])
        wrong = ["", *reasons]
        if len(reasons) > 1 and all(reasons):
            wrong = [reasons[0], *[""] * len(reasons)]
        kept = []
        for number, (frame, reason) in enumerate(zip(frames, wrong, strict=True)):
            if reason and frame.foreground_px:
                self.faults.leave_out(number, reason)
                channels = {"silhouette": np.zeros_like(frame.silhouette)}
                frame = frame.changed(channels=channels, foreground_px=0)
            kept.append(frame)
        return kept

    def _placed(self, frames: Sequence[Frame], estimate: Estimate) -> Estimate:
        """Return the estimate with its place, which no deviation of it is surer than."""
        is_alone = not any(frame.foreground_px for frame in frames[1:])
        place = self._place.see(estimate, self.body, frames[0], is_alone)
        if place is None or estimate.posture_stddev is None or estimate.offset_stddev_m is None:
            return estimate
        stddev = estimate.posture_stddev.copy()
        stddev[TORSO_Y] = np.hypot(stddev[TORSO_Y], place.stddev_m[1])
        # The trunk leans in the level frame, which the camera's pitch defines.
        stddev[PITCH] = np.hypot(stddev[PITCH], self.body.camera_pose.pitch_stddev_rad)
        moved_m = np.hypot(estimate.offset_stddev_m, place.stddev_m[[0, 2]])
        if self._place.is_too_large:
            estimate = _unsure(estimate)
        return replace(
            estimate,
            posture_stddev=stddev,
            offset_stddev_m=moved_m,
            place=place,
        )

    def _count(
        self, observations: Observations, frames: Sequence[Frame], estimate: Estimate
    ) -> None:
        """Count which optional inputs were given, and told of a posture."""
        self.images += 1
        given = [one for one in observations if one is not None]
        inputs = {
            "points": (
                any(one.points is not None for one in given),
                any(one.points is not None and not one.points.is_empty for one in frames),
            ),
            "depth": (
                any(one.depth_m is not None for one in given),
                any(one.depth_m is not None for one in frames),
            ),
            "colours": (
                any(isinstance(term, InnerCueTerm) for term in self.cameras[0].terms),
                frames[0].image is not None and frames[0].before is not None,
            ),
        }
        for number, frame in enumerate(frames[1:], 2):
            inputs[f"camera {number}"] = True, frame.foreground_px > 0
        for name, (is_given, is_used) in inputs.items():
            if is_given or name in self.used:
                found = is_used and estimate.posture is not None
                self.used[name] = self.used.get(name, 0) + found

    def _frames_of(self, observations: Observations) -> list[Frame]:
        """Return the frames of all cameras; the frame of a camera without data is empty."""
        stamp_ns, before_ns = stamp_of(observations), self._last_ns
        self._last_ns, interval_s = stamp_ns, USUAL_INTERVAL_S
        if stamp_ns is not None and before_ns is not None and stamp_ns > before_ns:
            interval_s = (stamp_ns - before_ns) / 1e9
        is_sure = self._poor_frames == 0
        return [
            camera.frame(observation, self._before, is_sure, interval_s)
            for camera, observation in zip_longest(self.cameras, observations)
        ]

    def _of_person(self, camera: int, frame: Frame) -> Frame:
        """Return the frame of a camera without points of somebody who is not the person."""
        if camera == 0:
            usual_ns = self._now_ns + round(1e9 * frame.interval_s)
            self._now_ns = usual_ns if frame.stamp_ns is None else frame.stamp_ns
            self._sees_other = False
        points, identity = frame.points, self._identities[camera]
        if points is None or points.is_empty:
            return frame
        seen_ns = self._now_ns if points.stamp_ns is None else points.stamp_ns
        figure = figure_of_points(points)
        # The silhouette lacks whoever is far from the last posture.
        colours = colours_in(frame.image, figure.trunk(frame.silhouette.shape))
        if identity.is_same(figure, colours, seen_ns):
            return frame
        self._sees_other |= camera == 0
        return frame.changed(channels={**frame.channels, "points": None})

    def _same(self, frame: Frame, estimate: Estimate) -> Estimate:
        """Return the estimate, which is lost if it is that of somebody else than the points were.

        Without the person's points, the place of the estimate itself must be one that the person
        can have reached, with the colours of the person.
        """
        identity, points = self._identities[0], frame.points
        if self._others or identity.is_new:
            return estimate
        if estimate.posture is None:
            return Estimate(LOST) if self._sees_other else estimate
        if points is None or points.is_empty:
            assert self._before is not None
            there = projected(Posed(self.cameras[0].posable, self._before[None]))[:, :2]
            joints = {"left_shoulder": there[SHOULDER], "left_hip": there[HIPS]}
            joints |= {"right_shoulder": there[POINTS_OF_ARM + SHOULDER], "right_hip": there[HIPS]}
            figure, silhouette = Figure(joints), frame.silhouette
            trunk = figure.trunk(silhouette.shape)
            is_seen, colours = (trunk & silhouette).any(), colours_in(frame.image, trunk)
            if not is_seen or not identity.is_same(figure, colours, self._now_ns):
                self._before = None
                self._filter.forget()
                return Estimate(LOST)
        return _unsure(estimate) if identity.is_doubtful else estimate

    def _track(self, frames: list[Frame]) -> Estimate:
        if self._measuring is None:
            return self._follow(frames)
        self._measure(self._measuring, frames)
        estimate = self._follow(frames)
        self._absent = self._absent + 1 if estimate.state == NO_PERSON else 0
        if self._absent == _ABSENT_FRAMES:
            # The next one may be somebody else.
            self._measuring.forget()
            self._is_first = True
        return estimate

    def _measure(self, measuring: SeenBody, frames: list[Frame]) -> None:
        """Use the frame of the first camera to measure, and a new version of the body at once."""
        silhouette, points = frames[0].silhouette, frames[0].points
        self._seconds += frames[0].interval_s
        is_detected = points is not None and points.are_certain
        if not measuring.see(silhouette, frames[0].image, self._seconds, is_detected):
            return
        version, stamp_ns = self.body.version + 1, frames[0].stamp_ns or 0
        body = replace(measuring.body, version=version, stamp_ns=stamp_ns)
        is_first = self._is_first
        self._is_first = bool(body.unknown)
        self._use(body, CompiledSilhouette(body, self.camera), is_first)
        again = self._silhouette.frame(silhouette)
        counted = again.rows, again.foreground_px
        before = None if is_first else frames[0].before
        frames[0] = frames[0].changed(rows=counted[0], foreground_px=counted[1], before=before)

    def sample(self, estimate: Estimate, count: int, rng: np.random.Generator) -> FloatArray:
        """Sample postures (count, 12) for the last ``estimate``; see ``likely_postures``."""
        found = estimate.posture, estimate.posture_stddev, estimate.offset_m
        return likely_postures(*found, self._particles, count, rng)

    def _follow(self, frames: Sequence[Frame]) -> Estimate:
        presence = self._filter.look(frames)
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
        is_detected = any(frame.points is not None for frame in frames)
        if self.config.has_several_views and is_detected and fit.iou < _TOUCHING_IOU:
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
        if self.agreement is not None and _are_whole(frames) and fit.offset_m is not None:
            self.agreement.see(self._before, *_silhouettes(frames))
        judged, is_doubtful = fit.judged, self._is_doubtful(frames[0])
        states = None if judged is None else judged.states
        if is_doubtful and states is not None:
            states = doubted(states)
        is_uncertain = is_doubtful or (judged is not None and judged.is_uncertain)
        clavicles_m, clavicles_stddev_m = clavicles(self.body, fit.posture, fit.posture_stddev)
        return Estimate(
            UNCERTAIN if is_uncertain else TRACKING,
            fit.posture,
            fit.posture_stddev,
            fit.keypoints_m,
            fit.cost_px,
            fit.iou,
            fit.offset_m,
            fit.offset_stddev_m,
            keypoint_states=states,
            keypoint_chances=None if judged is None else judged.chances,
            evidence=None if judged is None else judged.evidence,
            clavicles_m=clavicles_m,
            clavicles_stddev_m=clavicles_stddev_m,
        )

    def _is_doubtful(self, frame: Frame) -> bool:
        """Return whether poses of cameras, or a person's back, make the whole result doubtful."""
        if self._facing is not None and self._before is not None:
            self._facing.see(frame, Posed(self.cameras[0].posable, self._before[None]))
            return self._facing.shows_back
        return self._is_contradicted


class BodyTracker(Tracker):
    """Measures the body alone, so that an image without a fit takes little time."""

    def _track(self, frames: list[Frame]) -> Estimate:
        if self._measuring is not None:
            self._measure(self._measuring, frames)
        return Estimate(LOST)


def _are_whole(frames: Sequence[Frame]) -> bool:
    """Return whether no other person hides pixels of this one."""
    # What others hide is missing in the outline, and networks mix people.
    return all(frame["covered"] is None for frame in frames)


def _unsure(estimate: Estimate) -> Estimate:
    """Return an estimate of which nothing is ``tracking``."""
    states = estimate.keypoint_states
    state = UNCERTAIN if estimate.state == TRACKING else estimate.state
    states = None if states is None else doubted(states)
    return replace(estimate, state=state, keypoint_states=states)


def is_at_two_limits(posture: FloatArray) -> bool:
    """Return whether two joints of the trunk, or of one arm, are at their limits.

    People hardly do that, but a search that finds no way on does.
    """
    is_at = (np.abs(posture[:, None] - TURNING_LIMITS) < _AT_LIMIT_RAD).any(axis=1)
    return any(np.count_nonzero(is_at[part]) >= 2 for part in (TURNS, LEFT_ARM, RIGHT_ARM))


def _silhouettes(frames: Sequence[Frame]) -> tuple[Silhouette, list[Silhouette]]:
    """Return the silhouette of the first camera and those of the further ones."""
    first, *others = (frame.silhouette for frame in frames)
    return first, others
