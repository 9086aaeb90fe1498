"""What a subcommand of ``cardbox`` consists of."""

from __future__ import annotations

import argparse
from typing import Protocol


class Command(Protocol):
    """A subcommand; each is a module of this folder with these four names.

    A module imports what is slow to load inside ``add_arguments`` and ``run``, so that
    ``cardbox --help`` stays fast.

    Attributes:
        NAME: as it is typed after ``cardbox``.
        HELP: one line for ``cardbox --help``, without a capital letter or a full stop.
    """

    NAME: str
    HELP: str

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the subcommand's arguments to its own ``parser``."""

    def run(self, options: argparse.Namespace) -> None:
        """Do the work and print the result.

        Raises:
            CardboxError: the user can put it right; ``cardbox`` prints the text and returns 1.
        """
