"""Argument types and options of several subcommands."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Iterable
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from cardbox_tracker.errors import CardboxError

if TYPE_CHECKING:
    from cardbox_tracker.recordings.detector import Detector
    from cardbox_tracker.recordings.point_table import PointTable
    from cardbox_tracker.recordings.recording import Segmentation
    from cardbox_tracker.recordings.silhouettes import TimeSpan


REFERENCES = {
    "front": "faces the camera, arms hanging 20 degrees away from the body",
    "side": "stands the same, turned by 90 degrees",
    "arms": "faces the camera, both arms stretched sideways, hands open",
}
"""Reference postures by name, with the description for the person."""


def add_retired(parser: argparse.ArgumentParser, flag: str, instead: str) -> None:
    """Refuse the option ``flag`` of a former version; ``instead`` says what to do or expect."""

    class Refuse(argparse.Action):
        def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
            parser.error(f"{flag} was removed: {instead}")

    parser.add_argument(flag, action=Refuse, nargs="?", help=argparse.SUPPRESS)


def add_recording(
    parser: argparse.ArgumentParser, required: bool = True, only_bags: bool = True
) -> None:
    """Add the recording to read and the span in which its background is learned.

    The span may be missing unless there are ``only_bags``.
    """
    bag = "rosbag2 folder or file"
    parser.add_argument(
        "recording",
        type=Path,
        nargs=None if required else "?",
        metavar="BAG" if only_bags else "RECORDING",
        help=bag if only_bags else f"{bag}, video, or folder of JPEG or PNG images",
    )
    parser.add_argument(
        "--background",
        type=span,
        required=only_bags,
        default=None,
        metavar="T0:T1",
        help="seconds during which nobody is in view",
    )


def add_depth(parser: argparse.ArgumentParser) -> None:
    """Add ``--depth`` and ``--within``, which may stand for ``--background``."""
    parser.add_argument(
        "--depth",
        default=None,
        metavar="TOPIC",
        help="depth images (16UC1, 32FC1 or compressedDepth) that cover the same view as the first "
        "of --cameras; 'stereo' measures depth in the first two of them, a rectified pair, left "
        "first",
    )
    parser.add_argument(
        "--within",
        type=float,
        default=None,
        metavar="M",
        help="in place of --background: limit of the depth in the images of --depth, metres; "
        "choose it between the person and the wall",
    )


def add_detector(parser: argparse.ArgumentParser) -> None:
    """Add ``--silhouettes`` and ``--detector``."""
    parser.add_argument(
        "--silhouettes",
        choices=("background", "detector", "person_in_view"),
        default=None,
        help="source of the silhouettes: the difference from the scene of --background; the mask "
        "of a person detector ('cardbox detector --install'); or the difference from a scene that "
        "is learned around the person, who must step aside at some time. With neither --background "
        "nor --within, the mask is the default with --detector mediapipe, and person_in_view for "
        "videos and images",
    )
    parser.add_argument(
        "--detector",
        default=None,
        metavar="mediapipe|FILE.csv",
        help="also use 2D points of the person's joints: those of MediaPipe's networks ('cardbox "
        "detector --install'), or a table that any detector has written (docs/detectors.md)",
    )


def silhouettes_of(options: argparse.Namespace) -> Segmentation:
    """Return the source of the silhouettes.

    Raises:
        CardboxError: none or several are given, or the detector is not installed.
    """
    from cardbox_tracker.recordings.depth_silhouettes import Within
    from cardbox_tracker.recordings.detector import MEDIAPIPE, Detector
    from cardbox_tracker.recordings.open_images import is_bag
    from cardbox_tracker.recordings.person_in_view import PersonInView
    from cardbox_tracker.recordings.recording import STEREO

    given = (options.background is not None) + (options.within is not None)
    chosen = options.silhouettes
    if chosen is None and not given and options.detector == MEDIAPIPE:
        chosen = "detector"
    elif chosen is None and not given and not is_bag(options.recording):
        chosen = "person_in_view"
    if chosen in ("detector", "person_in_view"):
        if given:
            raise CardboxError(
                f"--silhouettes {chosen} takes the place of --background and --within: leave them "
                "out"
            )
        return Detector.installed() if chosen == "detector" else PersonInView()
    if given != 1:
        raise CardboxError(
            "expected either --background T0:T1, seconds during which nobody is in view, --within "
            "M with depth images, or --silhouettes detector or person_in_view, which need neither"
        )
    if options.within is None:
        span: TimeSpan = options.background
        return span
    if options.depth in (None, STEREO):
        raise CardboxError("--within needs the topic of depth images: give --depth TOPIC")
    return Within(options.depth, options.within)


def points_of(options: argparse.Namespace) -> Detector | PointTable | None:
    """Return the source of the 2D points that ``--detector`` names; None without the option.

    Raises:
        CardboxError: see :func:`points_named`.
    """
    return None if options.detector is None else points_named(options.detector)


def points_named(name: str) -> Detector | PointTable:
    """Return the source of 2D points of a name: the detector's, or the path of a table.

    Raises:
        CardboxError: the detector is not installed, or there is no such table.
    """
    from cardbox_tracker.recordings.detector import MEDIAPIPE, Detector
    from cardbox_tracker.recordings.point_table import PointTable

    if name == MEDIAPIPE:
        return Detector.installed()
    path = Path(name)
    if not path.is_file():
        raise CardboxError(
            f"--detector is {name!r}; expected {MEDIAPIPE}, or the file of a table of points "
            "(docs/detectors.md)"
        )
    return PointTable(path)


def add_references(parser: argparse.ArgumentParser) -> None:
    """Add the spans of the reference postures, and ``--side-turn``."""
    from cardbox_tracker.body.posture import SIDE_TURNS

    for name, posture in REFERENCES.items():
        parser.add_argument(
            f"--{name}",
            type=span,
            required=True,
            metavar="T0:T1",
            help=f"seconds during which the person {posture}",
        )
    parser.add_argument(
        "--side-turn",
        choices=SIDE_TURNS,
        default="left",
        help="which way the person turns for --side, as they see it",
    )


def print_remarks(*remarks: Iterable[str]) -> None:
    """Print remarks on a recording on the standard error."""
    for remark in chain(*remarks):
        print(f"cardbox: {remark}", file=sys.stderr)


def add_cameras(parser: argparse.ArgumentParser) -> None:
    """Add ``--cameras`` and ``--extrinsics``."""
    parser.add_argument(
        "--cameras",
        nargs="+",
        default=[],
        metavar="NAMESPACE",
        help="cameras of the recording that see the person, such as cam0 cam1, the one that the "
        "person faced first; with one name, that camera alone; not needed if there is only one",
    )
    parser.add_argument(
        "--extrinsics",
        type=Path,
        default=None,
        metavar="FILE",
        help="where further cameras stand, from Kalibr (YAML) or aniposelib (TOML); not needed "
        "for a rectified pair or with /tf_static in the recording",
    )


def add_preset(parser: argparse.ArgumentParser, default: str) -> None:
    """Add ``--preset``, a name of ``estimation.config.PRESETS``."""
    from cardbox_tracker.estimation.config import PRESETS

    parser.add_argument(
        "--preset",
        choices=PRESETS,
        default=default,
        help="tracker settings: paper is Table I of the paper, default tracks best",
    )


def add_seed(parser: argparse.ArgumentParser, what: str) -> None:
    """Add ``--seed``; ``what`` names the random numbers that it determines."""
    parser.add_argument("--seed", type=at_least(0), default=0, help=f"random seed of {what}")


def add_camera_count(parser: argparse.ArgumentParser, several: str) -> None:
    """Add ``--cameras``, a number; ``several`` describes the purpose of more than one."""
    parser.add_argument(
        "--cameras",
        type=int,
        choices=range(1, 5),
        default=1,
        metavar="N",
        help=f"1 to 4; {several}",
    )


def add_camera_pitch(parser: argparse.ArgumentParser, found: str = "") -> None:
    """Add ``--camera-pitch-deg``, None by default if ``found`` says how it is found, else 0."""
    text = "positive when the camera looks down"
    parser.add_argument(
        "--camera-pitch-deg",
        type=float,
        default=None if found else 0.0,
        metavar="P",
        help=f"{text} (default: {found})" if found else text,
    )


def span(text: str) -> TimeSpan:
    """Parse a span ``T0:T1``, seconds from the start of the recording.

    Raises:
        argparse.ArgumentTypeError: the text is not two times, the first before the second.
    """
    from cardbox_tracker.recordings.silhouettes import TimeSpan

    try:
        return TimeSpan.parse(text)
    except ValueError:
        raise argparse.ArgumentTypeError(
            "expected T0:T1, seconds from the start of the recording with T0 before T1, "
            f"got {text!r}"
        ) from None


def time(text: str) -> float:
    """Parse a time in seconds from the start of the recording.

    Raises:
        argparse.ArgumentTypeError: the text is no finite number, or it is negative.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise argparse.ArgumentTypeError(
            f"expected seconds from the start of the recording, got {text!r}"
        )
    return value


def at_least(lowest: int) -> Callable[[str], int]:
    """Return a parser of whole numbers of ``lowest`` or more, which raises ArgumentTypeError."""

    def parse(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = lowest - 1
        if value < lowest:
            raise argparse.ArgumentTypeError(
                f"expected a whole number of {lowest} or more, got {text!r}"
            )
        return value

    return parse
