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
    from cardbox_tracker.applications.exporting.formats import Result

_WITH_UNIT = ("fov_deg", "stature_m", "distance_m", "within_m", "start_s", "end_s")


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise CardboxError(f"track: {message}; keywords are options of 'cardbox track'")


def track(recording: str | os.PathLike[str], **options: Any) -> Result:
    """Track a recording as ``cardbox track`` does; return the results, of ``person`` or the first.

    The ``options`` are those of the command, see ``docs/python.md``; ``detector`` may also be an
    object with ``detect(image)``. Without ``csv`` no table is kept. Raises CardboxError if options
    are wrong, or a file cannot be read or written.
    """
    from cardbox_tracker.applications.exporting.formats import read_result
    from cardbox_tracker.recordings.open_images import is_one_recording

    own = options.get("detector")
    is_own = own is not None and not isinstance(own, str | os.PathLike)
    parser = _Parser(prog="track", add_help=False, allow_abbrev=False)
    command.add_arguments(parser)
    words = (_words(*one) for one in options.items() if not (is_own and one[0] == "detector"))
    parsed = parser.parse_args([*(w for some in words for w in some), "--", os.fspath(recording)])
    if is_own and parsed.detector is not None:
        parser.error("detector and detector_class are both given")
    if parsed.export and parsed.csv is None:
        parser.error("export writes beside the table: give csv, or save the result")
    parsed.detector = own if is_own else parsed.detector
    if parsed.recording.is_dir() and not is_one_recording(parsed.recording):
        raise CardboxError(f"{recording} is no recording; track its recordings one by one")
    with TemporaryDirectory() as folder:
        parsed.csv = parsed.csv or Path(folder, "results.csv")
        command.track_one(parsed, show=lambda _: None)
        person = parsed.person if parsed.people is not None else None
        return replace(read_result(parsed.csv, person), path=parsed.recording)


def _words(name: str, value: Any) -> Iterator[str]:
    flag = "--" + (name.rpartition("_")[0] if name in _WITH_UNIT else name).replace("_", "-")
    if isinstance(value, dict):
        texts = (
            (key, str(one).lower() if isinstance(one, bool) else one) for key, one in value.items()
        )
        yield from (f"{flag}={key}={text}" for key, text in texts)
    elif isinstance(value, tuple | list) and name == "cameras":
        yield from (flag, *value)
    elif isinstance(value, tuple | list):
        yield f"{flag}={(':' if name == 'background' else ',').join(map(str, value))}"
    elif value is not None and value is not False:
        yield flag if value is True else f"{flag}={value}"
