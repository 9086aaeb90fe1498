"""numba's ``njit`` with a cache on disk that tolerates missing folders and damaged files.

numba stores compiled code beside the sources, below the home folder, or in ``NUMBA_CACHE_DIR``. If
it can write to none of them, the import of a module fails; if a file of the cache is truncated,
each call fails. This module then uses a folder below the folder for temporary files, or no cache,
and compiles damaged code again.

Compiled code contains its callees and the constants of other files, but numba only checks the file
of the function itself. Here an entry is valid for one state of all kernel sources of a package, see
:func:`digest_of_kernels`. A newer entry overwrites the older one. Code with bounds checks
(``NUMBA_BOUNDSCHECK=1``, ``make bounds``) has entries of its own.

Before numba loads code from its cache, it registers what only its compiler needs, and imports the
modules whose functions the code contains, and SciPy with them: 0.3 s. Here it does neither.

A user who can write to the folder of the cache can execute code in each program that loads it. So
the folder belongs to the user, and only the user may write to it; other folders are not used.
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import pickle
import re
import stat
import sys
import tempfile
from collections.abc import Callable
from functools import cache as cached
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.environment import Environment, lookup_environment
from numba.core.runtime.nrt import rtsys

_LOG = logging.getLogger(__name__)
_said: set[str] = set()

F = TypeVar("F", bound=Callable[..., Any])

_PACKAGE = os.path.dirname(os.path.abspath(__file__))
_IMPORT = re.compile(rb"^from (\S+) import (\([^)]*\)|.*)", re.MULTILINE)
_LINE_NUMBER = re.compile(r"-\d+(?=\.py)")


def njit(*, cache: bool = False, **options: Any) -> Callable[[F], F]:
    """Return a decorator that compiles a function, like ``numba.njit`` with ``options``.

    Args:
        cache: store the compiled code on disk if that is possible.
        options: options of ``numba.njit``.
    """

    def decorate(function: F) -> F:
        dispatcher: Any = numba.njit(**options)(function)
        made = _cache_of(function) if cache else None
        if made is not None:
            dispatcher._cache = made
        compiled: F = dispatcher
        return compiled

    return decorate


kernel = njit(cache=True, nogil=True, error_model="numpy")
"""Decorator that compiles a function, which runs without the interpreter's lock."""

borrowing_kernel = njit(cache=True, nogil=True, error_model="numpy", _nrt=False)
"""Decorator that compiles a function which counts no references to the arrays that it is given.

Counting takes longer than a few additions, so the loops of kernels call such functions. They
allocate and return no arrays, also not in tuples: their callers would release them.
"""

inlined_kernel = njit(cache=True, nogil=True, error_model="numpy", forceinline=True, _nrt=False)
"""Decorator as :data:`borrowing_kernel`; the function is inlined into its callers."""

inlined_allocation = njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
"""Decorator that compiles and inlines a function which allocates or returns arrays."""

copied_kernel = njit(nogil=True, error_model="numpy", inline="always")
"""Decorator that copies a short function into any caller, where it may return views of arrays."""


@cached
def digest_of_kernels(package: str) -> str:
    """Return a digest of all sources that compiled code of a package may contain.

    These are the files that import this module, and the files that they import, because their
    constants are compiled into the code.

    Args:
        package: folder of a top-level package.
    """
    sources = {}
    for folder, _, names in os.walk(package):
        for path in (os.path.join(folder, name) for name in names if name.endswith(".py")):
            with open(path, "rb", buffering=0) as file:
                sources[path] = file.read()
    used = {path for path, text in sources.items() if b"cardbox_tracker.compiling" in text}
    for module, names in [found for path in used for found in _IMPORT.findall(sources[path])]:
        place = os.path.join(os.path.dirname(package), *module.decode().split("."))
        used.add(f"{place}.py")
        used.update(f"{place}/{name.decode()}.py" for name in re.findall(rb"\w+", names))
    digest = hashlib.sha256()
    for path in sorted(used & sources.keys()):
        digest.update(os.path.relpath(path, package).encode() + b"\0" + sources[path] + b"\0")
    return digest.hexdigest()


def _package_of(file: str) -> str | None:
    """Return the folder of a source file's top-level package; None without a package."""
    folder, found = os.path.dirname(os.path.abspath(file)), None
    while os.path.isfile(os.path.join(folder, "__init__.py")):
        folder, found = os.path.dirname(folder), folder
    return found


def own_folder() -> Path | None:
    """Return a folder for the cache that only this user can write to; None if there is none."""
    folder = Path(tempfile.gettempdir()) / f"cardbox_tracker-{os.geteuid()}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return None
    is_ours = stat.S_ISDIR(found.st_mode) and found.st_uid == os.geteuid()
    return folder if is_ours and not found.st_mode & 0o077 else None


def _cache_of(function: Callable[..., Any]) -> _Cache | None:
    """Return the cache of a function in numba's folder, or else in :func:`own_folder`; or None."""
    try:
        return _Cache(function)
    except (RuntimeError, OSError):
        folder = own_folder()
    if folder is not None:
        config: Any = numba.config
        before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
        try:
            return _Cache(function)
        except (RuntimeError, OSError):
            pass
        finally:
            config.CACHE_DIR = before
    _say(
        "compiled code cannot be kept, so that each start compiles for one to two minutes; set "
        "NUMBA_CACHE_DIR to a folder that only you can write to"
    )
    return None


class _Cache(FunctionCache):
    """numba's cache of one function; a damaged entry counts as missing."""

    def __init__(self, function: Callable[..., Any]) -> None:
        """Choose the folder of the cache.

        Raises:
            RuntimeError: no folder can be written to.
        """
        super().__init__(function)
        locator = self._impl.locator
        packages = {_PACKAGE, _package_of(function.__code__.co_filename) or _PACKAGE}
        digests = tuple(digest_of_kernels(package) for package in sorted(packages))
        # Names without line numbers, so that a moved function leaves no old files behind.
        name = _LINE_NUMBER.sub("", self._impl.filename_base)
        settings: Any = numba.config
        if settings.BOUNDSCHECK:
            name += ".bounds"
        stamp = locator.get_source_stamp(), digests
        self._cache_file = _CacheFile(locator.get_cache_path(), name, stamp)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled code; None if it is missing or damaged."""
        try:
            # numba's method refreshes the target first, which a compilation does anyway.
            rtsys.initialize(target_context)
            return self._load_overload(sig, target_context)
        except Exception as error:
            _say(f"compiled code in {self.cache_path} is damaged ({error!r}); it is made again")
            self._empties()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store the compiled code, if that is possible."""
        try:
            super().save_overload(sig, data)
        except Exception as error:
            # No entry can be added to a truncated index.
            if self._empties():
                with contextlib.suppress(Exception):
                    super().save_overload(sig, data)
                    return
            _say(f"compiled code cannot be kept in {self.cache_path}: {error!r}")

    def _empties(self) -> bool:
        try:
            self.flush()
        except OSError:
            self._enabled = False
            return False
        return True


class _CacheFile(IndexDataCacheFile):
    """numba's file of compiled code, read without importing the modules of its environments."""

    def _load_data(self, name: str) -> Any:
        with open(self._data_path(name), "rb") as file:
            return _Unpickler(file).load()


class _Unpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if (module, name) == ("numba.core.environment", "_rebuild_env"):
            return _environment
        return super().find_class(module, name)


def _environment(module: str, constants: list[Any], name: str) -> Any:
    """Return an environment of compiled code, which uses its constants, but not its globals."""
    found: Any = lookup_environment(name)
    if found is None:
        loaded = sys.modules.get(module)
        found = Environment({"__name__": module} if loaded is None else vars(loaded))
        found.consts[:] = constants
        found.env_name = name
        Environment._memo[name] = found
    return found


def _say(text: str) -> None:
    """Warn, once in a process."""
    if text not in _said:
        _said.add(text)
        _LOG.warning(text)
