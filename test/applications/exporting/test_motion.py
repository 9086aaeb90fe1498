"""The moments of a constant rate, by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cardbox_tracker.applications.exporting.motion import MISSING, Motion
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.person.skeleton import STATE_NAMES


def motion_at(*times_ms: int) -> Motion:
    """A motion whose torso_y is the time in seconds."""
    stamps = np.array(times_ms, np.int64) * 1_000_000
    joints = np.repeat(stamps[:, None] / 1e9, len(STATE_NAMES), axis=1)
    shapes = (6, 3), (2, 3), (2, 3), (6, 3), (6,), (0,)
    others = [np.zeros((len(stamps), *shape)) for shape in shapes]
    return Motion(stamps, stamps / 1e9, ("tracking",) * len(stamps), joints, *others)


def test_images_of_a_constant_rate_stay() -> None:
    motion = motion_at(500, 600, 700)
    even = motion.evenly()
    assert motion.rate_hz == 10.0
    assert even.stamp_ns.tolist() == motion.stamp_ns.tolist()
    assert even.states.tolist() == motion.states.tolist()


def test_a_dropped_image_is_a_gap_and_others_are_the_nearest() -> None:
    even = motion_at(0, 104, 196, 400, 500, 600).evenly()
    assert even.time_s == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    assert even.states[:, 0] == pytest.approx([0, 0.104, 0.196, np.nan, 0.4, 0.5, 0.6], nan_ok=True)
    assert even.state == (*["tracking"] * 3, MISSING, *["tracking"] * 3)
    assert np.flatnonzero(~even.is_seen).tolist() == [3]


def test_a_single_image_has_a_rate() -> None:
    motion = motion_at(700)
    assert motion.rate_hz == 1.0
    assert motion.evenly().states.tolist() == motion.states.tolist()


def test_a_clock_that_jumps_is_named() -> None:
    """Hours without an image are no motion of a constant rate."""
    with pytest.raises(CardboxError, match=r"jump by 3600 s after the image at 0\.200 s, so 36003"):
        motion_at(0, 100, 200, 3_600_200).evenly()


def test_an_image_without_keypoints_is_a_gap() -> None:
    motion = motion_at(0, 100)
    points = motion.keypoints_m.copy()
    points[1, 3, 2] = np.nan
    assert replace(motion, keypoints_m=points).is_seen.tolist() == [True, False]
