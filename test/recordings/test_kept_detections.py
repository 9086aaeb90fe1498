"""A second pass over the same images takes what the detector found from a file."""

from __future__ import annotations

from unittest.mock import Mock

import numpy as np

from cardbox_tracker.detectors.detector import KeptDetections
from cardbox_tracker.detectors.pose_network import Detection

IMAGES = np.zeros((3, 5, 7, 3), np.uint8)


def detector() -> Mock:
    rng = np.random.default_rng(0)

    def find() -> Detection:
        mask = rng.integers(0, 256, (5, 7)).astype(np.uint8)
        return Detection(rng.random((33, 2)), rng.random(33), mask, rng.random((33, 3)))

    return Mock(all_in=Mock(side_effect=lambda *_: [find()]))


def passed(
    kept: KeptDetections, span: tuple[float, float], is_whole: bool = True
) -> list[Detection]:
    kept.start(*span)
    found = [kept(number, number, image)[0] for number, image in enumerate(IMAGES)]
    if is_whole:
        kept.end()
    return found


def test_a_second_pass_finds_the_same_without_a_network() -> None:
    network = detector()
    kept = KeptDetections(network)
    first, second = passed(kept, (0.0, 1.0)), passed(kept, (0.0, 1.0))
    assert network.all_in.call_count == len(IMAGES)
    for one, other in zip(first, second, strict=True):
        assert np.array_equal(one.points_px, other.points_px)
        assert np.array_equal(one.silhouette(), other.silhouette())
        assert one.spatial_m is not None
        assert np.array_equal(one.spatial_m, other.spatial_m)


def test_another_span_or_a_pass_that_was_broken_off_begins_anew() -> None:
    network = detector()
    kept = KeptDetections(network)
    passed(kept, (0.0, 1.0), is_whole=False)
    passed(kept, (0.0, 1.0))
    passed(kept, (0.5, 1.0))
    assert network.all_in.call_count == 3 * len(IMAGES)
    assert network.restart.call_count == 3
