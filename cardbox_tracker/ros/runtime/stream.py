"""What the stamps of a stream of images say: what is next, what was lost, what is out of order.

Time is the image's stamp. A camera that sets none, or one whose clock jumps, must neither stop the
nodes nor make tracking start again with every image.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections import deque
from enum import Enum

WINDOW = 120
_PAUSE_NS = 2_000_000_000
# Further back than the network reorders messages: the source has started again.
_RESTART_NS = 1_000_000_000
# So many images of one clock in a row, and the other clock is forgotten.
_PATIENCE = 5


class Step(Enum):
    """How an image follows the one before."""

    NEXT = "later than the one before, or the first"
    GAP = "more than two seconds later"
    RESTART = "more than a second older: the source has started again"
    LATE = "older, by a second at most: it was overtaken on the way"
    REPEATED = "the stamp of the one before"
    FOREIGN = "of another clock, which another publisher has"
    UNSTAMPED = "without a stamp: the order of arrival counts"

    @property
    def is_usable(self) -> bool:
        """False for an image that must not be taken for a later one."""
        return self not in (Step.LATE, Step.REPEATED, Step.FOREIGN)


class StampOrder:
    """Says of each stamp how it follows those before.

    A jump is followed at once. If the next image is of the time before the jump, that goes on, and
    images of the other time are foreign: two publishers with different clocks, or one wrong stamp.
    """

    def __init__(self) -> None:
        """Start before the first image."""
        self._last_ns: int | None = None
        # Where the stamps were before they jumped.
        self._left_ns: int | None = None
        self._has_jumped = False
        self._foreign = 0

    def see(self, stamp_ns: int) -> Step:
        """Take the next stamp; 0 stands for none."""
        if stamp_ns == 0:
            return Step.UNSTAMPED
        last_ns = self._last_ns
        if last_ns is None:
            self._last_ns = stamp_ns
            return Step.NEXT
        spacing_ns = stamp_ns - last_ns
        if -_RESTART_NS <= spacing_ns < _PAUSE_NS:
            self._foreign, self._has_jumped = 0, False
            if spacing_ns <= 0:
                return Step.LATE if spacing_ns else Step.REPEATED
            self._last_ns = stamp_ns
            return Step.NEXT
        if self._has_jumped and self._left_ns is not None:
            if 0 < stamp_ns - self._left_ns < _PAUSE_NS:
                self._has_jumped, self._left_ns, self._last_ns = False, last_ns, stamp_ns
                return Step.NEXT
        elif self._is_foreign(stamp_ns):
            return Step.FOREIGN
        self._has_jumped, self._left_ns, self._last_ns = True, last_ns, stamp_ns
        return Step.GAP if spacing_ns > 0 else Step.RESTART

    def _is_foreign(self, stamp_ns: int) -> bool:
        """Whether a stamp goes on where those before the jump have ended."""
        left_ns = self._left_ns
        if left_ns is None or not -_RESTART_NS <= stamp_ns - left_ns < _PAUSE_NS:
            return False
        self._foreign += 1
        if self._foreign > _PATIENCE:
            # The jump was an error of one image, or the other publisher has ended.
            self._foreign, self._left_ns = 0, None
            return False
        self._left_ns = stamp_ns
        return True


class StreamStatistics:
    """Counts the messages of one stream, and by their stamps those that never arrived."""

    def __init__(self) -> None:
        """Start with nothing received."""
        self.received = 0
        self.dropped = 0
        self.counts: dict[Step, int] = dict.fromkeys(Step, 0)
        self._order = StampOrder()
        self._last_ns: int | None = None
        self._spacings_ns: deque[int] = deque()
        # The same, sorted: the period is needed with every image.
        self._ordered_ns: list[int] = []
        self._latest: deque[Step] = deque(maxlen=WINDOW)

    def add(self, stamp_ns: int) -> Step:
        """Count a message of that stamp and return how it follows those before."""
        self.received += 1
        step = self._order.see(stamp_ns)
        self.counts[step] += 1
        self._latest.append(step)
        if not step.is_usable or step is Step.UNSTAMPED:
            return step
        last_ns, self._last_ns = self._last_ns, stamp_ns
        if step is Step.RESTART:
            self._spacings_ns.clear()
            self._ordered_ns.clear()
        elif step is Step.NEXT and last_ns is not None:
            self._note(spacing_ns := stamp_ns - last_ns)
            if len(self._spacings_ns) >= 5:
                self.dropped += max(round(spacing_ns / self.period_ns) - 1, 0)
        return step

    def _note(self, spacing_ns: int) -> None:
        if len(self._spacings_ns) == WINDOW:
            del self._ordered_ns[bisect_left(self._ordered_ns, self._spacings_ns.popleft())]
        self._spacings_ns.append(spacing_ns)
        insort(self._ordered_ns, spacing_ns)

    @property
    def out_of_order(self) -> int:
        """How many were not later than the one before."""
        return sum(self.counts[s] for s in (Step.RESTART, Step.LATE, Step.REPEATED, Step.FOREIGN))

    @property
    def period_ns(self) -> int:
        """Spacing of the stamps without losses, ns.

        A low percentile: where most images are lost, the median is a multiple of the period.
        """
        return self._ordered_ns[len(self._ordered_ns) // 10] if self._ordered_ns else 0

    @property
    def loss(self) -> float:
        """Fraction of the latest messages that never arrived, judged by their stamps."""
        if len(self._spacings_ns) < 5:
            return 0.0
        expected = max(round(sum(self._spacings_ns) / self.period_ns), 1)
        return max(1.0 - len(self._spacings_ns) / expected, 0.0)

    def remarks(self) -> dict[str, str]:
        """Return what is wrong with the stamps of the latest images, by kind; nothing if they fit.

        One image that came late is not worth a word.
        """
        texts = {}
        latest = {step: self._latest.count(step) for step in Step}
        few = len(self._latest) // 10 + 1
        if latest[Step.UNSTAMPED]:
            texts["stamps that are zero"] = (
                "the images have no stamp (it is zero), so they are used in the order of arrival "
                "and losses are not seen; set header.stamp in the camera's driver"
            )
        if latest[Step.REPEATED] > few:
            texts["stamps that repeat"] = (
                f"{latest[Step.REPEATED]} of the latest {len(self._latest)} images repeat the "
                "stamp of the one before and are left out; does the driver send them twice, or are "
                "there two publishers?"
            )
        if latest[Step.FOREIGN]:
            texts["stamps of two clocks"] = (
                "the stamps jump to and fro between two times, and images of one of them are left "
                "out; expected one camera with one clock: see 'ros2 topic info --verbose'"
            )
        if latest[Step.RESTART] > 2:
            texts["stamps that go back"] = (
                f"the stamps of the latest {len(self._latest)} images went back "
                f"{latest[Step.RESTART]} times by more than a second, and tracking started again "
                "each time; is the clock of the camera's computer being set?"
            )
        return texts
