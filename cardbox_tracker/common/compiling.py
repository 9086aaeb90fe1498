"""numba's ``njit`` with the options of this package, and the folder that keeps compiled code.

Compiled code contains its callees and the constants of other files, but numba compares only the
file of the function itself. So the name of the folder has a digest of all sources that compiled
code may contain, and a changed source begins an empty folder. Folders of older sources go.
(Modules outside of the package that use these decorators have numba's own rule.)

Who can write to the folder can execute code in each program that loads it, so it belongs to the
user and nobody else may write to it. Calls fail with :data:`DAMAGED` if a file in it was cut off,
as by a power failure, until :func:`discard` empties it.
"""

from __future__ import annotations

import hashlib
import logging
import os
import re
import shutil
import stat
import tempfile
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from pickle import UnpicklingError
from types import SimpleNamespace
from typing import Any, TypeVar

import numba
import numpy as np
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

import cardbox_tracker

DAMAGED = (EOFError, UnpicklingError)
"""Errors of a call whose compiled code cannot be read."""

F = TypeVar("F", bound=Callable[..., Any])

Index = int | np.integer[Any]
index = np.uint64
"""Makes an index of a kernel unsigned: for those, numba compiles no code for negative ones."""

_LOG = logging.getLogger(__name__)
_CONFIG: Any = numba.config
_CONFIG.reload_config()  # others may have imported numba before this package
_LOCK = threading.Lock()
_IMPORT = re.compile(rb"^from cardbox_tracker\.?(\S*) import (\([^)]*\)|.*)", re.MULTILINE)
# Another branch, or a version with bounds checks, is then not compiled anew at each change.
_KEPT = 4


def sources_of_kernels(package: str) -> dict[str, bytes]:
    """Return path and content of each file that compiled code of the package may contain.

    These are the files that import this module, and all files of the package that they import.
    """
    texts: dict[str, bytes] = {}
    for folder, _, names in os.walk(package):
        for path in (os.path.join(folder, name) for name in names if name.endswith(".py")):
            with open(path, "rb", buffering=0) as file:
                texts[path] = file.read()
    waiting = [path for path, text in texts.items() if b"compiling import" in text]
    found = set(waiting)
    while waiting:
        for module, names in _IMPORT.findall(texts[waiting.pop()]):
            place = os.path.join(package, *module.decode().split("."))
            below = [os.path.join(place, name.decode()) for name in re.findall(rb"\w+", names)]
            for stem in (place, os.path.join(place, "__init__"), *below):
                path = f"{stem}.py"
                if path in texts and path not in found:
                    found.add(path)
                    waiting.append(path)
    return {path: texts[path] for path in sorted(found)}


def choose_folder(package: str) -> Path | None:
    """Return the folder for compiled code of the package as it is now; None with a warning.

    It lies in ``NUMBA_CACHE_DIR`` if that is set, beside the sources, in the user's folder for
    caches, or in the folder for temporary files: in the first of them that can be written to.
    """
    digest = hashlib.sha256(repr(_CONFIG.BOUNDSCHECK).encode())
    for path, text in sources_of_kernels(package).items():
        digest.update(os.path.relpath(path, package).encode() + b"\0" + text + b"\0")
    prefix = f"cardbox_tracker-{os.geteuid()}-"
    for place in _places(package):
        folder = place / f"{prefix}{digest.hexdigest()[:16]}"
        if _is_own(folder):
            with suppress(OSError):
                os.utime(folder)
                folders = sorted(place.glob(f"{prefix}*"), key=lambda path: path.stat().st_mtime)
                for old in folders[:-_KEPT]:
                    shutil.rmtree(old, ignore_errors=True)
            return folder
    _LOG.warning(
        "compiled code cannot be kept, so that each start compiles for one to two minutes; set "
        "NUMBA_CACHE_DIR to a folder that only you can write to"
    )
    return None


def _places(package: str) -> Iterator[Path]:
    if _CONFIG.CACHE_DIR:
        yield Path(_CONFIG.CACHE_DIR).absolute()
    yield Path(package, "__pycache__")
    with suppress(RuntimeError):  # there is no home folder
        yield Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser()
    with suppress(OSError):
        yield Path(tempfile.gettempdir())


def _is_own(folder: Path) -> bool:
    """Return whether the folder, made if it is missing, can be written to by this user alone."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return False
    is_ours = stat.S_ISDIR(found.st_mode) and found.st_uid == os.geteuid()
    return is_ours and not found.st_mode & 0o022 and os.access(folder, os.W_OK | os.X_OK)


FOLDER = choose_folder(os.path.dirname(os.path.abspath(cardbox_tracker.__file__)))
"""Folder of the compiled code; None if there is none."""


def is_damage(error: BaseException) -> bool:
    """Return whether numba raised one of :data:`DAMAGED` while it read compiled code."""
    frames = traceback.walk_tb(error.__traceback__)
    return any(frame.f_globals.get("__name__") == "numba.core.caching" for frame, _ in frames)


def discard() -> None:
    """Remove the compiled code after one of :data:`DAMAGED`; it is compiled again when needed."""
    if FOLDER is not None:
        _LOG.warning("compiled code in %s was damaged; it is made again", FOLDER)
        shutil.rmtree(FOLDER, ignore_errors=True)
        _is_own(FOLDER)


def _save(save: Callable[..., None], *compiled: Any) -> None:
    """Keep compiled code; if that fails, as on a full disk, the function is used all the same."""
    try:
        save(*compiled)
    except OSError as error:
        _warn_once(f"compiled code cannot be kept in {FOLDER}: {error.strerror}; free space there")


_warn_once = cache(_LOG.warning)


class _PartOfCallers(JITCodeLibrary):
    """The code of a function that becomes machine code only within its callers."""

    # There is no machine code into which numba could write the place of constants.
    codegen = SimpleNamespace(set_env=lambda *_: None)

    def _optimize_final_module(self) -> None:
        """Leave that to the callers, which would do it again."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, _: str) -> int:
        return 0


class _PartCompiler(Compiler):
    def compile_extra(self, function: Callable[..., Any]) -> Any:
        codegen = self.state.targetctx.codegen()
        self.state.library = _PartOfCallers(codegen, function.__qualname__)
        return super().compile_extra(function)


def _refuse(function: Callable[..., Any], *_: Any) -> None:
    raise TypeError(f"{function.__qualname__} is for compiled functions; Python cannot call it")


def _without_constants(template: Callable[..., Any], places: Any, names: dict[str, Any]) -> Any:
    kinds = {name: numba.types.unliteral(kind) for name, kind in names.items()}
    return template(tuple(map(numba.types.unliteral, places)), kinds)


def njit(**options: Any) -> Callable[[F], F]:
    """Return ``numba.njit`` with ``options``, a folder for its code and no interpreter lock.

    Without a wrapper for Python (``no_cpython_wrapper``), a function has code in its callers only,
    and calls from Python raise TypeError. No function gets numba's wrapper for C.
    """
    is_part = "no_cpython_wrapper" in options
    options |= {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
    if is_part:
        options |= {"pipeline_class": _PartCompiler}
    compiled: Any = partial(numba.njit, **options)

    def decorate(function: F) -> F:
        # numba chooses the folder of a function now, and other packages keep theirs.
        with _LOCK:
            before, _CONFIG.CACHE_DIR = _CONFIG.CACHE_DIR, str(FOLDER)
            try:
                made: F = compiled(cache=FOLDER is not None and not is_part)(function)
            except RuntimeError:  # the function has no file, or the folder is full
                made = compiled()(function)
            finally:
                _CONFIG.CACHE_DIR = before
        kept: Any = made
        kept._cache.save_overload = partial(_save, kept._cache.save_overload)
        # numba would compile a version for each constant.
        kept.get_call_template = partial(_without_constants, kept.get_call_template)
        if is_part:
            # numba would call a null pointer.
            kept._insert = lambda *_: None
            kept._compile_for_args = partial(_refuse, function)
        return made

    return decorate


kernel = njit()
"""Decorator that compiles a function."""

borrowing_kernel = njit(_nrt=False, no_cpython_wrapper=True)
"""Decorator for a function that counts no references to the arrays which compiled code gives it.

Counting takes longer than a few additions, so the loops of kernels call such functions. They
allocate and return no arrays, also not in tuples: their callers would release them.
"""

inlined_kernel = njit(forceinline=True, _nrt=False, no_cpython_wrapper=True)
"""Decorator as :data:`borrowing_kernel`; the function is inlined into its callers."""

inlined_allocation = njit(forceinline=True, no_cpython_wrapper=True)
"""Decorator that compiles and inlines a function which allocates or returns arrays."""

copied_kernel = njit(inline="always")
"""Decorator that copies a short function into any caller, where it may return views of arrays."""
