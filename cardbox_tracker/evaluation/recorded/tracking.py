"""Initialize and track recorded sessions, several seeds at once."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.body.model import BodyModel
from cardbox_tracker.body.posture import N_JOINTS, POSTURE
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.estimation.config import TrackerConfig
from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.estimation.initialization.config import InitializationConfig
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.evaluation.recorded.recovery import Recovery, measure_recovery
from cardbox_tracker.evaluation.recorded.session import RecordedSession
from cardbox_tracker.recordings.initialize import initialize_from_recording
from cardbox_tracker.recordings.recording import STEREO, open_recording
from cardbox_tracker.recordings.silhouettes import SilhouetteSource

FloatArray = NDArray[np.float64]

WITH_DEPTH = "depth"
"""Given in place of one camera's name: all cameras track, with measured depth."""

Observe = Callable[[int, int, Estimate, Tracker], None]
"""Callback that receives the seed, the stamp in ns, the estimate and the tracker."""


@dataclass(frozen=True)
class InputSelection:
    """Selection of the inputs that the tracker receives.

    Attributes:
        only: name of the one camera that tracks; None for all cameras; ``WITH_DEPTH`` for all
            cameras with the session's depth images, or else the depth of its rectified pair.
        has_images: False to give the tracker silhouettes without their images.
        covered: returns the index of the camera that sees nothing, or None, for a time in seconds
            since tracking began.
    """

    only: str | None = None
    has_images: bool = True
    covered: Callable[[float], int | None] | None = None


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
        milliseconds: processor time of each tracked image from silhouette to posture, (m,).
    """

    body: BodyModel | None
    failure: str
    states: NDArray[np.str_]
    keypoints_m: FloatArray
    postures: FloatArray
    stddevs: FloatArray
    milliseconds: FloatArray


def track_session(
    session: RecordedSession,
    config: TrackerConfig,
    seeds: tuple[int, ...],
    inputs: InputSelection = ALL_INPUTS,
    observe: Observe | None = None,
    body: BodyModel | None = None,
) -> list[SessionRun]:
    """Initialize and track one session with each of ``seeds``.

    Args:
        session: the session.
        config: settings of the tracker.
        seeds: random seeds of initialization and tracker, one run for each.
        inputs: selection of the inputs that the tracker receives.
        observe: called with every estimate.
        body: the person to track; if None, the first camera measures the person.

    Raises:
        CardboxError: the recording cannot be read, or lacks the selected camera.
    """
    depth, only = None, inputs.only
    if only == WITH_DEPTH:
        depth, only = session.truth.depth_topic or STEREO, None
        config = config.with_depth()
    cameras, empty = session.truth.cameras, session.spans["empty"]
    if only is not None and only not in cameras:
        raise CardboxError(
            f"{session.name} has no camera {only}; expected one of {', '.join(cameras)}"
        )
    with open_recording(session.bag, empty, cameras, session.extrinsics, depth) as source:
        camera = source.first.camera
        offset_s = (session.truth.start_ns - source.first.start_ns) / 1e9
        bodies = [
            _measure(session, source.first, seed) if body is None else (body, "") for seed in seeds
        ]
        trackers = [
            Tracker(tracked, camera, config, np.random.default_rng(seed), others=source.others)
            if tracked
            else None
            for (tracked, _), seed in zip(bodies, seeds, strict=True)
        ]
        found: list[dict[int, Estimate]] = [{} for _ in seeds]
        times: list[list[float]] = [[] for _ in seeds]
        started_ns: int | None = None
        for taken in source.frames(session.start_s + offset_s):
            stamp_ns = taken.stamp_ns
            started_ns = stamp_ns if started_ns is None else started_ns
            elapsed_s = (stamp_ns - started_ns) / 1e9
            dark = inputs.covered(elapsed_s) if inputs.covered else None
            seen = [
                replace(
                    one,
                    silhouette=one.silhouette if only in (None, name) and number != dark else None,
                    image=one.image if inputs.has_images else None,
                )
                for number, (name, one) in enumerate(
                    zip(source.names, taken.observations, strict=True)
                )
            ]
            for seed, tracker, estimates, spent in zip(seeds, trackers, found, times, strict=True):
                if tracker is None:
                    continue
                start = time.process_time()
                estimates[stamp_ns] = tracker.track(seen)
                spent.append(1e3 * (time.process_time() - start))
                if observe is not None:
                    observe(seed, stamp_ns, estimates[stamp_ns], tracker)
    return [
        _run(session, tracked, failure, estimates, spent)
        for (tracked, failure), estimates, spent in zip(bodies, found, times, strict=True)
    ]


def recovery_of(
    session: RecordedSession, body: BodyModel, config: TrackerConfig, seed: int
) -> dict[str, Recovery]:
    """Return the recoveries of the tracker on one session, by kind of disturbance.

    Raises:
        CardboxError: the recording cannot be read.
    """
    first = session.truth.cameras[:1]
    with open_recording(session.bag, session.spans["empty"], first) as opened:
        source = opened.first
        offset_s = (session.truth.start_ns - source.start_ns) / 1e9
        frames = list(source.frames(session.start_s + offset_s))
        return measure_recovery(session, frames, body, source.camera, config, seed)


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


def _run(
    session: RecordedSession,
    body: BodyModel | None,
    failure: str,
    estimates: dict[int, Estimate],
    milliseconds: list[float],
) -> SessionRun:
    n = len(session.stamps_ns)
    states = np.full(n, "", dtype="<U16")
    keypoints = np.full((n, 6, 3), np.nan)
    postures, stddevs = np.full((n, N_JOINTS), np.nan), np.full((n, N_JOINTS), np.nan)
    for i, stamp in enumerate(session.stamps_ns.tolist()):
        estimate = estimates.get(stamp)
        if estimate is None:
            continue
        states[i] = estimate.state
        if estimate.posture is not None and estimate.keypoints_m is not None:
            keypoints[i], postures[i] = estimate.keypoints_m, estimate.posture[POSTURE]
        if estimate.posture_stddev is not None:
            stddevs[i] = estimate.posture_stddev[POSTURE]
    return SessionRun(body, failure, states, keypoints, postures, stddevs, np.array(milliseconds))
