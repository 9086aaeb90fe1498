"""How much MediaPipe Pose shakes on recorded sessions, to compare with ``docs/evaluation``.

python -m tools.mediapipe_jitter SESSION...

Prints, for each session, the mean error of the acceleration in m/s^2, taken as
``cardbox evaluate --sessions`` takes it, of MediaPipe's joints in space beside the middle of the
shoulders (it has no metric place), and the mean acceleration of the true ones: the error of
somebody who is said to stand still. Needs the extra ``mediapipe``.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.mediapipe import full_model
from cardbox_tracker.evaluation.metrics import acceleration_error, beside_shoulders
from cardbox_tracker.evaluation.recorded.session import RecordedSession, load_session
from cardbox_tracker.recordings.bag_reader import BagReader

FloatArray = NDArray[np.float64]

# Shoulder, elbow and the knuckles of index and little finger, of either side.
_JOINTS = (11,), (13,), (17, 19), (12,), (14,), (18, 20)


def accelerations(session: RecordedSession, keypoints_m: FloatArray) -> tuple[float, float]:
    """Return the error of the acceleration of keypoints (n, 6, 3), and of those that stand still.

    Both in m/s^2, beside the middle of the shoulders.
    """
    truth_m = session.keypoints_m
    found, still = (
        acceleration_error(beside_shoulders(off_m), session.stamps_ns)
        for off_m in (keypoints_m - truth_m, -truth_m)
    )
    return found, still


def mediapipe_keypoints(session: RecordedSession) -> FloatArray:
    """Return what MediaPipe finds in the images of a session, (n, 6, 3); nan where nothing."""
    rows = {stamp: row for row, stamp in enumerate(session.stamps_ns.tolist())}
    keypoints_m = np.full(session.keypoints_m.shape, np.nan)
    with full_model() as pose, BagReader(session.bag) as bag:
        for image in bag.images():
            found = pose.process(np.ascontiguousarray(image.color[..., ::-1]))
            row = rows.get(image.stamp_ns)
            if row is None or found.pose_world_landmarks is None:
                continue
            points = np.array([[p.x, p.y, p.z] for p in found.pose_world_landmarks.landmark])
            keypoints_m[row] = [points[list(joint)].mean(axis=0) for joint in _JOINTS]
    return keypoints_m


def main(args: list[str] | None = None) -> int:
    """Print a line for each session, and the mean."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    given = parser.parse_args(args)
    rows = []
    for folder in given.sessions:
        session = load_session(folder)
        rows.append(accelerations(session, mediapipe_keypoints(session)))
        print(f"{session.name}: MediaPipe {rows[-1][0]:.1f}, standing still {rows[-1][1]:.1f}")
    mean = np.mean(rows, axis=0)
    print(f"mean: MediaPipe {mean[0]:.2f}, standing still {mean[1]:.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
