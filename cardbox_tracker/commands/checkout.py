"""Modules of ``lab/``, which only a checkout has."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from cardbox_tracker.common.errors import CardboxError

_PACKAGE = Path(__file__).parents[1]


def from_checkout(module: str, target: str) -> Any:
    """Import a module of a folder at the top of a checkout.

    The checkout is the current directory, one above it, or the parent of this package.

    Args:
        module: full name of the module, such as ``lab.benchmarks.run``.
        target: the ``make`` target that runs it.

    Raises:
        CardboxError: there is no checkout, or a library that the module needs is not installed.
    """
    folder = module.partition(".")[0]
    for root in (Path.cwd(), *Path.cwd().parents, _PACKAGE.parent):
        if (root / folder / "__init__.py").is_file() and (root / _PACKAGE.name).is_dir():
            # At the end of the path, it does not replace the package that is running.
            sys.path.append(str(root))
            break
    else:
        raise CardboxError(
            f"{folder}/ is not installed; run this in a checkout of {_PACKAGE.name}, or there "
            f"'make {target}'"
        )
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise CardboxError(
            f"{module} needs {error.name}, which is not installed; "
            "run 'pip install .' in the checkout"
        ) from None
