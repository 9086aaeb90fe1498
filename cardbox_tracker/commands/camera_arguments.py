"""Options that describe the camera of a recording, where the recording does not."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from cardbox_tracker.errors import CardboxError

if TYPE_CHECKING:
    from cardbox_tracker.recordings.detector import Detector
    from cardbox_tracker.recordings.given_camera import GivenCamera
    from cardbox_tracker.recordings.silhouettes import TimeSpan

_MOST_ROLL_DEG, _MOST_FPS = 45.0, 1000.0


def add_camera(parser: argparse.ArgumentParser) -> None:
    """Add ``--fov``, ``--calibration``, ``--camera-roll-deg`` and ``--fps``."""
    lens = parser.add_mutually_exclusive_group()
    lens.add_argument(
        "--fov",
        type=float,
        default=None,
        metavar="DEG",
        help="the camera's field of view across the width of the image as it is shown: webcams 60 "
        "to 78, phones 60 to 70 held sideways and 36 to 43 upright; for videos, images, and bags "
        "without CameraInfo",
    )
    lens.add_argument(
        "--calibration",
        type=Path,
        default=None,
        metavar="FILE",
        help="in place of --fov: YAML file of camera_calibration",
    )
    parser.add_argument(
        "--camera-roll-deg",
        type=_between(-_MOST_ROLL_DEG, _MOST_ROLL_DEG),
        default=None,
        metavar="R",
        help="how far the camera is turned clockwise about its axis, seen from behind it; the "
        "images are turned back",
    )
    parser.add_argument(
        "--fps",
        type=_between(0.0, _MOST_FPS),
        default=None,
        metavar="HZ",
        help="images a second of a folder of images (default: 30), or of a video in slow motion",
    )


def _between(lowest: float, highest: float) -> Callable[[str], float]:
    """Return a parser of numbers in a range, 0 excluded if it is the lowest."""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not lowest <= value <= highest or lowest == 0.0 == value:
            above = "a number above" if lowest == 0.0 else "a number from"
            raise argparse.ArgumentTypeError(
                f"expected {above} {lowest:g} to {highest:g}, got {text!r}"
            )
        return value

    return parse


def camera_of(options: argparse.Namespace) -> GivenCamera:
    """Return the camera that the options describe."""
    from cardbox_tracker.recordings.given_camera import GivenCamera

    roll_rad = math.radians(options.camera_roll_deg or 0.0)
    return GivenCamera(options.fov, options.calibration, roll_rad, options.fps)


def pitch_of(
    options: argparse.Namespace, detector: Detector | None, span: TimeSpan, until_s: float = 0.0
) -> tuple[float, GivenCamera]:
    """Return the camera's pitch, rad, and the camera, whose roll is found unless it is given.

    Without ``--camera-pitch-deg``, both are found from the person who stands upright in ``span``,
    or later up to ``until_s``, if there is a detector.

    Raises:
        CardboxError: the recording cannot be read, or the detector cannot be loaded.
    """
    from dataclasses import replace

    from cardbox_tracker.recordings.standing import camera_of_standing

    camera = camera_of(options)
    if options.camera_pitch_deg is not None:
        return math.radians(options.camera_pitch_deg), camera
    if detector is None:
        return 0.0, camera
    name = options.cameras[0] if options.cameras else None
    standing = camera_of_standing(options.recording, detector, span, camera, name, until_s)
    advice = "give --camera-pitch-deg if it is known"
    if standing is None:
        searched = span._replace(end_s=max(span.end_s, until_s))
        _say(
            f"nobody stands upright at {searched} s, so the camera's pitch is taken as 0; {advice}"
        )
        return 0.0, camera
    found, span = standing
    if not found.is_pitch_found:
        _say(f"the camera's pitch does not show without the feet and is taken as 0; {advice}")
    else:
        degrees = math.degrees(found.pitch_rad)
        _say(
            f"camera pitch {abs(degrees):.0f} degrees {'down' if degrees >= 0 else 'up'} (standard "
            f"deviation {math.degrees(found.pitch_stddev_rad):.0f}), found from the person "
            f"standing upright at {span} s; {advice}"
        )
    if found.roll_rad and options.camera_roll_deg is None and len(options.cameras) < 2:
        _say(
            f"camera roll {math.degrees(found.roll_rad):.1f} degrees, found in the same way: the "
            "images are turned back; give --camera-roll-deg 0 to leave them as they are"
        )
        camera = replace(camera, roll_rad=found.roll_rad)
    return found.pitch_rad, camera


def _say(text: str) -> None:
    print(f"cardbox: {text}", file=sys.stderr)


def detector_among(*sources: object) -> Detector | None:
    """Return the detector among the sources of silhouettes and points; None without one."""
    from cardbox_tracker.recordings.detector import Detector

    return next((source for source in sources if isinstance(source, Detector)), None)


def check_alone(options: argparse.Namespace, names: tuple[str, ...], why: str) -> None:
    """Refuse options that have no effect.

    Raises:
        CardboxError: one of the options ``names`` is given; the text says ``why`` not.
    """
    for name in names:
        if getattr(options, name.lstrip("-").replace("-", "_")) is not None:
            raise CardboxError(f"{name} has no effect {why}")
