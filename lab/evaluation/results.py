"""JSON files of results with the versions, commit and processor of the measurement."""

from __future__ import annotations

import json
import platform
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
import numba
import numpy as np

import cardbox_tracker
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import UnreadableFileError, read_regular, write_file

_DIGITS = 6


def provenance() -> dict[str, Any]:
    """Return versions, commit and processor."""
    return {
        "versions": {
            "cardbox_tracker": cardbox_tracker.__version__,
            "python": platform.python_version(),
            "numpy": np.__version__,
            "opencv": cv2.__version__,
            "numba": numba.__version__,
        },
        "commit": commit(),
        "cpu": processor(),
    }


def commit() -> str | None:
    """Return the commit of the package's source, with ``+changes`` if it was edited since.

    None where the package does not lie in a git checkout.
    """
    root = Path(cardbox_tracker.__file__).parent

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(root), *arguments]
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=30)
        return done.stdout.strip()

    try:
        changed = git("status", "--porcelain", "--", ".")
        return git("rev-parse", "HEAD") + ("+changes" if changed else "")
    except (OSError, subprocess.SubprocessError):
        return None


def processor() -> str:
    """Return the processor's name, or its architecture if the system does not give a name."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def write_json(data: Mapping[str, Any], path: Path) -> None:
    """Write ``data`` with floats rounded to ``_DIGITS`` places."""
    write_file(path, json.dumps(_rounded(data), indent=1) + "\n")


def read_json(path: Path) -> dict[str, Any]:
    """Read a file of results.

    Raises:
        CardboxError: the file cannot be read or does not have results.
    """
    try:
        data = json.loads(read_regular(path))
    except UnreadableFileError as error:
        raise CardboxError(f"cannot read {path}: {error}") from None
    except (ValueError, RecursionError) as error:
        raise CardboxError(f"{path} is not JSON: {error}") from None
    if not isinstance(data, dict):
        raise CardboxError(f"{path} has no results; expected a file of 'cardbox evaluate'")
    return data


def _rounded(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _rounded(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(entry) for entry in value]
    return round(value, _DIGITS) if isinstance(value, float) else value
