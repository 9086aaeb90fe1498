"""How the stamps of a stream are read, whatever a camera or its clock does."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.camera.stamps import (
    ArrivalWatch,
    RecordedStamps,
    StampOrder,
    StampSequence,
    StreamStatistics,
)

S, MS = 1_000_000_000, 1_000_000
START = 1_000 * S


def orders(stamps: Iterable[int]) -> list[StampOrder]:
    sequence = StampSequence()
    return [sequence.add(stamp) for stamp in stamps]


def even(count: int, first_ns: int = START) -> list[int]:
    return [first_ns + i * 66 * MS for i in range(count)]


def test_an_even_stream_is_one_image_after_the_other() -> None:
    assert set(orders(even(50))) == {StampOrder.NEXT}


def test_a_repeated_stamp_is_used_once() -> None:
    twice = [stamp for stamp in even(5) for _ in range(2)]
    assert orders(twice) == [StampOrder.NEXT, StampOrder.REPEATED] * 5
    assert not StampOrder.REPEATED.is_usable


def test_without_stamps_the_order_of_arrival_counts() -> None:
    assert orders([0] * 20) == [StampOrder.UNSTAMPED] * 20
    assert StampOrder.UNSTAMPED.is_usable
    assert orders([START, 0, START + 1]) == [StampOrder.NEXT, StampOrder.UNSTAMPED, StampOrder.NEXT]


@pytest.mark.parametrize(
    ("back_ns", "order"), [(1, StampOrder.LATE), (S, StampOrder.LATE), (S + 1, StampOrder.RESTART)]
)
def test_back_by_more_than_a_second_is_a_new_start(back_ns: int, order: StampOrder) -> None:
    assert orders([START, START - back_ns]) == [StampOrder.NEXT, order]
    assert order.is_usable is (order is StampOrder.RESTART)


def test_what_was_overtaken_changes_nothing() -> None:
    a, b, c, d = even(4)
    assert orders([a, c, b, d]) == [
        StampOrder.NEXT,
        StampOrder.NEXT,
        StampOrder.LATE,
        StampOrder.NEXT,
    ]


def test_a_jump_ahead_is_a_gap() -> None:
    assert orders([*even(3), *even(3, START + 60 * S)])[3:] == [
        StampOrder.GAP,
        StampOrder.NEXT,
        StampOrder.NEXT,
    ]


def test_a_bag_that_loops_starts_anew_each_time() -> None:
    found = orders(even(60) * 3)
    assert [i for i, order in enumerate(found) if order is StampOrder.RESTART] == [60, 120]
    assert set(found) == {StampOrder.NEXT, StampOrder.RESTART}


@pytest.mark.promise("Whatever the stamps, each image has one place in the order")
@pytest.mark.parametrize("offset_s", [-3600, 3600, 5])
def test_of_two_clocks_one_is_followed(offset_s: int) -> None:
    both = zip(even(100), even(100, START + offset_s * S), strict=True)
    found = orders(stamp for pair in both for stamp in pair)
    assert found.count(StampOrder.RESTART) + found.count(StampOrder.GAP) == 1
    assert found.count(StampOrder.FOREIGN) >= 98
    assert found[::2] == [StampOrder.NEXT] * 100, "the one that was first goes on"


@pytest.mark.parametrize("images", [3, 10])
def test_a_recording_of_less_than_a_second_starts_over(images: int) -> None:
    found = orders(even(images) * 20)
    used = [order for order in found if order.is_usable]
    assert used.count(StampOrder.RESTART) == 19
    assert len(used) == images + 19 * (images - 1)


def test_a_second_copy_of_each_image_does_not_start_over() -> None:
    copied = [stamp for pair in zip(even(40)[3:], even(40), strict=False) for stamp in pair]
    assert StampOrder.RESTART not in orders([*even(3), *copied])


def test_one_wrong_stamp_does_not_hold_up_for_long() -> None:
    stamps = [*even(10), START - 3600 * S, *even(20, START + 660 * MS)]
    found = orders(stamps)
    assert found == [*[StampOrder.NEXT] * 10, StampOrder.RESTART, *[StampOrder.NEXT] * 20]


def test_a_publisher_that_stays_alone_is_followed() -> None:
    both = [stamp for pair in zip(even(20), even(20, 5 * S), strict=True) for stamp in pair]
    found = orders([*both, *even(20, 5 * S + 20 * 66 * MS)])
    assert found[-10:] == [StampOrder.NEXT] * 10


@given(st.lists(st.integers(-(2**31) * S, 2**31 * S), max_size=60))
@pytest.mark.promise("Whatever the stamps, each image has one place in the order")
def test_whatever_the_stamps_every_image_gets_one_answer(stamps: list[int]) -> None:
    statistics = StreamStatistics()
    for stamp in stamps:
        assert isinstance(statistics.add(stamp), StampOrder)
    assert sum(statistics.counts.values()) == len(stamps)
    assert 0.0 <= statistics.loss <= 1.0 and statistics.dropped >= 0


@pytest.mark.parametrize(
    ("stamps", "kinds"),
    [
        (even(60), set()),
        ([*even(60), *even(60, START + 100 * S)], set()),
        ([0] * 5, {"stamps that are zero"}),
        ([START] * 30, {"stamps that repeat"}),
        (
            [s for p in zip(even(30), even(30, 5 * S), strict=True) for s in p],
            {"stamps of two clocks"},
        ),
        (even(20) * 4, {"stamps that go back"}),
    ],
)
def test_what_is_wrong_with_the_stamps_is_said(stamps: list[int], kinds: set[str]) -> None:
    statistics = StreamStatistics()
    for stamp in stamps:
        statistics.add(stamp)
    assert set(statistics.remarks()) == kinds


@pytest.mark.promise("Whatever the stamps, each image has one place in the order")
@pytest.mark.parametrize("first", [1, 3, 7, 40])
def test_losses_are_counted_from_the_first_image_on(first: int) -> None:
    """Every third image of a second is lost, and two more in a row, at ``first``."""
    sent = [number * 66_666_667 for number in range(1, 100)]
    lost = {*range(0, 15, 3), first, first + 1} - {0}
    statistics = StreamStatistics()
    for number, stamp_ns in enumerate(sent):
        if number not in lost:
            statistics.add(stamp_ns)
    assert statistics.received + statistics.dropped == len(sent)


@given(
    st.lists(
        st.one_of(
            st.integers(START, START + 20 * S),
            st.just(0),
            st.integers(1, 2**62),
        ),
        max_size=60,
    )
)
def test_the_times_of_a_recorded_stream_always_increase(stamps: list[int]) -> None:
    """Whatever the stamps: what is left out of a live stream is left out, and no more."""
    recorded, live = RecordedStamps(), StampSequence()
    times = []
    for number, stamp in enumerate(stamps):
        time_ns = recorded.add(stamp, START + number * 66 * MS)
        assert (time_ns is None) == (not live.add(stamp).is_usable)
        times += [] if time_ns is None else [time_ns]
    assert times == sorted(set(times))


def times_of(stamps: Iterable[int]) -> tuple[list[int | None], list[str]]:
    recorded = RecordedStamps()
    times = [recorded.add(stamp, START + 66 * MS * n) for n, stamp in enumerate(stamps)]
    return times, recorded.remarks()


def test_recorded_stamps_that_increase_are_the_times_without_a_remark() -> None:
    stamps = even(30, 5 * S)
    assert times_of(stamps) == (stamps, [])


@pytest.mark.parametrize("first", [0, 3])
def test_without_stamps_the_recorders_clock_counts(first: int) -> None:
    """Also from some image on: the clock goes on from the last stamp."""
    stamps = [*even(first), *[0] * (12 - first)]
    times, remarks = times_of(stamps)
    assert times == even(12)
    assert "no stamp (it is zero)" in remarks[0]


@pytest.mark.parametrize("jump_s", [11, 3600, 1_700_000_000])
def test_a_clock_that_is_set_forward_goes_on_with_the_recorders(jump_s: int) -> None:
    stamps = even(12)
    times, remarks = times_of([*stamps[:6], *(stamp + jump_s * S for stamp in stamps[6:])])
    assert times == stamps
    assert f"jump forward by {jump_s} s" in remarks[0]


def test_images_that_are_lost_without_a_pause_of_the_recorder_are_told() -> None:
    stamps = [*even(6), *even(6, START + 5 * S)]
    times, (remark,) = times_of(stamps)
    assert times == stamps
    assert "jump forward by 4.6 s" in remark
    assert "images were lost" in remark


def test_a_pause_of_recorder_and_camera_is_one() -> None:
    stamps = [*even(6), *(stamp + 3600 * S for stamp in even(12)[6:])]
    recorded = RecordedStamps()
    assert [recorded.add(stamp, stamp + 5) for stamp in stamps] == stamps
    assert recorded.remarks() == []


def test_two_passes_of_a_long_loop_are_apart() -> None:
    once = even(150)
    times, remarks = times_of([*once, *once])
    assert times == even(300)
    assert "went back 1 times" in remarks[0]


def test_two_passes_of_a_short_loop_are_apart_but_for_the_image_that_shows_it() -> None:
    once = even(12)
    times, remarks = times_of([*once, *once])
    assert times == [*once, None, *even(24)[13:]]
    assert any("go back" in remark for remark in remarks)


def arrivals(
    stamps_s: Iterable[float], arrive_s: Iterable[float], ahead_s: float = 0.0
) -> dict[str, str]:
    """Return the remarks after images that arrive at these times, of a clock that is ahead."""
    watch, sequence = ArrivalWatch(), StampSequence()
    for stamp_s, arrived_s in zip(stamps_s, arrive_s, strict=True):
        stamp_ns = round((1000 + stamp_s + ahead_s) * 1e9)
        watch.add(stamp_ns, sequence.add(stamp_ns), arrived_s, round((1000 + arrived_s) * 1e9))
    return watch.remarks()


EVEN_S = np.arange(150) / 15


@pytest.mark.parametrize("seen", [range(15), (0, 14), (1, 13, 14)])
def test_bursts_are_told_also_where_most_of_their_images_are_left_out(seen: Sequence[int]) -> None:
    kept = np.isin(np.arange(150) % 15, seen)
    arrive_s = np.floor(EVEN_S) + 1 + np.arange(150) % 15 * 1e-3
    # The driver stamps an image when it is taken, or when it is sent.
    for stamps_s in (EVEN_S, arrive_s):
        told = arrivals(stamps_s[kept], arrive_s[kept])
        assert list(told) == ["bursts"] and "one every 1.0 s" in told["bursts"]


def test_lost_images_are_no_burst() -> None:
    rng = np.random.default_rng(2)
    for kept in (rng.random((20, 150)) < 0.25, rng.random((20, 150)) < 0.7):
        assert not any(arrivals(EVEN_S[one], EVEN_S[one]) for one in kept)


@pytest.mark.parametrize(
    ("stamps_s", "arrive_s"),
    [
        (EVEN_S, EVEN_S + 0.05 * np.sin(np.arange(150))),
        (EVEN_S, 0.5 * EVEN_S),
        (EVEN_S, 10 * EVEN_S),
        (EVEN_S % 1.5, EVEN_S),
        (EVEN_S, EVEN_S + 0.5 * (EVEN_S > 4)),
        (EVEN_S, EVEN_S + 0.5 * ((EVEN_S > 4) & (EVEN_S < 5))),
        (np.full(150, -1000.0), EVEN_S),
    ],
    ids=["jitter", "twice as fast", "slow motion", "a loop", "a pause", "a delay", "no stamps"],
)
def test_other_streams_are_no_bursts(stamps_s: np.ndarray, arrive_s: np.ndarray) -> None:
    assert "bursts" not in arrivals(stamps_s, arrive_s)


@pytest.mark.parametrize(("ahead_s", "is_told"), [(10.0, True), (0.1, False), (-3600.0, False)])
def test_stamps_in_the_future_are_told(ahead_s: float, is_told: bool) -> None:
    told = arrivals(EVEN_S, EVEN_S, ahead_s)
    assert list(told) == ["stamps ahead"] * is_told
    assert not is_told or "10.0 s ahead" in told["stamps ahead"]
