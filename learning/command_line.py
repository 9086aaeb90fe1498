"""Runs the commands of this folder, whose errors are texts and no tracebacks."""

from __future__ import annotations

import sys
from collections.abc import Callable

from cardbox_tracker.errors import CardboxError


def run(main: Callable[[], int]) -> int:
    """Return the exit status of a command; 1 after an error, whose text is printed."""
    try:
        return main()
    except CardboxError as error:
        print(error, file=sys.stderr)
        return 1
