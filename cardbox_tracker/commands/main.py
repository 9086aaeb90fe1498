"""The ``cardbox`` command: parses the arguments, runs a subcommand and reports its errors."""

from __future__ import annotations

import argparse
import io
import os
import signal
import sys
from collections.abc import Callable, Container, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from cardbox_tracker import __version__
from cardbox_tracker.commands.arguments import add_options
from cardbox_tracker.common import interrupts
from cardbox_tracker.common.errors import CardboxError, plain

# The order is that of 'cardbox --help'.
COMMANDS = {
    "demo": "track a film of a real person and show the error; with --live, run the nodes",
    "synthesize": "record a synthetic person, with ground truth",
    "initialize": "measure the person in a recording",
    "body": "make a body model from a person's stature, without a recording",
    "calibrate-camera": "find the lens of a camera from a film of a board or a sheet of A4",
    "calibrate-extrinsics": "find where several cameras stand, from the person in a recording, "
    "without a board",
    "detector": "install the network files of the person detector, or check them",
    "track": "follow the posture through a recording, or through all recordings of a folder",
    "view": "show results in a viewer: image, body in 3D, plots, error, a slider for the time",
    "export": "write results as TRC, MOT, BVH or C3D, or as joint angles of the ISB",
    "rula": "score the strain on arms, neck and trunk in a recording, or in its results (RULA)",
    "reba": "score the strain on the whole body in a recording, or in its results (REBA)",
    "retarget": "move a robot arm, given by its URDF, as the measured person moves theirs",
    "stream": "stream results as 24 joints in real time, to programs that teleoperate robots",
    "benchmark": "measure how fast the tracker is on this machine (in a checkout)",
    "urdf": "print the robot description (URDF) of a measured person",
    "call": "call a service of the running nodes, as 'ros2 service call' does",
    "evaluate": "in a checkout: compare recorded sessions with their truth, or repeat the paper's "
    "experiments",
}
"""Each subcommand with one line for ``cardbox --help``, without a capital letter or a full stop.

Its module has ``Arguments``, whose fields are its options, and ``run(arguments)``, which does the
work and prints the result, and raises CardboxError if the user can correct the cause. That of
``lab/`` has ``add_arguments(parser)`` in place of ``Arguments``.
"""

_PACKAGE = Path(__file__).parents[1]
LAB = {
    "benchmark": ("lab.benchmarks.command", "'make benchmark'"),
    "evaluate": (
        "lab.evaluation.command",
        "'make experiments', 'make sessions' or 'make people'",
    ),
}
"""Module of each of these subcommands, and the commands of ``make`` that do the same."""

# A folder of recordings has many reasons.
_MOST_OF_AN_ERROR = 20_000
_NO_MEMORY = -4  # cv2.Error.StsNoMem
_DESCRIPTION = """\
The 3D posture of one person's upper body, from the silhouettes that one
or more fixed cameras see. These commands work on recordings (rosbag2, videos,
images); live, use the nodes background, initializer, tracker, detector, camera
and play_bag."""
_EPILOG = """\
in this order, on a recording of your own or on a synthetic one:
  cardbox synthesize --motion wave --output session
  cardbox initialize session --background 0:3.9 --front 6.8:8.2 --side 9.8:11.2 \\
      --arms 12.8:14.2 --distance 2.0 --output person.yaml
  cardbox track session --model person.yaml --background 0:3.9 --start 15.6 \\
      --csv person.csv --video person.mp4
or on a film of your own, which writes film.csv and the body that was used:
  cardbox track film.mp4 --fov 60 --stature 1.75 --detector mediapipe
Times are seconds from the start of the recording.
'cardbox COMMAND --help' explains a command."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``cardbox``; return its exit code: 0, 1 after an error, 128 + N after the signal N.

    Raises:
        SystemExit: the arguments are wrong (code 2), or they ask for help or the version (code 0).
    """
    if isinstance(sys.stdout, io.TextIOWrapper):
        # Names of files may be no UTF-8.
        sys.stdout.reconfigure(errors="backslashreplace")
    words = sys.argv[1:] if arguments is None else list(arguments)
    name = words[0] if words else ""
    try:
        with interrupts.raised():
            parser = build_parser(words)
            options = parser.parse_args(words)
            options.run(options)
            sys.stdout.flush()
    except CardboxError as error:
        print(f"cardbox {name}: {plain(str(error), _MOST_OF_AN_ERROR)}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return _interrupted(name)
    except BrokenPipeError:
        # The reader has closed the pipe, as in 'cardbox urdf MODEL.yaml | head', which is no error.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except Exception as error:
        if interrupts.received():
            # An interrupted import or call of ROS raises errors of its own.
            return _interrupted(name)
        if isinstance(error, ImportError | MemoryError) or getattr(error, "code", 0) == _NO_MEMORY:
            remedy = "allow more memory, as with 'ulimit -v', or install the package anew"
            print(f"cardbox {name}: {str(error) or 'no memory is left'}; {remedy}", file=sys.stderr)
            return 1
        if not isinstance(error, OSError):
            raise
        # This may be a full disk. Outputs are written atomically, so none is left incomplete.
        where = f"{error.filename}: " if error.filename else ""
        print(f"cardbox {name}: {where}{error.strerror or error}", file=sys.stderr)
        return 1
    return 0


def _interrupted(name: str) -> int:
    number = interrupts.received() or signal.SIGINT
    word = "interrupted" if number == signal.SIGINT else "terminated"
    print(f"cardbox {name}: {word}", file=sys.stderr)
    return 128 + number


def build_parser(words: Container[str] = COMMANDS) -> argparse.ArgumentParser:
    """Return the parser of ``cardbox``.

    Only the subcommand in the words of a command line is imported and gets its arguments, so that
    ``cardbox --help`` is fast; by default all do.
    """
    parser = argparse.ArgumentParser(
        prog="cardbox", formatter_class=_Formatter, description=_DESCRIPTION, epilog=_EPILOG
    )
    parser.add_argument("--version", action="version", version=f"cardbox {__version__}")
    group = parser.add_subparsers(
        dest="command", required=True, metavar="COMMAND", title="commands"
    )
    for name, text in COMMANDS.items():
        description = f"{text[0].upper()}{text[1:]}."
        added = group.add_parser(
            name, help=text, description=description, formatter_class=_Formatter
        )
        added.register("action", None, _Once)
        if name in words:
            added.set_defaults(run=_add(added, name))
    return parser


def _add(parser: argparse.ArgumentParser, name: str) -> Callable[[argparse.Namespace], None]:
    """Add the arguments of a subcommand; return the function that runs it."""
    if name in LAB:
        module = from_checkout(*LAB[name])
        module.add_arguments(parser)
        run: Callable[[argparse.Namespace], None] = module.run
        return run
    module = import_module(f"cardbox_tracker.commands.{name.replace('-', '_')}")
    add_options(parser, module.Arguments)
    return lambda options: module.run(module.Arguments.of(options))


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


class _Once(argparse._StoreAction):
    """Stores the value of an option, and says so where it replaces another one."""

    _taken: argparse.Namespace | None = None

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, *given: Any
    ) -> None:
        if self.option_strings and self._taken is namespace:
            name = self.option_strings[-1]
            print(f"cardbox: {name} is given more than once; the last one counts", file=sys.stderr)
        self._taken = namespace
        super().__call__(parser, namespace, *given)


class _Formatter(argparse.RawDescriptionHelpFormatter):
    """Help formatter that shows a default only if there is one."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=26)

    def _get_help_string(self, action: argparse.Action) -> str | None:
        default = action.default
        if default is None or default is False or default in ([], argparse.SUPPRESS):
            return action.help
        return f"{action.help} (default: %(default)s)"


if __name__ == "__main__":
    exit_code = main()
    if interrupts.received():
        # Python would wait for a thread in which foreign code hangs.
        interrupts.leave(exit_code)
    sys.exit(exit_code)
