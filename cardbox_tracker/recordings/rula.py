"""``cardbox rula``: RULA scores of a recording, from samples of each image's posterior."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.ergonomics.config import RulaConfig
from cardbox_tracker.ergonomics.distribution import SAMPLES, neck_samples, score_distribution
from cardbox_tracker.ergonomics.recording import RulaRow
from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.recordings.moment_images import MomentImages
from cardbox_tracker.recordings.silhouettes import RecordedFrame

# A separate random stream leaves the tracker's random numbers unchanged.
_STREAM = 0x52756C61


class RulaObserver:
    """Observer of :func:`.track.track_recording` that scores each image.

    Attributes:
        rows: one row an image, in order.
    """

    def __init__(self, config: RulaConfig, seed: int, images: MomentImages | None = None) -> None:
        """Seed the random numbers; the same images and ``seed`` give the same rows.

        Args:
            config: settings of the score.
            seed: random seed.
            images: keeps the images of high scores; None if none are wanted.
        """
        self._config = config
        self._images = images
        self._rng = np.random.default_rng([seed, _STREAM])
        self.rows: list[RulaRow] = []

    def __call__(self, frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        """Append the row of one image."""
        scores = necks = None
        if estimate.posture is not None:
            postures = tracker.sample(estimate, SAMPLES, self._rng)
            if estimate.neck is not None and estimate.neck_stddev is not None:
                necks = neck_samples(estimate.neck, estimate.neck_stddev, SAMPLES, self._rng)
            scores = score_distribution(tracker.body, postures, self._config, necks)
        has_neck = necks is not None
        row = RulaRow(frame.stamp_ns, estimate.state, scores, frame.time_s, has_neck)
        self.rows.append(row)
        if self._images is not None:
            self._images.add(row, frame, estimate, tracker)
