"""Write the list of kernels that films need, by a run of ``cardbox demo``.

``NUMBA_CACHE_DIR=$(mktemp -d) python -m lab.tools.film_kernels``
"""

from __future__ import annotations

import json
import tempfile
import time
from importlib import import_module
from typing import Any

from numba import types
from numba.core.dispatcher import Dispatcher
from numba.np.numpy_support import as_dtype

from cardbox_tracker.commands.main import main as cardbox
from cardbox_tracker.tracking import precompile
from cardbox_tracker.tracking.precompile import FILM_KERNELS

_PACKAGE = "cardbox_tracker."


def spelled(kind: Any) -> str | list[Any]:
    """Return a type as in :data:`FILM_KERNELS`."""
    is_tuple, is_array = (isinstance(kind, one) for one in (types.BaseTuple, types.Array))
    if is_tuple:
        return [spelled(one) for one in kind]
    name = as_dtype(kind.dtype if is_array else kind).str[1:]
    return f"{kind.ndim if is_array else 0}{'' if not is_array or kind.mutable else 'r'}{name}"


def calls_others(module: str) -> bool:
    """Return whether kernels of a module call those of another one."""
    known = vars(import_module(_PACKAGE + module)).values()
    kernels = (one.py_func.__module__ for one in known if isinstance(one, Dispatcher))
    return any(home != _PACKAGE + module for home in kernels)


def main() -> None:
    """Compile anew, as after an installation, and note what is called and how long it takes."""
    called: dict[str, dict[str, list[Any]]] = {}
    took_s: dict[str, float] = {}
    functions: Any = Dispatcher
    compile_first = functions._compile_for_args

    def noted(self: Dispatcher, *arguments: Any, **named: Any) -> Any:
        begun_s = time.perf_counter()
        made = compile_first(self, *arguments, **named)
        function, kinds = self.py_func, map(self.typeof_pyval, arguments)
        if function.__module__.startswith(_PACKAGE):
            module = function.__module__.removeprefix(_PACKAGE)
            took_s[module] = took_s.get(module, 0.0) + time.perf_counter() - begun_s
            called.setdefault(module, {})[function.__name__] = [*map(spelled, kinds)]
        return made

    functions._compile_for_args = noted
    precompile.compile_for_films = lambda: None
    with tempfile.TemporaryDirectory() as output:
        cardbox(["demo", "--output", output])
    # While one process compiles the slowest module, others do those that share nothing with it.
    slowest = max(called, key=lambda module: took_s[module])
    order = sorted(called, key=lambda one: (one != slowest, calls_others(one), -took_s[one]))
    lines = [f"{json.dumps(module)}: {json.dumps(called[module])}" for module in order]
    FILM_KERNELS.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
