"""Parts of the pages that the tools write: tables, sections between marks, plots."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import atomic_path


def row(cells: Iterable[object]) -> str:
    """Return a row of a table."""
    return f"| {' | '.join(map(str, cells))} |"


def table(header: Sequence[object], rows: Iterable[Iterable[object]]) -> str:
    """Return a table in Markdown."""
    return "\n".join([row(header), "|---" * len(header) + "|", *map(row, rows)])


def number(value: float, form: str = "{:.1f}") -> str:
    """Return the text of a number; empty if it is not finite."""
    return form.format(value) if np.isfinite(value) else ""


def replaced(text: str, section: str, begin: str, end: str) -> str:
    """Return the document ``text`` with another ``section`` between its marks.

    Raises:
        CardboxError: the marks are not there, each once.
    """
    if text.count(begin) != 1 or text.count(end) != 1:
        raise CardboxError(f"the document needs the marks {begin} and {end}, each once")
    before, rest = text.split(begin)
    return f"{before}{begin}\n{section}\n{end}{rest.split(end)[1]}"


@contextmanager
def plot(
    path: Path, shape: tuple[int, int], size: tuple[float, float], dpi: int = 80, **options: Any
) -> Iterator[Any]:
    """Yield axes of ``shape`` (rows, columns) on a figure of ``size``, inches; save it as PNG."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    options = {"layout": "constrained"} | options
    figure, axes = pyplot.subplots(*shape, figsize=size, squeeze=False, **options)
    try:
        yield axes
        with atomic_path(path) as temporary:
            extra: Any = {"bbox_inches": "tight"} if options["layout"] is None else {}
            figure.savefig(temporary, dpi=dpi, format="png", metadata={"Software": None}, **extra)
    finally:
        pyplot.close(figure)
