"""RULA of a recording's images: the neck counts where its angles are known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import cv2
import numpy as np

from cardbox_tracker.body.proportions import body_from_proportions
from cardbox_tracker.ergonomics.config import RulaConfig
from cardbox_tracker.ergonomics.moments import worst_moments
from cardbox_tracker.estimation.estimate import NO_PERSON, TRACKING, UNCERTAIN, Estimate
from cardbox_tracker.recordings.moment_images import MomentImages
from cardbox_tracker.recordings.rula import RulaObserver
from cardbox_tracker.recordings.silhouettes import RecordedFrame
from cardbox_tracker.vision.camera import Camera


class Still:
    """A tracker that is sure that the person stands upright, with hanging arms."""

    body = body_from_proportions(1.75, 2.0)
    stamp_ns, time_s = 0, 0.0

    def sample(self, estimate: Estimate, count: int, rng: np.random.Generator) -> np.ndarray:
        """Every sample is the posture itself."""
        return np.tile(cast(Any, estimate.posture), (count, 1))


def likeliest(*estimates: Estimate) -> list[int | None]:
    observer = RulaObserver(RulaConfig(), seed=0)
    for estimate in estimates:
        observer(cast(Any, Still()), estimate, cast(Any, Still()))
    return [None if row.scores is None else row.scores.likeliest for row in observer.rows]


def test_a_bent_neck_raises_the_score() -> None:
    """On the worksheet, A 2 with necks 1 and 3 give 2 and 3."""
    plain = Estimate(TRACKING, np.zeros(12), np.zeros(12))
    bent = replace(plain, neck=np.array([0.0, 0.5]), neck_stddev=np.full(2, 0.01))
    assert likeliest(plain, bent, Estimate(NO_PERSON)) == [2, 3, None]


def observed(images: MomentImages, *pitches_rad: float, state: str = TRACKING) -> RulaObserver:
    """Return an observer of one image a second, in which the person bows by each angle."""
    observer = RulaObserver(RulaConfig(), 0, images)
    tracker = Still()
    cast(Any, tracker).camera = Camera(320, 240, 330.0, 330.0, 159.5, 119.5)
    grey = np.full((240, 320), 128, np.uint8)
    for number, pitch_rad in enumerate(pitches_rad):
        posture = np.zeros(12)
        posture[2] = pitch_rad
        frame = RecordedFrame(number * 10**9, float(number), grey, grey)
        estimate = Estimate(state, posture, np.zeros(12), cost_px=0, iou=1.0)
        observer(frame, estimate, cast(Any, tracker))
    return observer


def test_the_images_of_the_worst_moments_are_kept() -> None:
    """Trunks of 1, 3 and 4 give 2, 3 and 4 or more; of equal scores the first ones stay."""
    images = MomentImages(most=2)
    rows = observed(images, 0.0, 0.6, 1.2, 0.6, 0.0).rows
    assert sorted(images.by_stamp()) == [1 * 10**9, 2 * 10**9]
    worst, *_ = worst_moments(rows).rows
    jpeg = np.frombuffer(images.by_stamp()[worst.stamp_ns], np.uint8)
    picture = cv2.imdecode(jpeg, cv2.IMREAD_COLOR)
    assert picture is not None
    assert picture.shape == (480, 640, 3)


def test_no_image_of_an_uncertain_posture_is_kept() -> None:
    images = MomentImages()
    observed(images, 0.6, state=UNCERTAIN)
    assert images.by_stamp() == {}
