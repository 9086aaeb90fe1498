"""Groups the images of several cameras by their stamps.

Images within a tolerance of the earliest one belong together. :func:`side_by_side` reads
recordings, where the next image of each stream is known. :class:`Arrivals` groups images of live
cameras, any of which may be late or stop.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Generic, TypeVar

from cardbox_tracker.common.errors import CardboxError

T = TypeVar("T")

MOST_CAMERAS = 4

TOLERANCE_NS = 16_000_000
"""Tolerance where the period is unknown: half a period of 30 Hz."""

# Number of images of another camera that may wait for a delayed one.
_WAITING = 2
# After this many missed sets a camera is not waited for until it sends again.
_PATIENCE = 5
# Stamps that go back by more than the network reorders mean a restart or another clock.
_RESTART_NS = 1_000_000_000


def camera_names(cameras: Sequence[str]) -> list[str]:
    """Return the namespaces of cameras without outer slashes; that of a camera alone may be "".

    Raises CardboxError if there are too many names, or a name is empty or occurs twice.
    """
    names = [camera.strip("/") for camera in cameras]
    is_alone = len(names) == 1
    if len(names) > MOST_CAMERAS or len(set(names)) < len(names) or not (is_alone or all(names)):
        raise CardboxError(
            f"the cameras are {', '.join(cameras)}; expected one to {MOST_CAMERAS} "
            "different namespaces"
        )
    return names


def side_by_side(
    streams: Sequence[Iterator[T]], stamp_ns: Callable[[T], int], tolerance_ns: int
) -> Iterator[tuple[T | None, ...]]:
    """Group items by time, each once, in order, to ``tolerance_ns`` after the group's first."""
    heads = [next(stream, None) for stream in streams]
    while any(head is not None for head in heads):
        chosen = _together([None if h is None else stamp_ns(h) for h in heads], tolerance_ns)
        yield tuple(
            head if is_chosen else None for head, is_chosen in zip(heads, chosen, strict=True)
        )
        for number, is_chosen in enumerate(chosen):
            if is_chosen:
                heads[number] = next(streams[number], None)


def _together(stamps_ns: Sequence[int | None], tolerance_ns: int) -> list[bool]:
    """Return whether the next item of each stream, None if missing, belongs to this group."""
    first_ns = min(stamp_ns for stamp_ns in stamps_ns if stamp_ns is not None)
    return [stamp_ns is not None and stamp_ns - first_ns <= tolerance_ns for stamp_ns in stamps_ns]


class Arrivals(Generic[T]):
    """Groups items as they arrive, like :func:`side_by_side`, with a limited wait.

    A set is complete once every stream has sent the item that belongs to it, or a later one. A
    stream that sends nothing is waited for until another has sent two more items. After five such
    sets it is no longer waited for until it sends again. A stream that is behind, because its queue
    is longer, sends, so it is waited for while it catches up. Items that arrive after their set are
    dropped. If the stamps of a stream go back by more than a second, everything is reset.

    Attributes:
        tolerance_ns: items whose stamps are this near to the earliest one belong together.
        late: number of items of each stream that came too late.
    """

    def __init__(self, count: int, tolerance_ns: int) -> None:
        self.tolerance_ns = tolerance_ns
        self.late = [0] * count
        self._items: list[deque[tuple[int, T]]] = [deque() for _ in range(count)]
        self.restart()

    def restart(self) -> None:
        """Drop all items, since the stamps start again."""
        for items in self._items:
            items.clear()
        self._missed = [0] * len(self._items)
        self._newest_ns = [0] * len(self._items)
        # Number of items of each stream, and these numbers when each stream sent last.
        self._received = [0] * len(self._items)
        self._before = [[0] * len(self._items) for _ in self._items]
        # Earliest stamp of the last set, and the streams that had items in it.
        self._last_ns: int | None = None
        self._chosen = [False] * len(self._items)

    def add(self, number: int, stamp_ns: int, item: T) -> None:
        """Add an item of stream ``number``; a stamp of 0 means that it has none."""
        if stamp_ns and self._newest_ns[number] - stamp_ns > _RESTART_NS:
            self.restart()
        elif stamp_ns and self._is_late(number, stamp_ns):
            self.late[number] += 1
            if self._last_ns is not None and self._last_ns - stamp_ns < _RESTART_NS:
                self._missed[number] = 0
            return
        self._missed[number] = 0
        self._newest_ns[number] = stamp_ns
        self._received[number] += 1
        self._before[number] = [*self._received]
        items = self._items[number]
        items.append((stamp_ns, item))
        if len(items) > _WAITING + 1:
            # These items may be from a clock that is ahead, so their time may never come.
            items.popleft()
            self.late[number] += 1

    def sets(self) -> Iterator[tuple[T | None, ...]]:
        """Yield each complete set, with an item or None for each stream."""
        while self._is_complete():
            stamps_ns = [items[0][0] if items else None for items in self._items]
            chosen = _together(stamps_ns, self.tolerance_ns)
            self._last_ns = min(stamp_ns for stamp_ns in stamps_ns if stamp_ns is not None)
            self._chosen = chosen
            for number, items in enumerate(self._items):
                self._missed[number] += not items
            yield tuple(
                items.popleft()[1] if is_chosen else None
                for items, is_chosen in zip(self._items, chosen, strict=True)
            )

    def _is_late(self, number: int, stamp_ns: int) -> bool:
        if stamp_ns <= self._newest_ns[number]:
            return True
        if self._last_ns is None:
            return False
        # The item belongs to a set in which it was missing, or to an earlier one.
        margin_ns = 0 if self._chosen[number] else self.tolerance_ns
        return stamp_ns <= self._last_ns + margin_ns

    def _is_complete(self) -> bool:
        counts = [len(items) for items in self._items]
        if not any(counts):
            return False
        is_full = max(counts) > _WAITING
        return not any(
            not count
            and self._missed[number] < _PATIENCE
            and not (is_full and self._is_silent(number))
            for number, count in enumerate(counts)
        )

    def _is_silent(self, number: int) -> bool:
        """Return whether another stream has sent several items since the last one of a stream."""
        numbers = zip(self._received, self._before[number], strict=True)
        return any(now - then > _WAITING for now, then in numbers)
