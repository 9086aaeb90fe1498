"""Watches over inputs and results: what is measured, its limits, and the words of the remark.

A :class:`Watch` is a row of ``watches.csv``. A :class:`Verdict` judges its measure, the median of
the latest samples. What holds beyond ``limit`` goes on until ``clear``, so that a measure about the
limit does not switch to and fro.
"""

from __future__ import annotations

import csv
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from types import MappingProxyType
from typing import NamedTuple


class Watch(NamedTuple):
    """One fault: its measure and limits, a row of ``watches.csv``."""

    name: str
    measure: str  #: what is measured, with its unit
    is_low: bool  #: whether values below the limit are the fault, and not those above
    limit: float  #: value beyond which the watch holds
    clear: float  #: value to which it has to return
    least: int  #: fewest samples for a verdict
    window: int | None  #: samples of which the median counts; None for all
    words: str  #: remark, with ``{value}``, ``{limit}`` and what :meth:`Verdict.remark` gets
    why: str  #: where the limit comes from

    def is_beyond(self, value: float, holds: bool = False) -> bool:
        """Return whether a value is a fault; ``holds`` says that the one before was."""
        limit = self.clear if holds else self.limit
        return bool(value < limit if self.is_low else value > limit)

    def remark(self, value: float, **values: object) -> str:
        """Return the words on a value that is a fault, with further values; else nothing."""
        given = {"value": value, "limit": self.limit} | values
        return self.words.format(**given) if self.is_beyond(value) else ""


def _rows() -> Iterator[Watch]:
    with Path(__file__).with_name("watches.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            limits, least = (float(row["limit"]), float(row["clear"])), int(row["least"])
            window = int(row["window"]) if row["window"] else None
            given = row["measure"], row["beyond"] == "below", *limits, least, window
            yield Watch(row["name"], *given, row["words"], row["why"])


WATCHES = MappingProxyType({watch.name: watch for watch in _rows()})
"""The rows of ``watches.csv`` by their names."""


class Verdict:
    """What a watch says of the samples so far.

    Attributes:
        holds: whether the fault is there.
        is_suspected: whether it seems to be, by fewer samples than a verdict needs.
        value: the measure that was judged last; 0 before.
        medians: median of each part of the samples; empty before there are enough.
        samples: the latest ones.
    """

    def __init__(self, name: str, of: Callable[..., float] = float) -> None:
        """Begin without samples for the watch of a name.

        ``of`` returns the measure of the medians of the parts of the samples.
        """
        self.watch, self._of = WATCHES[name], of
        self.holds, self.is_suspected = False, False
        self.value, self.medians = 0.0, list[float]()
        self.samples = deque[tuple[float, ...]](maxlen=self.watch.window)

    def see(self, *sample: float) -> bool:
        """Take a sample, of one part or several; return whether the fault is there."""
        self.samples.append(sample)
        medians = [median(part) for part in zip(*self.samples, strict=True)]
        value, is_enough = self._of(*medians), len(self.samples) >= self.watch.least
        self.is_suspected = not is_enough and self.watch.is_beyond(value)
        if is_enough:
            self.medians, self.value = medians, value
            self.holds = self.watch.is_beyond(value, self.holds)
        return self.holds

    def count(self, is_so: bool) -> bool:
        """Take whether something is so again: the measure is how often it was in a row."""
        return self.see(self.value + 1 if is_so else 0)

    def remark(self, **values: object) -> str:
        """Return the remark with these values; empty if nothing is wrong."""
        given = {"value": self.value, "limit": self.watch.limit} | values
        return self.watch.words.format(**given) if self.holds else ""
