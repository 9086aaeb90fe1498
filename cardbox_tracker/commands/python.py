"""``cardbox_tracker.track``: what ``cardbox track`` does, from Python (``docs/python.md``)."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NoReturn

from cardbox_tracker.commands import track as command
from cardbox_tracker.common.errors import CardboxError

if TYPE_CHECKING:
    from cardbox_tracker.applications.exporting.result import Result

# Options whose keywords end in their unit.
_UNITS = ("fov_deg", "stature_m", "distance_m", "within_m", "start_s", "end_s")
# Options that take several words, and the separator of numbers in one word.
_SEVERAL, _SEPARATORS = ("cameras",), {"background": ":"}


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise CardboxError(f"track: {message}; keywords are options of 'cardbox track'")


def track(recording: str | os.PathLike[str], **options: Any) -> Result:
    """Track the posture in a recording, as ``cardbox track`` does.

    Args:
        recording: bag, video, or folder of images.
        options: options of ``cardbox track`` with underscores, such as ``camera_pitch_deg=5``;
            ``fov_deg``, ``stature_m``, ``distance_m``, ``within_m``, ``start_s`` and ``end_s`` have
            their unit. True is a switch, ``background`` a pair of seconds, ``set`` a dict;
            ``detector`` may also be a detector of one's own (``docs/extending.md``). Without
            ``csv`` no table is kept.

    Returns:
        The results; of several people, those of ``person``, by default the first.

    Raises:
        CardboxError: options are wrong, or a file cannot be read or written.
    """
    from cardbox_tracker.applications.exporting.result import read_result
    from cardbox_tracker.recordings.folder import is_one_recording

    own = options.get("detector")
    if own is not None and not isinstance(own, str | os.PathLike):
        del options["detector"]
    else:
        own = None
    parser = _Parser(prog="track", add_help=False, allow_abbrev=False)
    command.add_arguments(parser)
    words = [word for name, value in options.items() for word in _words(name, value)]
    # A recording may begin as an option does.
    parsed = parser.parse_args([*words, "--", os.fspath(recording)])
    if own is not None:
        if parsed.detector is not None:
            parser.error("detector and detector_class are both given")
        parsed.detector = own
    if parsed.recording.is_dir() and not is_one_recording(parsed.recording):
        parser.error(f"{recording} is no recording; track its recordings one by one")
    with TemporaryDirectory() as folder:
        parsed.csv = parsed.csv or Path(folder, "results.csv")
        command.track_one(parsed, show=lambda _: None)
        person = parsed.person if parsed.people is not None else None
        return replace(read_result(parsed.csv, person), path=parsed.recording)


def _words(name: str, value: Any) -> Iterator[str]:
    """Yield the words of an option, as they are typed."""
    option = name.rpartition("_")[0] if name in _UNITS else name
    flag = f"--{option.replace('_', '-')}"
    if value is True:
        yield flag
    elif isinstance(value, dict):
        for key, one in value.items():
            yield f"{flag}={key}={str(one).lower() if isinstance(one, bool) else one}"
    elif name in _SEVERAL:
        yield flag
        yield from [value] if isinstance(value, str) else map(str, value)
    elif isinstance(value, tuple | list):
        yield f"{flag}={_SEPARATORS.get(name, ',').join(map(str, value))}"
    elif value is not None and value is not False:
        yield f"{flag}={value}"
