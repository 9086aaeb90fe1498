"""Options of single recordings of a folder, in files beside them."""

from __future__ import annotations

import argparse
import copy
import shlex
from pathlib import Path, PurePosixPath
from typing import Any, NoReturn

from cardbox_tracker.commands.tracking import add_inputs
from cardbox_tracker.errors import CardboxError
from cardbox_tracker.files import UnreadableFileError, read_regular

ENDING = ".options"
_MOST_BYTES = 64 * 1024
# An option of a file takes the place of these, which do not go with it.
_REPLACED = {
    "model": ("stature", "distance", "camera_pitch_deg"),
    "stature": ("model",),
    "background": ("within", "silhouettes"),
    "within": ("background", "silhouettes"),
    "silhouettes": ("background", "within"),
    "fov": ("calibration",),
    "calibration": ("fov",),
}
_FILE_OR_WORD = ("detector",)


def options_of(options: argparse.Namespace, folder: Path, name: str) -> argparse.Namespace:
    """Return the options of one recording of ``folder``.

    The file ``NAME.options`` beside a recording, or beside a folder of recordings, has options as
    they are typed. They change those of the command line, and inner files those of outer ones.
    Paths in a file begin at the folder of the file.

    Args:
        options: the command line.
        folder: the folder of all recordings.
        name: name of the recording, see :func:`~.recordings.folder.recordings_in`.

    Raises:
        CardboxError: a file cannot be read, or has options that tracking does not know.
    """
    found = copy.copy(options)
    for part in reversed([PurePosixPath(name), *PurePosixPath(name).parents][:-1]):
        path = folder / f"{part}{ENDING}"
        if path.exists():
            given = _read(path)
            for option in given:
                for other in _REPLACED.get(option, ()):
                    setattr(found, other, None)
            vars(found).update(given)
    return found


def _read(path: Path) -> dict[str, Any]:
    """Return the values of the options in a file, by their names in a namespace."""
    try:
        text = read_regular(path, _MOST_BYTES).decode()
        words = shlex.split(text, comments=True)
    except UnreadableFileError as error:
        raise CardboxError(f"cannot read {path}: {error}") from None
    except ValueError as error:  # no UTF-8, or a quotation mark without its second
        raise CardboxError(
            f"{path} has no options as they are typed: {error}; give options of 'cardbox track' in "
            "UTF-8, such as --stature 1.75"
        ) from None
    parser = _parser(path)
    absent = object()
    values = argparse.Namespace(**dict.fromkeys(vars(parser.parse_args([])), absent))
    parser.parse_args(words, values)
    given = {name: value for name, value in vars(values).items() if value is not absent}
    for name, value in given.items():
        if isinstance(value, Path):
            given[name] = path.parent / value
        elif name in _FILE_OR_WORD and (path.parent / value).is_file():
            given[name] = str(path.parent / value)
    return given


def _parser(path: Path) -> argparse.ArgumentParser:
    """Return a parser of the options of tracking, whose errors name the file."""

    class Parser(argparse.ArgumentParser):
        def error(self, message: str) -> NoReturn:
            raise CardboxError(f"{path}: {message}; give options of 'cardbox track'")

    parser = Parser(add_help=False, allow_abbrev=False)
    add_inputs(parser, needs_recording=False, needs_person=False)
    return parser
