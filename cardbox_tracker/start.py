"""Start a program of the package: ``python -m cardbox_tracker.start NAME ARGUMENTS``.

All executables begin here, before any slow import, so that a signal meanwhile ends them without a
traceback. ``colcon build`` outside the virtual environment makes executables for the system's
Python, which lacks numba and rosbags; the error names the missing package.
"""

from __future__ import annotations

import sys
from types import TracebackType


def _told(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Write an error that ends the program, but no traceback of a Ctrl-C."""
    if not issubclass(kind, KeyboardInterrupt):
        sys.__excepthook__(kind, error, trace)


# The imports below take some time, in which Ctrl-C may come.
sys.excepthook = _told

import os  # noqa: E402
import sysconfig  # noqa: E402
from collections.abc import Callable  # noqa: E402
from functools import partial  # noqa: E402
from importlib import import_module  # noqa: E402
from pathlib import Path  # noqa: E402
from pickle import UnpicklingError  # noqa: E402

from cardbox_tracker.common import garbage, interrupts  # noqa: E402

# The matrices are small: threads of OpenBLAS wait for each other far longer than they compute,
# most of all where several nodes share the cores. It reads this when numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

COMMAND = "cardbox_tracker.commands.main"
"""Module of the executable ``cardbox``."""

NODES: dict[str, str] = {
    "background": "cardbox_tracker.ros.nodes.background_node",
    "initializer": "cardbox_tracker.ros.nodes.initializer_node",
    "tracker": "cardbox_tracker.ros.nodes.tracker_node",
    "camera": "cardbox_tracker.ros.nodes.camera_node",
    "play_bag": "cardbox_tracker.ros.nodes.play_bag_node",
    "detector": "cardbox_tracker.ros.nodes.detector_node",
    "stereo_depth": "cardbox_tracker.ros.nodes.stereo_depth_node",
    "rula": "cardbox_tracker.ros.nodes.rula_node",
    "retarget": "cardbox_tracker.ros.nodes.retarget_node",
    "teleoperation": "cardbox_tracker.ros.nodes.teleoperation_node",
    "cardbox_nodes": "cardbox_tracker.ros.nodes.single_process",
}
"""Module of each executable of ``ros2 run cardbox_tracker`` except ``cardbox``."""


def start(name: str, main: Callable[[], int]) -> int:
    """Run ``main`` of a program; tell a missing package or damaged code in words and return 1."""
    try:
        return main()
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        if missing in ("", "cardbox_tracker"):
            raise
        print(
            f"{name}: the Python package '{missing}' is missing from the Python that this runs "
            f"under, {sys.executable}. Activate the virtual environment into which cardbox_tracker "
            "was installed with pip, source ROS, and build with 'python -m colcon build': outside "
            "of it, 'colcon build' takes the system's Python (docs/tutorial.md)",
            file=sys.stderr,
        )
        return 1
    except (EOFError, UnpicklingError) as error:
        compiling = sys.modules.get("cardbox_tracker.common.compiling")
        if compiling is None or not compiling.is_damage(error):
            raise
        compiling.discard()
        print(f"{name}: start it again", file=sys.stderr)
        return 1


def other_package(script: str, package: str, environment: str) -> bool:
    """Return whether an executable ``script`` runs another ``package`` than its environment has.

    A sourced colcon workspace does this, because ``PYTHONPATH`` precedes the environment, the
    folder ``site-packages``. Where it was built from the same sources, nothing is wrong.
    """
    own = os.path.join(environment, os.path.basename(package))
    scripts = os.path.realpath(sysconfig.get_path("scripts"))
    is_of_environment = os.path.realpath(os.path.dirname(script)) == scripts
    if not (is_of_environment and os.path.isdir(own)) or os.path.samefile(own, package):
        return False
    return _sources(own) != _sources(package)


def _sources(package: str) -> dict[Path, bytes]:
    """Return the content of each source of a package by its path below it."""
    return {one.relative_to(package): one.read_bytes() for one in Path(package).rglob("*.py")}


def _run(name: str) -> int:
    """Import and run the program ``name``; return its exit code."""
    package, environment = os.path.dirname(__file__), sysconfig.get_path("purelib")
    if other_package(sys.argv[0], package, environment):
        print(
            f"{name}: this runs {package}, which PYTHONPATH or a sourced workspace has put before "
            f"the cardbox_tracker in {environment}",
            file=sys.stderr,
        )
    # A node that ends by a signal succeeds; an interrupted command does not.
    interrupts.end_at_once(0 if name in NODES else None)
    if name in NODES:
        garbage.search_seldom()
    code = start(name, lambda: import_module(NODES.get(name, COMMAND)).main())
    if name in NODES:
        interrupts.ignore()
    elif interrupts.received():
        interrupts.leave(code)
    return code


# Functions of the console scripts in setup.py.
globals().update({name: partial(_run, name) for name in (*NODES, "cardbox")})


def main() -> int:
    """Run the program named by the first argument."""
    name = sys.argv[1] if len(sys.argv) > 1 else ""
    if name not in (*NODES, "cardbox"):
        print(f"expected one of {', '.join(NODES)} or cardbox; got '{name}'", file=sys.stderr)
        return 2
    sys.argv = [name, *sys.argv[2:]]
    return _run(name)


if __name__ == "__main__":
    sys.exit(main())
