"""A tracked motion: the results for all images as arrays, and their body in the level frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.camera.camera import level_to_optical
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.kinematics import PosedBodies, pose
from cardbox_tracker.person.legs import LEG_KEYPOINT_NAMES, floor_m
from cardbox_tracker.person.model import BodyModel, CameraPose
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import (
    KEYPOINT_NAMES,
    POSTURE_GROUPS,
    SHOULDERS,
    STATE_NAMES,
    Group,
    KeypointState,
    joints_of,
    rows_of,
)
from cardbox_tracker.recordings.result_reader import Results
from cardbox_tracker.recordings.result_table import (
    LEG_POINT_COLUMNS,
    PALM_COLUMNS,
    POINT_COLUMNS,
    WRIST_COLUMNS,
)
from cardbox_tracker.recordings.smoothing import rates_of

MISSING = "missing"
"""State of a moment at which there is no image."""


@dataclass(frozen=True)
class Motion:
    """Results for n images in order of time; gaps are images without a posture."""

    stamp_ns: NDArray[np.int64]  #: stamps of the images, (n,), rising
    time_s: FloatArray  #: seconds from the start of the recording, (n,)
    state: tuple[str, ...]  #: tracking state of each image, n texts
    joints: FloatArray  #: ``STATE_NAMES``, (n, number), rad and metres; nan where they are unknown
    #: (n, 6, 3), ordered as ``KEYPOINT_NAMES``, metres in the optical frame of the first camera;
    #: nan in gaps
    keypoints_m: FloatArray
    #: flexion, deviation and rotation of the forearm of both hands, (n, 2, 3), rad; nan where they
    #: are unknown, as all that follows
    wrists: FloatArray
    palms: FloatArray  #: normals out of the palms, (n, 2, 3), unit vectors in the optical frame
    #: (n, 6, 3), ordered as ``LEG_KEYPOINT_NAMES``, in the optical frame; nan where they are hidden
    leg_points_m: FloatArray
    leg_stddev_m: FloatArray  #: their standard deviations, (n, 6)
    #: returns velocities and accelerations, (n, number), by ``RATE_COLUMNS``
    rates: Callable[[], FloatArray]

    @classmethod
    def of(cls, results: Results) -> Motion:
        """Return the motion of results; raise CardboxError if no image has a posture."""
        n = len(results.state)
        hidden = np.array(
            [
                [text == KeypointState.HIDDEN for text in results.texts_of(f"{name}_state")]
                for name in LEG_KEYPOINT_NAMES
            ]
        ).T
        points_m = results.of(LEG_POINT_COLUMNS).reshape(n, len(LEG_KEYPOINT_NAMES), 3)
        motion = cls(
            results.stamp_ns,
            results.time_s,
            results.state,
            results.of(STATE_NAMES),
            results.of(POINT_COLUMNS).reshape(n, len(KEYPOINT_NAMES), 3),
            results.of(WRIST_COLUMNS).reshape(n, 2, 3),
            results.of(PALM_COLUMNS).reshape(n, 2, 3),
            np.where(hidden[..., None], np.nan, points_m),
            results.of([f"{name}_stddev_m" for name in LEG_KEYPOINT_NAMES]),
            partial(rates_of, results),
        )
        if not motion.is_seen.any():
            raise CardboxError(
                f"{results.path} has no image with a posture; track a recording of a person"
            )
        return motion

    def values_of(self, *groups: Group, side: str = "") -> FloatArray:
        """Return the joints of groups of the skeleton, or of one side of them, (n, k)."""
        return self.joints[:, rows_of(*groups, side=side)]

    @property
    def states(self) -> FloatArray:
        """d1..d12, ``torso_x`` and ``torso_z``, (n, 14), rad and metres; nan in gaps."""
        return self.values_of(*POSTURE_GROUPS, Group.PLACE)

    @property
    def is_seen(self) -> NDArray[np.bool_]:
        """Whether each image has a posture, (n,)."""
        keypoints = self.keypoints_m.reshape(len(self.states), 3 * len(KEYPOINT_NAMES))
        known = np.isfinite(np.hstack([self.states, keypoints]))
        return np.asarray(known.all(axis=1))

    @property
    def has_legs(self) -> bool:
        """Whether an image has legs."""
        return bool(np.isfinite(self.values_of(Group.LEG)).any())

    @property
    def has_hands(self) -> bool:
        """Whether an image has a hand."""
        return bool(np.isfinite(self.palms).any())

    @property
    def rate_hz(self) -> float:
        """Images per second: the inverse of the median time between them; 1 for a single image."""
        steps_ns = np.diff(self.stamp_ns)
        return 1.0 if len(steps_ns) == 0 else round(1e9 / float(np.median(steps_ns)), 4)

    def without(self, is_gap: NDArray[np.bool_]) -> Motion:
        """Return the motion with gaps at the images (n,) of the mask."""

        def emptied(values: FloatArray) -> FloatArray:
            return np.where(is_gap.reshape(-1, *[1] * (values.ndim - 1)), np.nan, values)

        changed: dict[str, Any] = {name: emptied(getattr(self, name)) for name in _VALUES}
        return replace(self, **changed)

    def evenly(self) -> Motion:
        """Return the motion at moments of equal distance, for formats with a constant rate.

        Each moment has the nearest image, at most half a step away; without one it is a gap. Raises
        CardboxError if most are gaps, because the stamps jump.
        """
        since_ns = self.stamp_ns - self.stamp_ns[0]
        step_ns = 1e9 / self.rate_hz
        count = round(float(since_ns[-1]) / step_ns) + 1
        if count > 2 * len(since_ns):
            jump = int(np.argmax(np.diff(since_ns)))
            raise CardboxError(
                f"the stamps jump by {np.diff(since_ns)[jump] / 1e9:.6g} s after the image at "
                f"{self.time_s[jump]:.3f} s, so {count} frames at {self.rate_hz:g} Hz would be "
                f"made of {len(since_ns)} images; export --to trc or mot, which have the time of "
                "each image, or tables of the images before and after the jump"
            )
        wanted_ns = np.arange(count) * step_ns
        nearest = np.searchsorted((since_ns[:-1] + since_ns[1:]) / 2, wanted_ns)
        is_gap = np.abs(since_ns[nearest] - wanted_ns) > step_ns / 2
        taken: dict[str, Any] = {name: getattr(self, name)[nearest] for name in _VALUES}
        return replace(
            self,
            stamp_ns=self.stamp_ns[0] + np.round(wanted_ns).astype(np.int64),
            time_s=self.time_s[0] + wanted_ns / 1e9,
            state=tuple(np.where(is_gap, MISSING, np.array(self.state)[nearest]).tolist()),
            **taken,
        ).without(is_gap)


def held(values: FloatArray) -> FloatArray:
    """Return values (n, k) with the last known row, or the first, in gaps; 0 if none is known."""
    known = np.isfinite(values).all(1)
    if not known.any():
        return np.zeros_like(values)
    last = np.maximum.accumulate(np.where(known, np.arange(len(values)), -1))
    found: FloatArray = values[np.where(last < 0, np.argmax(known), last)]
    return found


_VALUES = [entry.name for entry in fields(Motion)][3:-1]

# Rounding in tables is far below the first. A shoulder rises by less than the second.
_MOST_APART_M = 0.005
_MOST_RISE_M = 0.15


def in_reference(optical: FloatArray, body: BodyModel | None) -> FloatArray:
    """Return points, m, or directions (..., 3) of the optical frame in the reference frame.

    The body has pitch and roll of the camera; without it the camera is level.
    """
    tilt = CameraPose() if body is None else body.camera_pose
    return np.asarray(optical @ level_to_optical(tilt.pitch_rad, tilt.roll_rad))


def floor_below(body: BodyModel | None) -> FloatArray:
    """Return the origin, (3,), m in the reference frame: on the floor, if known, or the camera."""
    height_m = None if body is None else floor_m(body)
    return np.array([0.0, 0.0, height_m or 0.0])


def frames_of(motion: Motion, body: BodyModel) -> PosedBodies:
    """Return the body in each image, with the shoulders raised as in the motion."""
    rigid = pose(body.rigid, motion.states)
    shoulders_m = in_reference(motion.keypoints_m, body)[:, SHOULDERS]
    moved_m = shoulders_m - rigid.keypoints_m[:, SHOULDERS]
    axes = np.array([joint.axis for joint in joints_of(Group.CLAVICLE)])
    rise_m = np.einsum("nkj,nji,ki->nk", moved_m, rigid.torso_rotation, axes)
    return pose(body, motion.states, clavicles_m=rise_m)


def images_of_body(motion: Motion, body: BodyModel) -> Motion:
    """Return the motion with gaps where a running tracker got another body.

    Raises CardboxError if most images were tracked with another one.
    """
    keypoints_m = in_reference(motion.keypoints_m, body)
    frames = frames_of(motion, body)
    apart_m = np.linalg.norm(frames.keypoints_m - keypoints_m, axis=-1)
    apart_m = np.nan_to_num(apart_m).max(axis=1)
    rise_m = np.nan_to_num(np.abs(frames.clavicles_m)).max(axis=1)
    is_other = motion.is_seen & ((apart_m > _MOST_APART_M) | (rise_m > _MOST_RISE_M))
    if 2 * is_other.sum() > motion.is_seen.sum():
        raise CardboxError(
            f"the results are not those of the body: joints differ by {max(apart_m):.3f} m, "
            f"shoulders rise by {max(rise_m):.3f} m; give the model with which they were tracked, "
            "which 'cardbox track' writes beside the table OUT.csv as OUT.body.yaml"
        )
    return motion.without(is_other)
