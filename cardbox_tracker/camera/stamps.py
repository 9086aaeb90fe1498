"""Detects the order and the losses of a stream of images by their stamps.

A camera without stamps, or with a clock that jumps, must neither stop the nodes nor restart the
tracking with every image.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable
from enum import Enum
from itertools import islice
from statistics import median_low

from cardbox_tracker.common.health import WATCHES

WINDOW = 120
_PAUSE_NS = 2_000_000_000
# The network does not reorder messages over this time, so the source was restarted.
_RESTART_NS = 1_000_000_000
# After this many consecutive images of one clock the other clock is forgotten.
_PATIENCE = 5
# The period is known from this number of spacings on.
_ENOUGH = 5
# The period is the median of a low spacing of each group, so that one burst does not decide it.
_GROUP = 10
# Stamps of a recording that is shorter than _RESTART_NS.
_REMEMBERED = 256


class StampOrder(Enum):
    """Relation of the stamp of an image to the one before."""

    NEXT = "later than the one before, or the first"
    GAP = "more than two seconds later"
    RESTART = "more than a second older: the source has started again"
    LATE = "older, by a second at most: it was overtaken on the way"
    REPEATED = "the stamp of the one before"
    FOREIGN = "of another clock, which another publisher has"
    UNSTAMPED = "without a stamp: the order of arrival counts"

    @property
    def is_usable(self) -> bool:
        """Whether the image can be processed as the next one."""
        return self not in (StampOrder.LATE, StampOrder.REPEATED, StampOrder.FOREIGN)


_FAULTS = {
    StampOrder.UNSTAMPED: WATCHES["stamps that are zero"],
    StampOrder.REPEATED: WATCHES["stamps that repeat"],
    StampOrder.FOREIGN: WATCHES["stamps of two clocks"],
    StampOrder.LATE: WATCHES["stamps that are late"],
    StampOrder.RESTART: WATCHES["stamps that go back"],
}


class StampSequence:
    """Classifies each stamp by the earlier ones.

    A jump is accepted at once. If the next image continues the time before the jump, that time is
    used again and images of the other time are foreign. They come from a second publisher with
    another clock, or have a wrong stamp.
    """

    def __init__(self) -> None:
        self._last_ns: int | None = None
        # Last stamp before the jump.
        self._left_ns: int | None = None
        self._has_jumped = False
        self._foreign = 0
        self._seen: deque[int] = deque(maxlen=_REMEMBERED)
        self._again_ns: int | None = None

    def add(self, stamp_ns: int) -> StampOrder:
        """Classify the next stamp, ns; 0 means that the image has none."""
        if stamp_ns == 0:
            return StampOrder.UNSTAMPED
        last_ns = self._last_ns
        if last_ns is None:
            self._last_ns = stamp_ns
            self._seen.append(stamp_ns)
            return StampOrder.NEXT
        spacing_ns = stamp_ns - last_ns
        if -_RESTART_NS <= spacing_ns < _PAUSE_NS:
            self._foreign, self._has_jumped = 0, False
            if spacing_ns <= 0 and not self._starts_over(stamp_ns):
                return StampOrder.LATE if spacing_ns else StampOrder.REPEATED
            self._last_ns, self._again_ns = stamp_ns, None
            self._seen.append(stamp_ns)
            return StampOrder.NEXT if spacing_ns > 0 else StampOrder.RESTART
        if self._has_jumped and self._left_ns is not None:
            if 0 < stamp_ns - self._left_ns < _PAUSE_NS:
                self._has_jumped, self._left_ns, self._last_ns = False, last_ns, stamp_ns
                return StampOrder.NEXT
        elif self._is_foreign(stamp_ns):
            return StampOrder.FOREIGN
        self._has_jumped, self._left_ns, self._last_ns = True, last_ns, stamp_ns
        return StampOrder.GAP if spacing_ns > 0 else StampOrder.RESTART

    def _starts_over(self, stamp_ns: int) -> bool:
        """Return whether a short recording plays again: its images come again, in their order."""
        again_ns, self._again_ns = self._again_ns, stamp_ns if stamp_ns in self._seen else None
        if again_ns is None or self._again_ns is None or stamp_ns <= again_ns:
            return False
        self._seen.clear()
        self._seen.append(again_ns)
        return True

    def _is_foreign(self, stamp_ns: int) -> bool:
        """Return whether a stamp continues the stamps before the jump."""
        left_ns = self._left_ns
        if left_ns is None or not -_RESTART_NS <= stamp_ns - left_ns < _PAUSE_NS:
            return False
        self._foreign += 1
        if self._foreign > _PATIENCE:
            # The jump was an error of one image, or the other publisher has stopped.
            self._foreign, self._left_ns = 0, None
            return False
        self._left_ns = stamp_ns
        return True


class StreamStatistics:
    """Counts the messages of a stream and estimates the lost ones by the stamps."""

    def __init__(self, remembered: int | None = WINDOW) -> None:
        """Start without messages; remarks are on the latest ``remembered``, None for all."""
        self.received = 0
        self._dropped_before = 0
        self.counts: dict[StampOrder, int] = dict.fromkeys(StampOrder, 0)
        self._sequence = StampSequence()
        self._last_ns: int | None = None
        self._spacings_ns: deque[int] = deque()
        self._latest: deque[StampOrder] = deque(maxlen=remembered)

    def add(self, stamp_ns: int) -> StampOrder:
        """Count a message with this stamp, ns, and return its relation to the one before."""
        self.received += 1
        order = self._sequence.add(stamp_ns)
        self.counts[order] += 1
        self._latest.append(order)
        if not order.is_usable or order is StampOrder.UNSTAMPED:
            return order
        last_ns, self._last_ns = self._last_ns, stamp_ns
        if order is StampOrder.RESTART:
            self._dropped_before = self.dropped
            self._spacings_ns.clear()
        elif order is StampOrder.NEXT and last_ns is not None:
            if len(self._spacings_ns) == WINDOW:
                self._dropped_before += self._lost_in([self._spacings_ns.popleft()])
            self._spacings_ns.append(stamp_ns - last_ns)
        return order

    @property
    def dropped(self) -> int:
        """Number of lost messages, of the latest ones by the period as it is known now."""
        if len(self._spacings_ns) < _ENOUGH:
            return self._dropped_before
        return self._dropped_before + self._lost_in(self._spacings_ns)

    def _lost_in(self, spacings_ns: Iterable[int]) -> int:
        period_ns = self.period_ns
        return sum(max(round(spacing_ns / period_ns) - 1, 0) for spacing_ns in spacings_ns)

    @property
    def out_of_order(self) -> int:
        """Number of messages that were not later than the one before."""
        return sum(
            self.counts[s]
            for s in (StampOrder.RESTART, StampOrder.LATE, StampOrder.REPEATED, StampOrder.FOREIGN)
        )

    @property
    def period_ns(self) -> int:
        """Spacing of the stamps without losses, ns: a low one, as most images may be lost."""
        known = [*self._spacings_ns]
        groups = [sorted(known[at : at + _GROUP]) for at in range(0, len(known), _GROUP)]
        return median_low(group[:2][-1] for group in groups) if groups else 0

    @property
    def loss(self) -> float:
        """Fraction of the latest messages that were lost, estimated by the stamps."""
        if len(self._spacings_ns) < _ENOUGH:
            return 0.0
        expected = max(round(sum(self._spacings_ns) / self.period_ns), 1)
        return max(1.0 - len(self._spacings_ns) / expected, 0.0)

    def remarks(self) -> dict[str, str]:
        """Return texts on faults of the latest stamps by kind; a single late image is no fault."""
        latest, of = Counter(self._latest), len(self._latest)
        # All images of a recording count, and of a stream only what happens often.
        is_recording = self._latest.maxlen is None
        return {
            watch.name: watch.words.format(value=latest[order], of=of)
            for order, watch in _FAULTS.items()
            if watch.is_beyond(latest[order]) or (is_recording and latest[order])
        }


# A burst begins with an image that is so much later, after its stamp, than those before it.
_HELD_BACK_S = 0.3
# Stamps of one burst lie within this share of the time to the next, if they are of the arrival.
_MOMENT = 0.05
# Time for which a burst counts.
_BURSTS_WITHIN_S = 10.0


class ArrivalWatch:
    """Tells images that arrive in bursts, and stamps in the future, of a live stream."""

    def __init__(self) -> None:
        self._bursts_s: deque[float] = deque(maxlen=round(WATCHES["bursts"].limit) + 1)
        # Least and largest delay since the last burst has begun.
        self._delays_s = float("inf"), -float("inf")
        # Stamps since the last gap: the first one, the last one.
        self._group_ns = 0, 0
        self._ahead_s = self._now_s = 0.0

    def add(self, stamp_ns: int, order: StampOrder, arrived_s: float, clock_ns: int) -> None:
        """Take a message that arrives at a steady time, s, and at one of the clock, ns or 0."""
        if not order.is_usable:
            return
        is_stamped = order is not StampOrder.UNSTAMPED
        self._now_s = arrived_s
        self._ahead_s = (stamp_ns - clock_ns) / 1e9 if clock_ns and is_stamped else 0.0
        delay_s = arrived_s - stamp_ns / 1e9
        least_s, most_s = self._delays_s
        if order is StampOrder.RESTART or not is_stamped:
            least_s = most_s = delay_s
        elif delay_s - least_s > _HELD_BACK_S:
            # A recording that is played slowly is ever later, and never catches up.
            if most_s - least_s > _HELD_BACK_S:
                self._bursts_s.append(arrived_s)
            least_s = most_s = delay_s
        self._delays_s = min(least_s, delay_s), max(most_s, delay_s)
        first_ns, last_ns = self._group_ns
        gap_ns = stamp_ns - last_ns
        if 0 <= gap_ns < _HELD_BACK_S * 1e9:
            self._group_ns = first_ns, stamp_ns
            return
        if 0 < last_ns - first_ns < _MOMENT * gap_ns:
            self._bursts_s.append(arrived_s)
        self._group_ns = stamp_ns, stamp_ns

    @property
    def has_burst(self) -> bool:
        """Whether some of the latest messages were held back, so that no other fault is sure."""
        return bool(self._recent_s)

    @property
    def _recent_s(self) -> list[float]:
        return [at_s for at_s in self._bursts_s if at_s > self._now_s - _BURSTS_WITHIN_S]

    def remarks(self) -> dict[str, str]:
        """Return texts on the latest messages by kind."""
        recent_s = self._recent_s
        period_s = (recent_s[-1] - recent_s[0]) / max(len(recent_s) - 1, 1) if recent_s else 0.0
        found = {
            "bursts": WATCHES["bursts"].remark(len(recent_s), period_s=period_s),
            "stamps ahead": WATCHES["stamps ahead"].remark(self._ahead_s),
        }
        return {kind: text for kind, text in found.items() if text}


class RecordedStamps:
    """Times of a recorded stream, which always increase.

    Images are left out as in a live stream. Where stamps are missing, go back, or jump forward by
    more than 10 s while the recorder waits for less than 2 s, the recorder's clock goes on.

    Attributes:
        statistics: order and losses by the stamps.
    """

    def __init__(self) -> None:
        self.statistics = StreamStatistics(remembered=None)
        self._last: tuple[int, int] | None = None
        self._ahead_ns = 0
        self._jump_s = 0.0

    def add(self, stamp_ns: int, recorded_ns: int) -> int | None:
        """Return the time of the next message, ns, by its stamp (0: none); None to leave it out."""
        order = self.statistics.add(stamp_ns)
        if not order.is_usable:
            return None
        is_unstamped = order is StampOrder.UNSTAMPED
        time_ns = recorded_ns if is_unstamped else stamp_ns + self._ahead_ns
        is_back = is_unstamped or order is StampOrder.RESTART
        before_ns, recorded_before_ns = self._last or (time_ns, recorded_ns)
        ahead_ns, waited_ns = time_ns - before_ns, recorded_ns - recorded_before_ns
        jump_s = 0.0 if is_unstamped or waited_ns >= _PAUSE_NS else (ahead_ns - waited_ns) / 1e9
        is_set = WATCHES["clock set"].is_beyond(jump_s)
        self._jump_s = max(self._jump_s, jump_s)
        if self._last is not None and (is_back or is_set or time_ns <= before_ns):
            time_ns = before_ns + max(waited_ns, 1)
            if not is_unstamped:
                self._ahead_ns = time_ns - stamp_ns
        self._last = time_ns, recorded_ns
        return time_ns

    def remarks(self) -> list[str]:
        """Return texts on all faults, as :meth:`StreamStatistics.remarks`."""
        names = "clock set", "stamps ahead of the recorder"
        jumps = filter(None, (WATCHES[name].remark(self._jump_s) for name in names))
        return [*self.statistics.remarks().values(), *islice(jumps, 1)]
