"""A tracked motion: the results for all images of a recording as arrays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.sizes import FloatArray
from cardbox_tracker.person.skeleton import KEYPOINT_NAMES

MISSING = "missing"
"""State of a moment at which there is no image."""

_MOST_FRAMES = 1_000_000


@dataclass(frozen=True)
class Motion:
    """Results for n images in order of time; gaps are images without a posture.

    Attributes:
        stamp_ns: stamps of the images, (n,), ascending.
        time_s: seconds from the start of the recording, (n,).
        state: tracking state of each image, n texts.
        states: d1..d12, ``torso_x`` and ``torso_z``, (n, 14), rad and metres; nan in gaps.
        neck: ``neck_yaw`` and ``neck_pitch``, (n, 2), rad; nan while the face is not seen.
        keypoints_m: (n, 6, 3), ordered as ``KEYPOINT_NAMES``, metres in the optical frame of the
            first camera; nan in gaps.
    """

    stamp_ns: NDArray[np.int64]
    time_s: FloatArray
    state: tuple[str, ...]
    states: FloatArray
    neck: FloatArray
    keypoints_m: FloatArray

    @property
    def is_seen(self) -> NDArray[np.bool_]:
        """Whether each image has a posture, (n,)."""
        keypoints = self.keypoints_m.reshape(len(self.states), 3 * len(KEYPOINT_NAMES))
        known = np.isfinite(np.hstack([self.states, keypoints]))
        return np.asarray(known.all(axis=1))

    @property
    def rate_hz(self) -> float:
        """Images per second: the inverse of the median time between them; 1 for a single image."""
        steps_ns = np.diff(self.stamp_ns)
        return 1.0 if len(steps_ns) == 0 else round(1e9 / float(np.median(steps_ns)), 4)

    def without(self, is_gap: NDArray[np.bool_]) -> Motion:
        """Return the motion with gaps at the images (n,) of the mask."""
        return replace(
            self,
            states=np.where(is_gap[:, None], np.nan, self.states),
            neck=np.where(is_gap[:, None], np.nan, self.neck),
            keypoints_m=np.where(is_gap[:, None, None], np.nan, self.keypoints_m),
        )

    def evenly(self) -> Motion:
        """Return the motion at moments of equal distance, for formats with a constant rate.

        Each moment has the nearest image, at most half a step away; without one it is a gap. Images
        of a constant rate stay as they are.

        Raises:
            CardboxError: there are too many moments, which is due to wrong stamps.
        """
        since_ns = self.stamp_ns - self.stamp_ns[0]
        step_ns = 1e9 / self.rate_hz
        count = round(float(since_ns[-1]) / step_ns) + 1
        if count > _MOST_FRAMES:
            raise CardboxError(
                f"the images span {since_ns[-1] / 1e9:.0f} s, which are {count} frames of "
                f"{self.rate_hz:g} Hz; expected at most {_MOST_FRAMES}: remove images with wrong "
                "stamps"
            )
        wanted_ns = np.arange(count) * step_ns
        nearest = np.searchsorted((since_ns[:-1] + since_ns[1:]) / 2, wanted_ns)
        is_gap = np.abs(since_ns[nearest] - wanted_ns) > step_ns / 2
        return Motion(
            self.stamp_ns[0] + np.round(wanted_ns).astype(np.int64),
            self.time_s[0] + wanted_ns / 1e9,
            tuple(np.where(is_gap, MISSING, np.array(self.state)[nearest]).tolist()),
            self.states[nearest],
            self.neck[nearest],
            self.keypoints_m[nearest],
        ).without(is_gap)
