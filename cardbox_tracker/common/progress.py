"""Progress bars of the commands, and the seconds of a wait for a log."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress_bar(text: str) -> Iterator[Callable[[float], None]]:
    """Yield a function that updates the bar to a finished fraction, 0 to 1.

    The bar is drawn again every second. If errors do not go to a terminal, there is a line for each
    tenth instead, which fits a file.
    """
    if not sys.stderr.isatty():
        told_tenths = -1

        def tell(fraction: float) -> None:
            nonlocal told_tenths
            tenths = min(10, max(0, int(10 * fraction)))
            if tenths > told_tenths:
                told_tenths = tenths
                print(f"{text}: {10 * tenths}%", file=sys.stderr, flush=True)

        tell(0.0)
        yield tell
        return
    # Nodes need no bar, and tqdm imports much.
    from tqdm import tqdm

    with (
        tqdm(total=100, desc=text, bar_format="{l_bar}{bar}| {elapsed}<{remaining}") as bar,
        # The first run compiles for minutes before the first image; the seconds go on meanwhile.
        told(lambda _: bar.refresh(), text, 1.0),
    ):

        def show(fraction: float) -> None:
            percent = min(100, max(0, round(100 * fraction)))
            if percent > bar.n:
                bar.update(percent - bar.n)

        yield show


@contextmanager
def told(say: Callable[[str], object], text: str, every_s: float = 5.0) -> Iterator[None]:
    """Call ``say`` with ``text`` now, and by a thread every ``every_s`` with the seconds passed."""
    say(text)
    begun_s, done = time.monotonic(), threading.Event()

    def tell() -> None:
        while not done.wait(every_s):
            say(f"{text}: {time.monotonic() - begun_s:.0f} s so far")

    # A signal that ends the program must not wait for this thread.
    thread = threading.Thread(target=tell, name="told", daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()
