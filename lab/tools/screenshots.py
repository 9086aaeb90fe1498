"""Write the images of the documents: ``python -m lab.tools.screenshots --output docs/images``.

The tool records a synthetic session, measures its person and tracks it, without ROS; the same seed
gives the same images. ``steps.jpg`` has an image, its silhouette and the model over it,
``guidance.jpg`` the guidance while a person is measured.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import cv2
import numpy as np

from cardbox_tracker.applications.drawing.guidance import Guide
from cardbox_tracker.applications.drawing.overlay import ImageArray, draw_overlay
from cardbox_tracker.applications.simulation.motions import Segment, timeline
from cardbox_tracker.applications.simulation.session import synthesize_session
from cardbox_tracker.camera.encodings import brightness_of
from cardbox_tracker.common.errors import CardboxError
from cardbox_tracker.common.files import make_folder, write_file
from cardbox_tracker.common.progress import progress_bar
from cardbox_tracker.measuring.config import InitializationConfig
from cardbox_tracker.measuring.guidance import Prompt, short_words
from cardbox_tracker.person.posture import REFERENCE_NAMES
from cardbox_tracker.recordings.bag_reader import BagReader
from cardbox_tracker.recordings.initialize import initialize_from_recording
from cardbox_tracker.recordings.silhouettes import SilhouetteSource, TimeSpan
from cardbox_tracker.search.config import PRESETS
from cardbox_tracker.tracking.tracker import Tracker

_SCALE = 2
_QUALITY = 82
_WIDTH_PX = 1200
# The moment that is shown, as a fraction of the motion's length.
_SHOWN = ("wave", 0.53)
# Reference, seconds before it is held, and seconds of the count-down. The person is on the way to
# the posture or in it, so that the outline has several colours.
_GUIDED = (("front", -0.3, 1), ("side", 0.9, 3), ("arms", 0.45, 2))
_SETTLED_S = 0.3


def write_screenshots(
    output: Path, seed: int, progress: Callable[[float], None] | None = None
) -> list[Path]:
    """Write the images into the folder ``output`` and return their paths.

    Raises:
        CardboxError: the folder cannot be written.
    """
    make_folder(output)
    segments = {segment.name: segment for segment in reversed(timeline("all"))}
    with tempfile.TemporaryDirectory() as folder:
        session = Path(folder) / "session"
        synthesize_session(
            session, seed=seed, progress=progress and (lambda part: progress(part / 2))
        )
        with BagReader(session) as bag:
            source = SilhouetteSource(bag, _inside(segments["empty"]))
            shots = _shots(source, segments, seed)
    if progress is not None:
        progress(1.0)
    return [_write(output / f"{name}.jpg", image) for name, image in shots.items()]


def _shots(
    source: SilhouetteSource, segments: Mapping[str, Segment], seed: int
) -> dict[str, ImageArray]:
    spans = {name: _inside(segments[name]) for name in REFERENCE_NAMES}
    result = initialize_from_recording(source, spans, InitializationConfig(2.0, seed=seed))
    motion, part = _SHOWN
    shown_s = segments[motion].start_s + part * (segments[motion].end_s - segments[motion].start_s)
    tracker = Tracker(result.body, source.camera, PRESETS["default"](), np.random.default_rng(seed))
    for frame in source.frames(segments["neutral"].start_s, shown_s + 1.0):
        estimate = tracker.track(frame.silhouette, frame.image, frame.stamp_ns)
        if frame.time_s >= shown_s - 1e-6:
            break
    overlay = draw_overlay(frame.image, result.body, tracker.camera, estimate, _SCALE)
    steps = _row([_large(brightness_of(frame.image)), _large(frame.silhouette), overlay])
    return {"steps": steps, "guidance": _guidance(source, segments)}


def _guidance(source: SilhouetteSource, segments: Mapping[str, Segment]) -> ImageArray:
    """Draw the mirrored guidance before the references are captured."""
    guide = Guide(source.camera, InitializationConfig(2.0))
    shown = []
    for name, before_s, left_s in _GUIDED:
        frame = next(source.frames(segments[name].start_s - before_s))
        step = Prompt(name, short_words(name, guide.config.side_turn), left_s)
        shown.append(guide.draw(step, frame.silhouette, frame.image, mirror=True))
    return _row(shown)


def _inside(segment: Segment) -> TimeSpan:
    """Return the segment without its ends, where the person still moves."""
    return TimeSpan(segment.start_s + _SETTLED_S, segment.end_s - _SETTLED_S)


def _large(image: ImageArray) -> ImageArray:
    large = cv2.resize(image, None, fx=_SCALE, fy=_SCALE, interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.cvtColor(large, cv2.COLOR_GRAY2BGR), np.uint8)


def _row(images: list[ImageArray]) -> ImageArray:
    """Return images side by side with a white gap, at most ``_WIDTH_PX`` wide."""
    gap = np.full((images[0].shape[0], 8, 3), 255, np.uint8)
    row = np.hstack([part for image in images for part in (gap, image)][1:])
    factor = min(1.0, _WIDTH_PX / row.shape[1])
    size = (round(factor * row.shape[1]), round(factor * row.shape[0]))
    return np.asarray(cv2.resize(row, size, interpolation=cv2.INTER_AREA), np.uint8)


def _write(path: Path, image: ImageArray) -> Path:
    data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1]
    write_file(path, data.tobytes())
    return path


def main(arguments: list[str] | None = None) -> int:
    """Write the images; the exit code is 1 after an error."""
    parser = argparse.ArgumentParser(prog="python -m lab.tools.screenshots", description=__doc__)
    parser.add_argument("--output", type=Path, required=True, metavar="DIR", help="folder to fill")
    parser.add_argument("--seed", type=int, default=0, help="of recording and filters")
    options = parser.parse_args(arguments)
    try:
        with progress_bar("screenshots") as show:
            written = write_screenshots(options.output, options.seed, show)
    except CardboxError as error:
        print(f"screenshots: {error}", file=sys.stderr)
        return 1
    print("\n".join(f"wrote {path}" for path in written))
    return 0


if __name__ == "__main__":
    sys.exit(main())
