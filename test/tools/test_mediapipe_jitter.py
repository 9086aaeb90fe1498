"""What shakes beside the shoulders counts; what moves with them does not."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import numpy as np
import pytest

from cardbox_tracker.evaluation.recorded.session import RecordedSession
from cardbox_tracker.evaluation.truth import GroundTruth
from tools.mediapipe_jitter import accelerations

IMAGES = 7


def session(keypoints_m: np.ndarray) -> RecordedSession:
    stamps_ns = np.arange(IMAGES, dtype=np.int64) * 100_000_000
    segments = np.array(["neutral"] * IMAGES)
    unknown = np.full((IMAGES, 3), np.nan)
    truth = cast(GroundTruth, None)
    return RecordedSession(
        "one", Path(), None, truth, {}, 0.0, stamps_ns, segments, keypoints_m, unknown, {}, None
    )


def test_a_hand_that_shakes_by_hand() -> None:
    true = np.zeros((IMAGES, 6, 3))
    # The whole person shakes, which is not seen beside the shoulders.
    true[::2, :, 0] = 1.0
    found = np.zeros_like(true)
    # 1 cm back and forth at 10 Hz: second differences of 2 cm in 0.1 s, of one of six.
    found[::2, 5, 1] = 0.01
    error, still = accelerations(session(true), found)
    assert error == pytest.approx(2.0 / 6.0)
    assert still == 0.0
