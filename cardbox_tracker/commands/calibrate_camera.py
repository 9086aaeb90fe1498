"""``cardbox calibrate-camera``: the lens of a camera from a film of a board or a sheet of A4."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator
from dataclasses import MISSING, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cardbox_tracker.commands.arguments import Written, check_outputs, option

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cardbox_tracker.camera.board import Board


def _board(given: Any) -> Board:
    from cardbox_tracker.camera.board import Board

    if isinstance(given, Board):
        return given
    try:
        return Board.parse(str(given))
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


@dataclass(frozen=True, kw_only=True)
class Arguments(Written):
    """A film in which a board is moved before the camera.

    Attributes:
        recording: video, folder of images, or rosbag2 of one camera, in which the board is moved
            slowly to all parts of the image and tilted to all sides by 30 degrees and more
        board: inner corners of a chessboard, such as 9x6; charuco:5x7 with the squares of a ChArUco
            board; or a4, a sheet of A4 that is brighter than what is behind it, which shows the
            focal length alone. Sizes in metres do not matter
        output: calibration to write, as camera_calibration does, for --calibration and for drivers
    """

    recording: Path = option("FILM", default=MISSING)
    board: Board = option("9x6|charuco:5x7|a4", _board, required=True)
    output: Path = option("CAMERA.yaml", required=True)


# Images in which the board is sought.
_IMAGES = 200


def run(given: Arguments) -> None:
    """Calibrate, write the file and print what it rests on."""
    from cardbox_tracker.camera.board import board_views, calibrated
    from cardbox_tracker.camera.calibration_file import save_calibration
    from cardbox_tracker.common.errors import CameraError
    from cardbox_tracker.common.progress import progress_bar

    check_outputs((given.output,), given.force, inputs=(given.recording,))
    with progress_bar("calibrate") as show:
        views, shown = board_views(given.board, _images(given.recording, show))
    if not shown:
        other = given.board.other(_images(given.recording))
        raise CameraError(
            f"{given.recording} shows no {given.board}{other}: expected all of it in the image, "
            "sharp, flat, evenly lit and, if it is a sheet, brighter than all behind it; and its "
            "own numbers for --board, of a chessboard those of the corners between its squares"
        )
    height, width = next(_images(given.recording)).shape
    found = calibrated(given.board, views, width, height)
    lens = found.calibration
    save_calibration(given.output, lens)
    focal_px = lens.k[0, 0]
    tangent = width / 2 / focal_px
    fov_deg, slope = math.degrees(2 * math.atan(tangent)), 2 * tangent / (1 + tangent**2)
    print(
        f"field of view {fov_deg:.1f} +- {math.degrees(slope * lens.focal_stddev):.1f} degrees "
        f"across {width}x{height}, focal length {focal_px:.1f} px +- {lens.focal_stddev:.1%}"
    )
    print(
        f"by {found.views} views, of {shown} images with the {given.board}, that are tilted by up "
        f"to {found.turn_deg:.0f} degrees; the corners are {found.error_px:.2f} px off"
    )
    print(f"wrote {given.output}")


def _images(
    recording: Path, show: Callable[[float], None] = lambda _: None
) -> Iterator[NDArray[np.uint8]]:
    """Yield grey images (H, W) from all of a recording."""
    from cardbox_tracker.camera.encodings import brightness_of
    from cardbox_tracker.recordings.open_images import open_images

    with open_images(recording) as source:
        step_ns, next_ns = round(1e9 * source.duration_s / _IMAGES), -math.inf
        for image in source.images(source.image_topic()):
            since_ns = image.time_ns - source.start_ns
            if since_ns >= next_ns:
                next_ns = since_ns + step_ns
                show(min(1.0, since_ns / max(1.0, 1e9 * source.duration_s)))
                yield brightness_of(image.as_sent)
