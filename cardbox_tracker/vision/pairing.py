"""Which images of several cameras belong together, by their stamps.

Those that are within a tolerance of the earliest one. :func:`side_by_side` reads recordings, in
which it is known what comes next; :class:`Arrivals` takes what live cameras send, of which any may
be late or cease.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Generic, TypeVar

from cardbox_tracker.errors import CardboxError

T = TypeVar("T")

MOST_CAMERAS = 4

TOLERANCE_NS = 16_000_000
"""Half a period of 30 Hz: what belongs together where the period is not known."""

# So many of another camera's images may wait for one: whatever its camera needs to send it.
_WAITING = 2
# After so many times in vain a camera is not waited for until it sends again.
_PATIENCE = 5
# Further back than the network reorders messages: the source has started again, or another clock.
_RESTART_NS = 1_000_000_000


def camera_names(cameras: Sequence[str]) -> list[str]:
    """Return the namespaces of cameras without slashes around them.

    Raises:
        CardboxError: there are too many, one twice, or one without a name.
    """
    names = [camera.strip("/") for camera in cameras]
    if len(names) > MOST_CAMERAS or len(set(names)) < len(names) or not all(names):
        raise CardboxError(
            f"the cameras are {', '.join(names)}; expected one to {MOST_CAMERAS} "
            "different namespaces"
        )
    return names


def side_by_side(
    streams: Sequence[Iterator[T]], stamp_ns: Callable[[T], int], tolerance_ns: int
) -> Iterator[tuple[T | None, ...]]:
    """Pair what several streams have at the same time; each item is used once, in order.

    An item that is more than ``tolerance_ns`` after the earliest one waits for the next turn.
    """
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
    """Return which of the next items, by their stamps, are taken together; None of a missing one.

    At least one is there.
    """
    first_ns = min(stamp_ns for stamp_ns in stamps_ns if stamp_ns is not None)
    return [stamp_ns is not None and stamp_ns - first_ns <= tolerance_ns for stamp_ns in stamps_ns]


class Arrivals(Generic[T]):
    """Pairs items as they arrive, as :func:`side_by_side` would, without waiting for ever.

    A set is complete once every stream has sent the item that belongs to it, or a later one. One
    that is silent is waited for until another has sent two items more, and after five such sets no
    longer, until it sends again. Items that come after their set has gone are left out; where the
    stamps of a stream go back by more than a second, everything starts anew.

    Attributes:
        tolerance_ns: items whose stamps are this near to the earliest one belong together.
        late: how many items of each stream came too late.
    """

    def __init__(self, count: int, tolerance_ns: int) -> None:
        """Start with nothing of ``count`` streams."""
        self.tolerance_ns = tolerance_ns
        self.late = [0] * count
        self._items: list[deque[tuple[int, T]]] = [deque() for _ in range(count)]
        self.restart()

    def restart(self) -> None:
        """Forget what has arrived: the stamps start anew."""
        for items in self._items:
            items.clear()
        self._missed = [0] * len(self._items)
        self._newest_ns = [0] * len(self._items)
        # Of the last set: the earliest stamp, and whose items were in it.
        self._last_ns: int | None = None
        self._chosen = [False] * len(self._items)

    def add(self, number: int, stamp_ns: int, item: T) -> None:
        """Take an item of stream ``number``; a stamp of 0 stands for none."""
        if stamp_ns and self._newest_ns[number] - stamp_ns > _RESTART_NS:
            self.restart()
        elif stamp_ns and self._is_late(number, stamp_ns):
            self.late[number] += 1
            if self._last_ns is not None and self._last_ns - stamp_ns < _RESTART_NS:
                self._missed[number] = 0
            return
        self._missed[number] = 0
        self._newest_ns[number] = stamp_ns
        items = self._items[number]
        items.append((stamp_ns, item))
        if len(items) > _WAITING + 1:
            # Of a clock that is ahead of the others: their time may never come.
            items.popleft()
            self.late[number] += 1

    def sets(self) -> Iterator[tuple[T | None, ...]]:
        """Yield each set that is complete now, an item or None of each stream."""
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
        # Of a set in which it was missing, or of one before.
        margin_ns = 0 if self._chosen[number] else self.tolerance_ns
        return stamp_ns <= self._last_ns + margin_ns

    def _is_complete(self) -> bool:
        counts = [len(items) for items in self._items]
        if not any(counts):
            return False
        is_waited_for = any(
            not count and missed < _PATIENCE
            for count, missed in zip(counts, self._missed, strict=True)
        )
        return not is_waited_for or max(counts) > _WAITING
