"""Runs the commands of this folder, whose errors are texts and no tracebacks."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from cardbox_tracker.errors import CardboxError


def run(main: Callable[[], int]) -> int:
    """Return the exit status of a command; 1 after an error, whose text is printed."""
    try:
        return main()
    except CardboxError as error:
        print(error, file=sys.stderr)
        return 1


def training_arguments(description: str | None) -> argparse.ArgumentParser:
    """Return the arguments of a command that trains networks with folders of samples."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("samples", nargs="+", type=Path)
    parser.add_argument("--check", nargs="*", type=Path, default=[])
    parser.add_argument("--leave-out", metavar="SOURCE")
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=0)
    return parser
