"""``cardbox benchmark`` and ``evaluate``, whose modules only a checkout has, in ``lab/``."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from cardbox_tracker.common.errors import CardboxError

_PACKAGE = Path(__file__).parents[1]


LAB = {
    "benchmark": ("lab.benchmarks.command", "'make benchmark'"),
    "evaluate": (
        "lab.evaluation.command",
        "'make experiments', 'make sessions' or 'make people'",
    ),
}
"""Module of each of these subcommands, and the commands of ``make`` that do the same."""


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
