"""Interface of a subcommand of ``cardbox``."""

from __future__ import annotations

import argparse
from typing import Protocol


class Command(Protocol):
    """A subcommand; each is a module of this folder with these four names.

    Slow imports are inside ``add_arguments`` and ``run``, so that ``cardbox --help`` is fast.

    Attributes:
        NAME: name that is typed after ``cardbox``.
        HELP: one line for ``cardbox --help``, without a capital letter or a full stop.
    """

    NAME: str
    HELP: str

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the arguments of the subcommand to its ``parser``."""

    def run(self, options: argparse.Namespace) -> None:
        """Do the work and print the result.

        Raises:
            CardboxError: the user can correct the cause; ``cardbox`` prints the text and returns 1.
        """
