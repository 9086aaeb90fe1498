"""Progress bars of the commands."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tqdm import tqdm


@contextmanager
def progress_bar(text: str) -> Iterator[Callable[[float], None]]:
    """Yield a function that updates the bar to a finished fraction, 0 to 1."""
    with tqdm(total=100, desc=text, bar_format="{l_bar}{bar}| {elapsed}<{remaining}") as bar:

        def show(fraction: float) -> None:
            percent = min(100, max(0, round(100 * fraction)))
            if percent > bar.n:
                bar.update(percent - bar.n)

        yield show
