"""Initialize and track recorded sessions, several seeds at once."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.detector import Detector
from cardbox_tracker.detectors.point_table import PointTable
from cardbox_tracker.measuring.config import InitializationConfig
from cardbox_tracker.person.model import BodyModel, body_from_proportions
from cardbox_tracker.person.posture import N_JOINTS, POSTURE
from cardbox_tracker.person.proportions import STATURE_LIMITS_M
from cardbox_tracker.recordings.initialize import initialize_from_recording
from cardbox_tracker.recordings.recording import STEREO, FrameSet, RecordingRequest
from cardbox_tracker.recordings.silhouettes import SilhouetteSource, TimeSpan
from cardbox_tracker.recordings.truth import GroundTruth
from cardbox_tracker.search.config import TrackerConfig
from cardbox_tracker.tracking.estimate import Estimate
from cardbox_tracker.tracking.session import Session
from cardbox_tracker.tracking.smoother import Smoother
from cardbox_tracker.tracking.tracker import Tracker
from lab.evaluation.recovery import Recovery, measure_recovery
from lab.evaluation.session import RecordedSession

FloatArray = NDArray[np.float64]

WITH_DEPTH = "depth"
"""Given in place of one camera's name: all cameras track, with measured depth."""

BACKGROUND, DETECTOR = "background", "detector"
"""Sources of silhouettes: the session's empty scene, or the masks of the installed detector."""

Observe = Callable[[int, int, Estimate, Tracker], None]
"""Callback that receives the seed, the stamp in ns, the estimate and the tracker."""


@dataclass(frozen=True)
class InputSelection:
    """Selection of the inputs that the tracker receives.

    Attributes:
        only: name of the one camera that tracks; None for all cameras; ``WITH_DEPTH`` for all
            cameras with the session's depth images, or else the depth of its rectified pair.
        silhouettes: ``BACKGROUND`` or ``DETECTOR``; None for the empty scene if the session has
            one, and otherwise the detector.
        points: source of the person's points in the images; None for no points.
    """

    only: str | None = None
    silhouettes: str | None = None
    points: Detector | PointTable | None = None


ALL_INPUTS = InputSelection()
"""All cameras with their images, without depth."""


@dataclass(frozen=True)
class SessionRun:
    """Results of one seed on one session of n scored images.

    Attributes:
        body: the measured person; None if the initialization failed.
        failure: reason why the initialization failed; empty if it did not.
        states: tracking state of each image, (n,); empty where the image was not tracked.
        keypoints_m: (n, 6, 3), metres in the optical frame; nan without an estimate.
        postures: (n, 12), rad and metres; nan without an estimate.
        stddevs: standard deviations, (n, 12).
        keypoint_states: states of the keypoints, (n, 6); empty without an estimate or states.
        chances: probabilities of keypoints to be off by more than 30 cm relative to the middle of
            the shoulders, (n, 6); nan likewise.
        milliseconds: time of the thread that tracks each image from silhouette to posture, (m,).
        input_ms: median processor time of an image before that: decoding, silhouettes and points
            of all cameras; nan if it was not measured.
    """

    body: BodyModel | None
    failure: str
    states: NDArray[np.str_]
    keypoints_m: FloatArray
    postures: FloatArray
    stddevs: FloatArray
    keypoint_states: NDArray[np.str_]
    chances: FloatArray
    milliseconds: FloatArray
    input_ms: float = float("nan")


def silhouettes_of(session: RecordedSession, chosen: str | None = None) -> TimeSpan | Detector:
    """Return the source of a session's silhouettes; ``chosen`` as in :class:`InputSelection`.

    Raises:
        CardboxError: the session has no empty scene, or the detector is not installed.
    """
    empty = session.spans.get("empty")
    if empty is None and chosen == BACKGROUND:
        raise CardboxError(
            f"{session.name} has no segment 'empty' from which a background could be learned; use "
            "the detector's masks (--silhouettes detector)"
        )
    if empty is not None and chosen != DETECTOR:
        return empty
    try:
        return Detector.installed()
    except CardboxError as error:
        if chosen == DETECTOR:
            raise
        raise CardboxError(
            f"{session.name} has no segment 'empty', so its silhouettes are the detector's masks, "
            f"but {error}"
        ) from None


def track_session(
    session: RecordedSession,
    config: TrackerConfig,
    seeds: tuple[int, ...],
    inputs: InputSelection = ALL_INPUTS,
    observe: Observe | None = None,
    body: BodyModel | None = None,
) -> list[SessionRun]:
    """Initialize and track one session with each of ``seeds``.

    The person of a session without reference postures has the mean proportions of people of that
    stature.

    Args:
        session: the session.
        config: settings of the tracker.
        seeds: random seeds of initialization and tracker, one run for each.
        inputs: selection of the inputs that the tracker receives.
        observe: called with every estimate as live tracking gives it; the runs have what recordings
            give, smoothed over time.
        body: the person to track; if None, the first camera measures the person.

    Raises:
        CardboxError: the recording cannot be read, lacks the selected camera, or has no source of
            silhouettes.
    """
    depth, only = None, inputs.only
    if only == WITH_DEPTH:
        depth, only = session.truth.depth_topic or STEREO, None
        config = config.with_depth()
    cameras, scene = session.truth.cameras, silhouettes_of(session, inputs.silhouettes)
    if only is not None and only not in cameras:
        raise CardboxError(
            f"{session.name} has no camera {only}; expected one of {', '.join(cameras)}"
        )
    with RecordingRequest(
        session.bag, scene, cameras, session.extrinsics, depth, inputs.points
    ).open() as source:
        camera = source.first.camera
        offset_s = (session.truth.start_ns - source.first.start_ns) / 1e9
        if body is None and not session.has_references:
            body = person_of(session.truth)
        bodies = [
            _measure(session, source.first, seed) if body is None else (body, "") for seed in seeds
        ]
        followed = [
            Session([tracked], camera, config, np.random.default_rng(seed), source.others)
            if tracked
            else None
            for (tracked, _), seed in zip(bodies, seeds, strict=True)
        ]
        found: list[dict[int, Estimate]] = [{} for _ in seeds]
        times: list[list[float]] = [[] for _ in seeds]
        inputs_ms: list[float] = []
        smoothers = [Smoother[int]() for _ in seeds]
        for taken in _timed(source.frames(session.start_s + offset_s), inputs_ms):
            stamp_ns = taken.stamp_ns
            # A camera that does not track gives its image alone.
            seen = [
                one if only in (None, name) else one.having(silhouette=None, points=None)
                for name, one in zip(source.names, taken.observations, strict=True)
            ]
            for seed, one, smoother, estimates, spent in zip(
                seeds, followed, smoothers, found, times, strict=True
            ):
                if one is None:
                    continue
                start = time.thread_time()
                (estimate,) = one.track(seen)
                tracker = one.trackers[0]
                for stamp, (smooth,) in smoother.add(
                    stamp_ns, stamp_ns, [estimate], [tracker.body]
                ):
                    estimates[stamp] = smooth
                spent.append(1e3 * (time.thread_time() - start))
                if observe is not None:
                    observe(seed, stamp_ns, estimate, tracker)
        for smoother, estimates in zip(smoothers, found, strict=True):
            estimates |= {stamp: smooth for stamp, (smooth,) in smoother.finish()}
    return [
        replace(
            run_of(session, tracked, failure, estimates, spent),
            input_ms=float(np.median(inputs_ms)) if inputs_ms else float("nan"),
        )
        for (tracked, failure), estimates, spent in zip(bodies, found, times, strict=True)
    ]


def _timed(frames: Iterable[FrameSet], milliseconds: list[float]) -> Iterator[FrameSet]:
    """Yield frames, and append the processor time of all other threads, and of this one here.

    Recordings are decoded and detected in threads beside the one that tracks.
    """
    before, tracked_s = time.process_time(), 0.0
    for taken in frames:
        now = time.process_time()
        milliseconds.append(1e3 * (now - before - tracked_s))
        before, start = now, time.thread_time()
        yield taken
        tracked_s = time.thread_time() - start


def recovery_of(
    session: RecordedSession, body: BodyModel, config: TrackerConfig, seed: int
) -> dict[str, Recovery]:
    """Return the recoveries of the tracker on one session, by kind of disturbance.

    Raises:
        CardboxError: the recording cannot be read.
    """
    first = session.truth.cameras[:1]
    with RecordingRequest(session.bag, session.spans["empty"], first).open() as opened:
        source = opened.first
        offset_s = (session.truth.start_ns - source.start_ns) / 1e9
        frames = list(source.frames(session.start_s + offset_s))
        return measure_recovery(session, frames, body, source.camera, config, seed)


def person_of(
    truth: GroundTruth, stature: float = 1.0, distance: float = 1.0, more_pitch_deg: float = 0.0
) -> BodyModel:
    """Return a person of known stature at their place; factors and degrees make a number wrong."""
    assert truth.stature_m is not None
    return body_from_proportions(
        float(np.clip(truth.stature_m * stature, *STATURE_LIMITS_M)),
        truth.distance_m * distance,
        camera_pitch_rad=float(np.radians(truth.pitch_deg + more_pitch_deg)),
    )


def _measure(
    session: RecordedSession, source: SilhouetteSource, seed: int
) -> tuple[BodyModel | None, str]:
    """Return the measured person, or None and the reason of the failure."""
    truth = session.truth
    config = InitializationConfig(
        distance_m=truth.distance_m,
        camera_pitch_rad=float(np.radians(truth.pitch_deg)),
        side_turn=truth.side_turn,
        seed=seed,
    )
    spans = {name: session.spans[name] for name in ("front", "side", "arms")}
    try:
        return initialize_from_recording(source, spans, config).body, ""
    except CardboxError as error:
        return None, str(error)


def run_of(
    session: RecordedSession,
    body: BodyModel | None,
    failure: str,
    estimates: Mapping[int, Estimate],
    milliseconds: Sequence[float] = (),
) -> SessionRun:
    """Return the results of one run; see :class:`SessionRun` for the values."""
    n = len(session.stamps_ns)
    states = np.full(n, "", dtype="<U16")
    keypoints = np.full((n, 6, 3), np.nan)
    postures, stddevs = np.full((2, n, N_JOINTS), np.nan)
    keypoint_states, chances = np.full((n, 6), "", dtype="<U16"), np.full((n, 6), np.nan)
    for i, stamp in enumerate(session.stamps_ns.tolist()):
        estimate = estimates.get(stamp)
        if estimate is None:
            continue
        states[i] = estimate.state
        if estimate.posture is not None and estimate.keypoints_m is not None:
            keypoints[i], postures[i] = estimate.keypoints_m, estimate.posture[POSTURE]
        if estimate.posture_stddev is not None:
            stddevs[i] = estimate.posture_stddev[POSTURE]
        if estimate.keypoint_states is not None and estimate.keypoint_chances is not None:
            keypoint_states[i], chances[i] = estimate.keypoint_states, estimate.keypoint_chances
    angles = postures, stddevs
    of_keypoints = keypoint_states, chances
    return SessionRun(
        *(body, failure, states, keypoints), *angles, *of_keypoints, np.array(milliseconds)
    )
