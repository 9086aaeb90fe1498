"""Several people in image after image, with the networks that find one.

Each known person is located in a square that follows from the last points. The landmark network
takes whatever person is the most conspicuous in its square, so pixels of the others are hidden from
it. New people are searched for a few times a second, in the whole image and in a part of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cardbox_tracker.detectors.figure import Figure
from cardbox_tracker.detectors.pose_network import (
    ColorImage,
    Detection,
    PoseNetwork,
    Square,
    figure_of,
)

Mask = NDArray[np.uint8]

# Time between two searches for new people, and for which somebody who is not found is sought in the
# last square, ns.
_SEARCH_NS, _SOUGHT_NS = 333_000_000, 1_000_000_000
# Side of a part of the image that is searched by itself, in sides of the image.
_PART = 0.6
_GREY = 128
# Distance of joints, in lengths of the trunk, below which two detections are of one person.
_SAME = 0.35


@dataclass(eq=False)
class _Followed:
    """A person who is followed; ``seen_ns`` is the stamp of the last image with them."""

    square: Square
    found: Detection
    figure: Figure
    seen_ns: int
    drawn: Mask

    @classmethod
    def of(cls, found: Detection, square: Square, stamp_ns: int) -> _Followed:
        figure = figure_of(found)
        return cls(square, found, figure, stamp_ns, figure.drawn(found.mask.shape))


class PeopleNetwork:
    """Finds several people in image after image."""

    def __init__(self, network: PoseNetwork, most: int) -> None:
        """Find up to ``most`` people with ``network``."""
        self._network, self._most = network, most
        self.forget()

    def forget(self) -> None:
        """Forget the last image."""
        self._known: list[_Followed] = []
        self._searched_ns: int | None = None
        self._part = 0

    def __call__(self, image: ColorImage, stamp_ns: int) -> list[Detection]:
        """Return the people in ``image`` (H, W, 3), bgr, of a time, ns."""
        image = np.ascontiguousarray(image[..., ::-1])
        self._known = [one for one in self._known if 0 <= stamp_ns - one.seen_ns <= _SOUGHT_NS]
        self._follow(image, stamp_ns)
        since_ns = None if self._searched_ns is None else stamp_ns - self._searched_ns
        here = sum(person.seen_ns == stamp_ns for person in self._known)
        if here < self._most and (since_ns is None or not 0 <= since_ns < _SEARCH_NS):
            self._searched_ns = stamp_ns
            self._search(image, stamp_ns)
        return [person.found for person in self._known if person.seen_ns == stamp_ns]

    def _follow(self, image: ColorImage, stamp_ns: int) -> None:
        """Locate the known people; one who is found where another one is was not found."""
        located = [
            self._network.located(image, person.square, self._others(person))
            for person in self._known
        ]
        seen = [None if there is None else _Followed.of(*there, stamp_ns) for there in located]
        moved = [
            np.inf if new is None else person.figure.apart(new.figure)
            for person, new in zip(self._known, seen, strict=True)
        ]
        for number in np.argsort(moved):
            new = seen[number]
            if new is not None and not self._is_seen(new):
                self._known[number] = new

    def _is_seen(self, new: _Followed) -> bool:
        """Return whether somebody who is seen in this image is the one that was found."""
        return any(
            one.seen_ns == new.seen_ns and one.figure.apart(new.figure) < _SAME
            for one in self._known
        )

    def _others(self, person: _Followed | None = None) -> Mask | None:
        """Return the pixels that belong to others than a person; None if nobody else is known."""
        others = [other.drawn for other in self._known if other is not person]
        if not others:
            return None
        hidden: Mask = np.bitwise_or.reduce(others)
        return hidden if person is None else hidden & ~person.drawn

    def _search(self, image: ColorImage, stamp_ns: int) -> None:
        """Add people who are not known."""
        for view in self._views(image.shape):
            seen, others = image, self._others()
            if others is not None:
                seen = image.copy()
                seen[others > 0] = _GREY
            for square in self._network.detected(seen, view):
                located = self._network.located(image, square, others)
                new = None if located is None else _Followed.of(*located, stamp_ns)
                if new is None or self._is_seen(new):
                    continue
                missing = [one for one in self._known if one.seen_ns != stamp_ns]
                if missing:
                    middle = new.figure.middle_px
                    far = [np.linalg.norm(middle - one.figure.middle_px) for one in missing]
                    self._known.remove(missing[int(np.argmin(far))])
                self._known.append(new)
                if sum(one.seen_ns == stamp_ns for one in self._known) >= self._most:
                    return
                break

    def _views(self, shape: tuple[int, ...]) -> Iterator[Square]:
        """Yield the whole image and the next part of it; in the first image, all parts."""
        height, width = shape[:2]
        side = max(height, width)
        yield Square(width / 2, height / 2, side, 0.0)
        part = _PART * side
        rows, columns = (
            np.linspace(part / 2, length - part / 2, 2 if length < 0.9 * side else 3)
            if length > part
            else [length / 2]
            for length in (height, width)
        )
        parts = [Square(float(u), float(v), part, 0.0) for v in rows for u in columns]
        if self._known:
            self._part = (self._part + 1) % len(parts)
            yield parts[self._part]
        else:
            yield from parts
