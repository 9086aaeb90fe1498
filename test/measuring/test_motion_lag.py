"""The lag between two cameras by the motion of the person."""

from __future__ import annotations

import numpy as np
import pytest

from cardbox_tracker.measuring.motion_lag import MotionLag, lag_of

RNG = np.random.default_rng(3)
MOVES = np.cumsum(RNG.normal(0.0, 0.1, (60, 5)), axis=0)


@pytest.mark.parametrize("lag", [-4, 0, 3, 7])
def test_the_lag_of_motions_is_found_where_some_joints_are_unknown(lag: int) -> None:
    here, there = MOVES[10:50].copy(), MOVES[10 - lag : 50 - lag].copy()
    here[5:20, 1] = np.nan
    there[10:25, 2] = np.nan
    assert lag_of(here, there, 8) == lag


def test_who_stands_or_moves_slowly_or_otherwise_shows_no_lag() -> None:
    still = RNG.normal(0.0, 0.001, (2, 40, 5))
    assert lag_of(*still, 8) is None
    # By less than a pixel.
    assert lag_of(0.001 * MOVES[7:47], 0.001 * MOVES[:40], 8) is None
    slow = np.linspace(0.0, 1.0, 48)[:, None]
    assert lag_of(slow[8:], slow[:-8], 8) is None
    assert lag_of(MOVES[:40], -MOVES[20:], 8) is None
    assert lag_of(np.full((40, 5), np.nan), MOVES[:40], 8) is None


@pytest.mark.parametrize(("known", "lag"), [(9, None), (14, 3)])
def test_a_few_heights_show_no_lag(known: int, lag: int | None) -> None:
    here = MOVES[10:50, :1].copy()
    here[known:] = np.nan
    assert lag_of(here, MOVES[7:47, :1], 8) == lag


def test_a_lag_lasts_while_nobody_moves_and_ends_with_the_clock() -> None:
    lag, told = MotionLag(), []
    for i in range(300):
        # They move, then stand.
        here, there = MOVES[min(i, 59) % 60], MOVES[max(min(i, 59) - 6, 0)]
        lag.add(i * 50_000_000, here, there)
        told.append(lag.verdict.holds)
    assert not any(told[:36]) and all(told[50:])
    assert "0.3 s later" in lag.remark("cam1")
    lag.add(0, MOVES[0], MOVES[0])
    assert len(lag._seen) == 1


@pytest.mark.parametrize("speed", [0.01, 1.0])
def test_other_motion_is_suspected_at_once_and_told_after_two_seconds(speed: float) -> None:
    """Who hardly moves shows nothing, and nor does the top of the silhouette alone."""
    other = np.random.default_rng(1).normal(0, 0.1, (60, 5))
    lag, top, there = MotionLag(), MotionLag(), speed * np.cumsum(other, 0)
    suspected, told = list[bool](), list[bool]()
    for i, (one, two) in enumerate(zip(speed * MOVES, there, strict=True)):
        lag.add(i * 50_000_000, one, two)
        joints = np.full(4, np.nan)
        top.add(i * 50_000_000, np.append(joints, one[0]), np.append(joints, two[0]))
        suspected.append(lag.is_suspected)
        told.append(lag.concordance.holds)
    assert not any(told[:36]) and told[44] == suspected[13] == (speed == 1.0)
    assert not suspected[44] and not (top.is_suspected or top.concordance.samples)
