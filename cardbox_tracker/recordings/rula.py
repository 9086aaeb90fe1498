"""``cardbox rula``: the scores of a recording while it is tracked, from the particles."""

from __future__ import annotations

import numpy as np

from cardbox_tracker.ergonomics.config import RulaConfig
from cardbox_tracker.ergonomics.distribution import SAMPLES, score_distribution
from cardbox_tracker.ergonomics.recording import RulaRow
from cardbox_tracker.estimation.estimate import Estimate
from cardbox_tracker.estimation.tracker import Tracker
from cardbox_tracker.recordings.silhouettes import RecordedFrame

# Apart from the tracker's random numbers, which must not depend on whether scores are asked for.
_STREAM = 0x52756C61


class RulaObserver:
    """Scores each image; an observer of :func:`.track.track_recording`.

    Attributes:
        rows: what was found, in the order of the images.
    """

    def __init__(self, config: RulaConfig, seed: int) -> None:
        """Begin; the same images and ``seed`` give the same rows."""
        self._config = config
        self._rng = np.random.default_rng([seed, _STREAM])
        self.rows: list[RulaRow] = []

    def __call__(self, frame: RecordedFrame, estimate: Estimate, tracker: Tracker) -> None:
        """Score one image."""
        scores = None
        if estimate.posture is not None:
            postures = tracker.sample(estimate, SAMPLES, self._rng)
            scores = score_distribution(tracker.body, postures, self._config)
        self.rows.append(RulaRow(frame.stamp_ns, estimate.state, scores))
