"""Images of several cameras find each other by stamp: of recordings, and as they arrive."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from cardbox_tracker.camera.pairing import Arrivals, side_by_side

Sets = list[tuple[int | None, ...]]


def paired(*streams: list[int], tolerance: int = 5) -> Sets:
    return list(side_by_side([iter(s) for s in streams], int, tolerance))


def test_what_is_near_belongs_together_and_nothing_is_used_twice() -> None:
    assert paired([10, 20, 30], [11, 21, 31]) == [(10, 11), (20, 21), (30, 31)]
    # One begins earlier, is silent for a while, and ends earlier.
    assert paired([20, 30, 40, 50], [11, 21, 41]) == [
        (None, 11),
        (20, 21),
        (30, None),
        (40, 41),
        (50, None),
    ]
    assert paired([10, 30], [12, 22, 32], [29]) == [
        (10, 12, None),
        (None, 22, None),
        (30, 32, 29),
    ]
    assert paired([], [1]) == [(None, 1)]


class Live:
    """What is handed on of items that are their own stamps."""

    def __init__(self, count: int = 2, tolerance: int = 5) -> None:
        self.arrivals: Arrivals[int] = Arrivals(count, tolerance)
        self.sets: Sets = []

    def send(self, *items: tuple[int, int]) -> Sets:
        """Let items of streams arrive, in that order; return the sets that are complete by then."""
        before = len(self.sets)
        for number, stamp in items:
            self.arrivals.add(number, stamp, stamp)
            self.sets += self.arrivals.sets()
        return self.sets[before:]


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=1, max_size=9))
def test_what_arrives_is_paired_as_in_a_recording(jitter: list[tuple[int, int]]) -> None:
    """Two cameras that are within half a period of each other, one of them with a lost image."""
    streams = [[20 * k + shift[n] for k, shift in enumerate(jitter, 1)] for n in (0, 1)]
    del streams[0][2:3]
    streams = [[*stream, 10_000] for stream in streams]
    live = Live(tolerance=10)
    for stamp, number in sorted((s, n) for n, stream in enumerate(streams) for s in stream):
        live.send((number, stamp))
    assert live.sets == paired(*streams, tolerance=10)


@given(st.lists(st.tuples(st.integers(0, 2), st.integers(1, 99)), max_size=60))
def test_in_any_order_nothing_comes_twice_and_time_does_not_go_back(
    items: list[tuple[int, int]],
) -> None:
    live = Live(3)
    live.send(*items)
    earliest = [min(s for s in taken if s is not None) for taken in live.sets]
    assert earliest == sorted(set(earliest))


def test_a_pair_is_complete_at_once_in_either_order() -> None:
    live = Live()
    assert live.send((0, 10)) == []
    assert live.send((1, 12)) == [(10, 12)]
    assert live.send((1, 20)) == []
    assert live.send((0, 21)) == [(21, 20)]


def test_a_lost_image_delays_its_set_by_one_image() -> None:
    live = Live()
    live.send((0, 10), (1, 10), (0, 20))
    assert live.send((0, 30)) == []
    assert live.send((1, 30)) == [(20, None), (30, 30)]


def test_a_camera_that_is_silent_is_waited_for_a_while_and_again_when_it_is_back() -> None:
    live = Live()
    live.send((0, 10), (1, 10))
    steps = [len(live.send((0, stamp))) for stamp in range(20, 200, 10)]
    # Two images wait; once it is given up, nothing waits.
    assert steps[:2] == [0, 0]
    assert set(steps[2:6]) == {1}
    assert sum(steps) == len(steps)
    assert steps[-1] == 1
    # The first one back is too late for the set that has gone without it.
    assert live.send((1, 191)) == []
    assert live.arrivals.late == [0, 1]
    assert live.send((0, 200)) == []
    assert live.send((1, 201)) == [(200, 201)]


def test_the_first_camera_may_be_the_silent_one() -> None:
    live = Live()
    live.send((0, 10), (1, 10), *((1, stamp) for stamp in range(20, 120, 10)))
    assert live.sets[1:] == [(None, stamp) for stamp in range(20, 120, 10)]


def test_a_camera_that_never_sends_does_not_stop_the_others() -> None:
    live = Live(3)
    live.send(*((number, stamp) for stamp in range(10, 200, 10) for number in (0, 1)))
    assert live.sets[-1] == (190, 190, None)
    assert len(live.sets) == 19


def test_a_camera_that_is_always_late_is_waited_for() -> None:
    live = Live()
    live.send((0, 10))
    for stamp in range(20, 200, 10):
        live.send((0, stamp), (1, stamp - 10))
    assert live.sets == [(stamp, stamp) for stamp in range(10, 190, 10)]
    assert live.arrivals.late == [0, 0]


def test_a_camera_with_a_longer_queue_loses_nothing_when_the_other_one_is_back() -> None:
    """The first camera's queue has ten images, in which the second one was silent."""
    live = Live()
    first, second = [10 * n for n in range(1, 31)], [10 * n + 1 for n in range(11, 31)]
    for stamps in zip(first, second, strict=False):
        live.send(*enumerate(stamps))
    live.send(*((0, stamp) for stamp in first[len(second) :]))
    assert [stamp for stamp, _ in live.sets] == first
    assert live.arrivals.late[0] == 0
    assert live.sets[-1] == (first[-1], second[-1])


def test_without_stamps_the_order_of_arrival_counts() -> None:
    live = Live()
    assert live.send(*[(0, 0), (1, 0)] * 3) == [(0, 0)] * 3


def test_a_recording_that_starts_over_is_followed() -> None:
    live = Live()
    late_ns = 10**10
    live.send((0, late_ns), (1, late_ns), (0, late_ns + 10))
    live.send((0, 10), (1, late_ns + 10), (1, 10))
    assert live.send((0, 20), (1, 20))[-1] == (20, 20)


def test_a_clock_of_its_own_costs_neither_memory_nor_the_other_camera() -> None:
    ahead_ns = 10**12
    for ahead in (0, 1):
        live = Live()
        for stamp in range(10, 1000, 10):
            live.send(*((n, stamp + (ahead_ns if n == ahead else 0)) for n in (0, 1)))
        assert len(live.sets) > 80
        assert sum(live.arrivals.late) > 80
