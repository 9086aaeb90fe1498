"""``cardbox benchmark`` and ``evaluate``, whose modules only a checkout has, in ``lab/``."""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from cardbox_tracker.common.errors import CardboxError

_PACKAGE = Path(__file__).parents[1]


@dataclass
class LabCommand:
    """A subcommand whose arguments and work are in a module of ``lab/``."""

    NAME: str
    HELP: str
    module: str  #: full name of the module
    targets: str  #: quoted commands of ``make`` that do the same

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the arguments."""
        from_checkout(self.module, self.targets).add_arguments(parser)

    def run(self, options: argparse.Namespace) -> None:
        """Do the work."""
        from_checkout(self.module, self.targets).run(options)


BENCHMARK = LabCommand(
    "benchmark",
    "measure how fast the tracker is on this machine (in a checkout)",
    "lab.benchmarks.command",
    "'make benchmark'",
)
EVALUATE = LabCommand(
    "evaluate",
    "in a checkout: compare recorded sessions with their truth, or repeat the paper's experiments",
    "lab.evaluation.command",
    "'make experiments', 'make sessions' or 'make people'",
)


def from_checkout(module: str, targets: str) -> Any:
    """Import from a checkout: the current directory, one above it, or this package's parent."""
    folder = module.partition(".")[0]
    for root in (Path.cwd(), *Path.cwd().parents, _PACKAGE.parent):
        if (root / folder / "__init__.py").is_file() and (root / _PACKAGE.name).is_dir():
            # At the end of the path, it does not replace the package that is running.
            sys.path.append(str(root))
            break
    else:
        raise CardboxError(
            f"{folder}/ is not installed; run this in a checkout of {_PACKAGE.name}, or there "
            f"{targets}"
        )
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise CardboxError(
            f"{module} needs {error.name}, which is not installed; "
            "run 'pip install .' in the checkout"
        ) from None
