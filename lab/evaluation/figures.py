"""The figures of a run on a recorded session.

All errors are in centimetres over the six keypoints, estimate minus truth, in the camera's optical
frame: sideways to the right of the image, vertical downwards, depth away from the camera. *Aligned*
is after both skeletons are shifted to their middle of the shoulders; *PA* after the best similarity
transform.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.person.model import BodyModel
from cardbox_tracker.person.parts import body_parts
from cardbox_tracker.person.skeleton import JOINT_NAMES, SHOULDERS, KeypointState
from cardbox_tracker.recordings.truth import beside_shoulders
from cardbox_tracker.search.doubt import FAR_M, HANDS
from cardbox_tracker.tracking.estimate import TRACKING
from lab.evaluation.angles import joint_angles
from lab.evaluation.metrics import acceleration_error, align, angle_errors_deg
from lab.evaluation.session import RecordedSession
from lab.evaluation.tracking import SessionRun

FloatArray = NDArray[np.float64]

KINDS = ("shoulder", "elbow", "hand")
"""Keypoints i and i + 3 are of the same kind."""
BINS = 10
"""Number of equal intervals of the probability in a reliability diagram."""


def compared(off_m: FloatArray, chances: FloatArray, states: NDArray[np.str_]) -> dict[str, Any]:
    """Return numbers of keypoints and of wrong ones, by kind, in each state and each interval.

    Args:
        off_m: errors of the keypoints beside the middle of the shoulders, (n, 6), m; nan where they
            are unknown.
        chances: probabilities of being off by more than ``FAR_M``, (n, 6); nan without states.
        states: (n, 6); empty without states.

    Returns:
        For each kind, ``states``: by state the number of keypoints and of wrong ones; ``bins``: for
        each interval of the probability the number of keypoints, the sum of their probabilities,
        and the number of wrong ones. Empty if no image has states.
    """
    known = np.isfinite(off_m).all(axis=1) & np.isfinite(chances).all(axis=1)
    if not known.any():
        return {}
    is_wrong = off_m[known] > FAR_M
    result = {}
    for first, kind in enumerate(KINDS):
        both = [first, first + len(KINDS)]
        wrong = is_wrong[:, both].ravel()
        said = chances[known][:, both].ravel()
        state = states[known][:, both].ravel()
        interval = np.minimum((BINS * said).astype(int), BINS - 1)
        result[kind] = {
            "states": {
                str(one): [int((state == one).sum()), int(wrong[state == one].sum())]
                for one in KeypointState
            },
            "bins": [
                [int(here.sum()), float(said[here].sum()), int(wrong[here].sum())]
                for here in (interval == number for number in range(BINS))
            ],
        }
    return result


def added(tables: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the sum of results of :func:`compared`; empty ones count as nothing."""
    given = [one for one in tables if one]
    if not given:
        return {}
    return {
        kind: {
            "states": {
                state: np.sum([one[kind]["states"][state] for one in given], axis=0).tolist()
                for state in given[0][kind]["states"]
            },
            "bins": np.sum([one[kind]["bins"] for one in given], axis=0).tolist(),
        }
        for kind in given[0]
    }


FAR_CM = 100.0 * FAR_M
"""A mean error beyond this counts as a failure of tracking in any state."""

COVERAGE_STDDEVS = 2.0
_LEAST_STDDEV_DEG = 0.5


def figures(session: RecordedSession, run: SessionRun) -> dict[str, Any]:
    """Return all figures of one run; without an estimate, those that need one are missing."""
    have = np.asarray(np.isfinite(run.keypoints_m).all(axis=(1, 2)))
    is_tracking = run.states == TRACKING
    result: dict[str, Any] = {
        "frames": len(have),
        "without_estimate": int((~have).sum()),
        "states": {str(s): int((run.states == s).sum()) for s in np.unique(run.states) if s},
    }
    if not run.body:
        return result | {"failure": run.failure}
    result |= {"lengths": lengths(session, run), "ms": float(np.median(run.milliseconds))}
    if not have.any():
        return result
    estimates, truth = 100 * run.keypoints_m[have], 100 * session.keypoints_m[have]
    difference = estimates - truth
    distance = np.linalg.norm(difference, axis=2)
    aligned = np.linalg.norm(beside_shoulders(difference), axis=2)
    result |= {
        "absolute": float(distance.mean()),
        "aligned": float(aligned.mean()),
        "pa": float(np.linalg.norm(align(estimates, truth) - truth, axis=2).mean()),
    }
    for i, kind in enumerate(KINDS):
        result[f"{kind}_depth"] = float(difference[:, [i, i + 3], 2].mean())
        result[f"aligned_{kind}"] = float(aligned[:, [i, i + 3]].mean())
    off_m = run.keypoints_m - session.keypoints_m
    far = distance.mean(axis=1) > FAR_CM
    result |= {
        "far": int(far.sum()),
        "far_but_tracking": int((far & is_tracking[have]).sum()),
        "acceleration": acceleration_error(off_m, session.stamps_ns),
        "acceleration_beside": acceleration_error(beside_shoulders(off_m), session.stamps_ns),
        "coverage": coverage(session, run),
        "keypoint_states": compared(
            np.linalg.norm(beside_shoulders(off_m), axis=2), run.chances, run.keypoint_states
        ),
        "hand_far_but_tracking": int(
            ((distance[:, HANDS] > FAR_CM).any(axis=1) & is_tracking[have]).sum()
        ),
    }
    return result


def coverage(session: RecordedSession, run: SessionRun) -> dict[str, float]:
    """Return for each angle the fraction of images within two standard deviations of the truth.

    Only images count whose state is ``tracking`` or ``uncertain`` and whose true torso is known.
    """
    have = ~np.isnan(run.stddevs).any(axis=1) & ~np.isnan(session.torso_rad).any(axis=1)
    if not have.any():
        return {}
    truth = joint_angles(
        session.keypoints_m[have],
        session.torso_rad[have],
        float(np.radians(session.truth.pitch_deg)),
    )
    errors = angle_errors_deg(run.postures[have, 1:], truth)
    stddevs = np.maximum(np.degrees(run.stddevs[have, 1:]), _LEAST_STDDEV_DEG)
    inside = errors <= COVERAGE_STDDEVS * stddevs
    return dict(zip(JOINT_NAMES[1:], inside.mean(axis=0).tolist(), strict=True))


def lengths(session: RecordedSession, run: SessionRun) -> dict[str, float]:
    """Compare the measured lengths with those between the true joints.

    Returns:
        ``upper_arm``, ``forearm`` and ``shoulders`` as ratios to the true ones, and
        ``joint_height``, the height of the shoulder joints above the true ones in the reference
        ``front``, cm; nan if the truth has no such image.
    """
    assert run.body is not None
    truth = session.keypoints_m

    def true_m(first: int, second: int) -> float:
        return float(np.median(np.linalg.norm(truth[:, first] - truth[:, second], axis=1)))

    upper_arm = (true_m(0, 1) + true_m(3, 4)) / 2
    forearm = (true_m(1, 2) + true_m(4, 5)) / 2
    return {
        "upper_arm": run.body.size("upper_arm_length") / upper_arm,
        "forearm": run.body.size("forearm_length") / forearm,
        "shoulders": run.body.size("shoulder_breadth") / true_m(0, 3),
        "joint_height": 100 * (_joint_height_m(run.body) - _true_joint_height_m(session)),
    }


def _joint_height_m(body: BodyModel) -> float:
    """Return the height of an upright person's shoulder joints above the camera's centre."""
    return body.placement.hip_height_m + body_parts(body.sizes).shoulder_height_m


def _true_joint_height_m(session: RecordedSession) -> float:
    shoulders = [
        frame.keypoints_m[list(SHOULDERS)].mean(axis=0)
        for frame in session.truth.frames.values()
        if frame.segment == "front"
    ]
    if not shoulders:
        return float("nan")
    return float(np.median((np.array(shoulders) @ session.to_optical)[:, 2]))
