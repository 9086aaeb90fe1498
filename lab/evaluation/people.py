"""The figures of a run on a session of a real person, who was not measured."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.person.skeleton import SHOULDERS
from cardbox_tracker.recordings.truth import beside_shoulders
from cardbox_tracker.tracking.estimate import TRACKING
from lab.evaluation.figures import figures
from lab.evaluation.session import RecordedSession
from lab.evaluation.tracking import SessionRun

FloatArray = NDArray[np.float64]

BEYOND_CM = (20, 30)
"""Errors of one joint from which on an image counts as wrong."""


def people_figures(session: RecordedSession, run: SessionRun) -> dict[str, Any]:
    """Return the figures of :func:`figures` and those of the state against the error.

    Returns:
        Also ``input_ms``; ``tracking``, the number of scored images with that state; and
        ``tracking_beyond_20`` and ``tracking_beyond_30``, how many of these have a joint with an
        error beyond that many centimetres beside the middle of the shoulders, since the state is
        that of the shape. The coverage takes the torso from hips and shoulders.
    """
    if session.hips_m is not None:
        session = replace(session, torso_rad=torso_angles(session))
    is_tracking = run.states == TRACKING
    apart_m = beside_shoulders(run.keypoints_m - session.keypoints_m)
    worst_cm = 100 * np.linalg.norm(apart_m, axis=2).max(axis=1)
    result = figures(session, run) | {"tracking": int(is_tracking.sum()), "input_ms": run.input_ms}
    for limit_cm in BEYOND_CM:
        wrong = is_tracking & (worst_cm > limit_cm)
        result[f"tracking_beyond_{limit_cm}"] = int(wrong.sum())
    return result


def torso_angles(session: RecordedSession) -> FloatArray:
    """Return roll, pitch and yaw of the torso (n, 3), rad, from the true hips and shoulders.

    The torso's axis leads from the middle of the hips to that of the shoulders. Without known hips,
    the angles are nan.
    """
    hips_m = session.hips_m
    if hips_m is None:
        hips_m = np.full((len(session.stamps_ns), 3), np.nan)
    left, right = SHOULDERS
    breadth = session.keypoints_m[:, left] - session.keypoints_m[:, right]
    axis = session.keypoints_m[:, SHOULDERS].mean(axis=1) - hips_m
    up = _unit(axis @ session.to_optical)
    aside = breadth @ session.to_optical
    aside = _unit(aside - (aside * up).sum(axis=1, keepdims=True) * up)
    front = np.cross(aside, up)
    return np.column_stack(
        [
            np.arctan2(aside[:, 2], up[:, 2]),
            np.arcsin(np.clip(-front[:, 2], -1.0, 1.0)),
            np.arctan2(front[:, 1], front[:, 0]),
        ]
    )


def _unit(vectors: FloatArray) -> FloatArray:
    lengths: FloatArray = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / lengths
