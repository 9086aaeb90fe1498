"""Measure how far the detector's points are from the truth, as a Markdown table.

python -m lab.tools.point_deviations SESSION... [--most N]

Each session is a folder with ``bag/`` and ``ground_truth.json``. The installed detector
(``cardbox detector --install``) finds the person in the images of the first camera. The tool prints
a row for each session, and one for all of them in which each source weighs alike (the films of one
repository are one source, and so are the rendered sessions).

The first table is of the points that the term :mod:`~cardbox_tracker.terms.joint_points`
compares with the model's joints: the median offset outwards and down from the true joint, and the
deviation in one direction from this median (1.48 times the median of the absolute differences). The
true wrist is on the line from elbow to hand, as the model's is. The ears have no truth.

The second table is of the bones: mean and standard deviation of the difference between the
component of the detector's bone and that of the true one along the horizontal line of sight, as
fractions of the length. The columns ``unturned`` have the same along the camera's axis, which is
right for a detector that knows the camera's pitch.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import Camera
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.detectors.image_points import ImagePoints
from cardbox_tracker.person.proportions import WRIST_SHARE
from cardbox_tracker.terms.joint_points import bones_of, level_sight, points_of
from cardbox_tracker.terms.joint_points_kernels import (
    ELBOW,
    HIPS,
    KNUCKLES,
    N_BONES,
    POINTS_OF_ARM,
    SHOULDER,
    SHOULDERS,
    TRUNK,
    WRIST,
)
from lab.tools.detected_sessions import first_camera_of, motions, opened, source_of, source_weights

FloatArray = NDArray[np.float64]

POINTS = {
    "shoulder": (SHOULDER, POINTS_OF_ARM + SHOULDER),
    "elbow": (ELBOW, POINTS_OF_ARM + ELBOW),
    "wrist": (WRIST, POINTS_OF_ARM + WRIST),
    "knuckles": (KNUCKLES, POINTS_OF_ARM + KNUCKLES),
    "hips": (HIPS,),
}
"""Rows of :func:`points_of` of each kind."""
BONES = {
    "upper arm": (0, 2),
    "forearm": (1, 3),
    "shoulders": (SHOULDERS,),
    "trunk": (TRUNK,),
}
"""Rows of :func:`bones_of` of each kind."""
LEAST_SCORE = 0.5
"""Points with a smaller score are not compared."""

N_TRUE = HIPS + 1
_OUTWARDS = np.array([1.0] * POINTS_OF_ARM + [-1.0] * POINTS_OF_ARM + [1.0])
# Standard deviation of a normal distribution, as a multiple of its median absolute difference.
_NORMAL = 1.4826


class Differences(NamedTuple):
    """Detector less truth in n images of a session; nan where one of them is unknown.

    Attributes:
        source: origin of the session.
        px: offset of each point outwards and down, px, (n, 9, 2).
        metres: the same at the joint's depth, (n, 9, 2).
        bones: component along the horizontal line of sight, as a fraction, (n, 6).
        unturned: component along the camera's axis, as a fraction, (n, 6).
    """

    source: str
    px: FloatArray
    metres: FloatArray
    bones: FloatArray
    unturned: FloatArray


def true_points(keypoints_m: FloatArray, hips_m: FloatArray) -> FloatArray:
    """Return the true joints (9, 3) in the order of :func:`points_of`, metres, optical frame.

    Args:
        keypoints_m: shoulder, elbow and hand of the left and the right arm, (6, 3).
        hips_m: middle of the hips, (3,).
    """
    joints = np.empty((N_TRUE, 3))
    for arm in range(2):
        shoulder, elbow, hand = keypoints_m[3 * arm : 3 * arm + 3]
        wrist = elbow + WRIST_SHARE * (hand - elbow)
        joints[POINTS_OF_ARM * arm : POINTS_OF_ARM * (arm + 1)] = shoulder, elbow, wrist, hand
    joints[HIPS] = hips_m
    return joints


def differences_of(
    points: ImagePoints, joints_m: FloatArray, camera: Camera
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the rows of :class:`Differences` of one image.

    Args:
        points: the detector's.
        joints_m: see :func:`true_points`.
        camera: camera with its pitch.
    """
    found = points_of(points)
    off_px = found[:N_TRUE, :2] - camera.project(joints_m)
    off_px[:, 0] *= _OUTWARDS
    off_px[found[:N_TRUE, 2] < LEAST_SCORE] = np.nan
    metres = off_px * joints_m[:, 2:] / camera.fx
    unknown = np.full(N_BONES, np.nan)
    shoulders = found[[SHOULDER, POINTS_OF_ARM + SHOULDER]]
    if points.spatial_m is None or shoulders[:, 2].min() < LEAST_SCORE:
        return off_px, metres, unknown, unknown
    bones = bones_of(points.spatial_m, found)
    bones[bones[:, 1] < LEAST_SCORE, 0] = np.nan
    axes = level_sight(camera, float(shoulders[:, 0].mean())), np.array([0.0, 0.0, 1.0])
    turned, unturned = (bones[:, 0] - _true_bones(joints_m) @ axis for axis in axes)
    return off_px, metres, turned, unturned


def _true_bones(joints_m: FloatArray) -> FloatArray:
    """Return the directions of the bones, (6, 3), in the order of :func:`bones_of`."""
    bones = np.empty((N_BONES, 3))
    for arm in range(2):
        first = POINTS_OF_ARM * arm
        bones[2 * arm] = joints_m[first + ELBOW] - joints_m[first + SHOULDER]
        bones[2 * arm + 1] = joints_m[first + KNUCKLES] - joints_m[first + ELBOW]
    bones[SHOULDERS] = joints_m[SHOULDER] - joints_m[POINTS_OF_ARM + SHOULDER]
    bones[TRUNK] = joints_m[[SHOULDER, POINTS_OF_ARM + SHOULDER]].mean(axis=0) - joints_m[HIPS]
    directions: FloatArray = bones / np.linalg.norm(bones, axis=1, keepdims=True)
    return directions


def measured(folder: Path, most: int | None = None) -> Differences:
    """Run the detector over the first ``most`` images of the motions of a session.

    Raises:
        CardboxError: the folder is no session, cannot be read, has no image in which the detector
            finds the person, or the detector is not installed.
    """
    session = first_camera_of(folder)
    hips_m = session.hips_m
    if hips_m is None:
        hips_m = np.full((len(session.stamps_ns), 3), np.nan)
    joints = map(true_points, session.keypoints_m, hips_m)
    truth = dict(zip(session.stamps_ns.tolist(), joints, strict=True))
    rows = []
    with opened(session) as source:
        camera = source.first.camera.with_pitch(float(np.radians(session.truth.pitch_deg)))
        for taken in motions(session, source, most):
            if taken.stamp_ns in truth and taken.first.points is not None:
                rows.append(differences_of(taken.first.points, truth[taken.stamp_ns], camera))
    if not rows:
        raise CardboxError(
            f"the detector finds nobody in the images of {folder} that have a truth; leave the "
            "session out"
        )
    px, metres, bones, unturned = (np.array(column) for column in zip(*rows, strict=True))
    return Differences(source_of(session), px, metres, bones, unturned)


def weighted_median(values: FloatArray, weights: FloatArray) -> float:
    """Return the median of values (n,) with weights (n,); nan without values."""
    if not len(values):
        return float("nan")
    order = np.argsort(values)
    # The share below and half of each value's own, so that equal weights give the usual median.
    below = np.cumsum(weights[order]) - 0.5 * weights[order]
    return float(np.interp(0.5 * weights.sum(), below, values[order]))


def offset_and_deviation(offsets: FloatArray, weights: FloatArray) -> tuple[float, float, float]:
    """Return the medians across and down of offsets (n, 2), and the deviation from them."""
    if not len(offsets):
        return (float("nan"),) * 3
    across, down = (weighted_median(offsets[:, axis], weights) for axis in range(2))
    away = np.abs(offsets - (across, down)).ravel()
    return across, down, _NORMAL * weighted_median(away, np.repeat(weights, 2))


def mean_and_deviation(values: FloatArray, weights: FloatArray) -> tuple[float, float]:
    """Return mean and standard deviation of values (n,) with weights (n,)."""
    if not len(values):
        return float("nan"), float("nan")
    mean = float(np.average(values, weights=weights))
    return mean, float(np.sqrt(np.average((values - mean) ** 2, weights=weights)))


def _known(
    sessions: Sequence[Differences], field: str, rows: Sequence[int]
) -> tuple[FloatArray, FloatArray]:
    """Return the known values of some points or bones of all sessions, and their weights."""
    values = []
    for one in sessions:
        array: FloatArray = getattr(one, field)[:, rows]
        flat = array.reshape(-1, *array.shape[2:])
        values.append(flat[np.isfinite(flat).reshape(len(flat), -1).all(axis=1)])
    weights = source_weights([one.source for one in sessions], [len(one) for one in values])
    return np.concatenate(values), weights


def _point_cells(sessions: Sequence[Differences]) -> Iterator[str]:
    for rows in POINTS.values():
        across, down, deviation = offset_and_deviation(*_known(sessions, "px", rows))
        across_m, down_m, deviation_m = offset_and_deviation(*_known(sessions, "metres", rows))
        yield (
            "-"
            if np.isnan(across)
            else (
                f"{across:+.1f} {down:+.1f} ± {deviation:.1f} px, {100 * across_m:+.1f} "
                f"{100 * down_m:+.1f} ± {100 * deviation_m:.1f} cm"
            )
        )


def _bone_cells(sessions: Sequence[Differences]) -> Iterator[str]:
    for field in ("bones", "unturned"):
        for rows in BONES.values():
            mean, deviation = mean_and_deviation(*_known(sessions, field, rows))
            yield "-" if np.isnan(mean) else f"{mean:+.2f} ± {deviation:.2f}"


def report(sessions: dict[str, Differences]) -> str:
    """Return the tables of sessions by name."""
    groups = {name: [one] for name, one in sessions.items()} | {"all": list(sessions.values())}
    points = [[n, str(sum(len(one.px) for one in g)), *_point_cells(g)] for n, g in groups.items()]
    bones = [[name, *_bone_cells(group)] for name, group in groups.items()]
    unturned = [f"{name}, unturned" for name in BONES]
    return "\n\n".join(
        [
            _table(["session", "images", *POINTS], points),
            _table(["session", *BONES, *unturned], bones),
        ]
    )


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main(args: list[str] | None = None) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("sessions", nargs="+", type=Path, metavar="SESSION")
    parser.add_argument(
        "--most", type=int, metavar="N", help="images of each session; all if unset"
    )
    given = parser.parse_args(args)
    try:
        print(report({one.name: measured(one, given.most) for one in given.sessions}))
    except CardboxError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
